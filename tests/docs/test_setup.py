"""Tests the set-up, which reports missing programs before it makes anything, and what .ci/run
needs and installs.
"""

from __future__ import annotations

import ast
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from pages import parsed

ROOT = Path(__file__).parents[2]


def make_setup(tmp_path: Path, *programs: str, **stubs: str) -> subprocess.CompletedProcess[str]:
    """Runs `make setup` where PATH holds these programs and stubs (shell scripts) only."""
    tools = tmp_path / "bin"
    tools.mkdir()
    for name in ("make", "sh", "find", "touch", "mkdir", *programs):
        program = shutil.which(name)
        assert program is not None
        (tools / name).symlink_to(program)
    for name, script in stubs.items():
        (tools / name).write_text(f"#!/bin/sh\n{script}\n")
        (tools / name).chmod(0o755)
    return subprocess.run(
        ["make", "setup", f"VENV={tmp_path / 'venv'}"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        env={"PATH": str(tools)},
    )


def test_a_missing_compiler_is_reported_in_a_line_before_anything_is_made(tmp_path: Path) -> None:
    done = make_setup(tmp_path, "python3")
    assert done.returncode != 0
    assert "no C compiler: looked for cc, gcc and clang, found none; install one" in done.stderr
    assert "Traceback" not in done.stderr + done.stdout
    assert not (tmp_path / "venv").exists()


def test_a_python_without_venv_is_reported_in_a_line_before_anything_is_made(
    tmp_path: Path,
) -> None:
    python = 'if [ "$1" = --version ]; then echo Python 3.11.2; else exit 1; fi'
    done = make_setup(tmp_path, cc="exit 0", python3=python)
    assert done.returncode != 0
    assert "got Python 3.11.2, expected Python 3.11 or later with its venv module" in done.stderr
    assert "apt-get install python3 python3-venv" in done.stderr
    assert "Traceback" not in done.stderr + done.stdout
    assert not (tmp_path / "venv").exists()


# the hooks of the build backend, in a separate process, with a stand-in for scikit-build-core
# that returns which hook was called
ASK = (
    "import build_backend; print(build_backend.{hook}); "
    "import os; print('CC', os.environ.get('CC'))"
)
HOOKS = (
    "get_requires_for_build_wheel()",
    "get_requires_for_build_editable()",
    "build_wheel('dist')",
    "build_editable('dist')",
)
STAND_IN = """
class wheel: pass
def get_requires_for_build_wheel(settings=None): return ["asked"]
get_requires_for_build_editable = get_requires_for_build_wheel
def build_wheel(folder, settings=None, metadata=None): return "built"
build_editable = build_wheel
"""


def ask(
    folder: Path, hook: str, *, compilers: dict[str, str] | None = None, **environment: str
) -> subprocess.CompletedProcess[str]:
    """Calls a hook where nothing is in PATH but these compilers, which are shell scripts."""
    package, path = folder / "modules" / "scikit_build_core", folder / "bin"
    package.mkdir(parents=True, exist_ok=True)
    path.mkdir(exist_ok=True)
    (package / "__init__.py").write_text("")
    (package / "build.py").write_text(STAND_IN)
    for name, script in (compilers or {}).items():
        (path / name).write_text(f"#!/bin/sh\n{script}\n")
        (path / name).chmod(0o755)
    modules = f"{package.parent}:{ROOT / 'tools'}"
    given = {"PATH": str(path), "PYTHONPATH": modules, **environment}
    command = [sys.executable, "-c", ASK.format(hook=hook)]
    return subprocess.run(command, capture_output=True, text=True, check=False, env=given)


@pytest.mark.skipif(sys.platform != "linux", reason="what to install there")
@pytest.mark.parametrize("hook", HOOKS)
def test_a_build_without_a_compiler_ends_at_once_with_one_paragraph(
    tmp_path: Path, hook: str
) -> None:
    done = ask(tmp_path, hook)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.count("\n") == 1
    assert "Traceback" not in done.stderr
    assert "no C compiler: looked for" in done.stderr
    assert "cc and clang, got none in PATH; expected one that compiles" in done.stderr
    assert "apt-get install gcc libc6-dev" in done.stderr


def test_a_compiler_that_cannot_compile_is_reported_with_its_error_message(tmp_path: Path) -> None:
    broken = "echo 'program.c:1:10: fatal error: math.h: No such file or directory' >&2; exit 1"
    done = ask(tmp_path, HOOKS[0], compilers={"gcc": broken})
    assert done.returncode == 1
    assert (
        "gcc is there but fails: program.c:1:10: fatal error: math.h: No such file or directory"
        in done.stderr
    )


@pytest.mark.parametrize("name", ["CMAKE_TOOLCHAIN_FILE", "CMAKE_C_COMPILER"])
def test_a_toolchain_that_is_chosen_for_cmake_is_not_checked(tmp_path: Path, name: str) -> None:
    assert ask(tmp_path, HOOKS[0], CMAKE_ARGS=f"-D{name}=/some/where").returncode == 0
    question = f"{HOOKS[0][:-1]}{{'cmake.define.{name}': '/some/where'}})"
    assert ask(tmp_path, question).returncode == 0


FOLDERS = (
    *("benchmarks", "controller", "cosim", "docs", "examples", "extensions", "fmi", "models"),
    *("packaging", "plant_fmu", "tests", "tools"),
)
FIND = """
import sys
from importlib.util import find_spec
from pathlib import Path

root, *names = sys.argv[1:]
found = {name: find_spec(name) for name in names}
inside = {name: find_spec("hexapod_cosim." + name) for name in names}
places = {name: spec.submodule_search_locations for name, spec in found.items() if spec}
print([name for name in places if f"{root}/{name}" in list(places[name] or ())])
print([name for name, spec in inside.items() if spec])
print([place for place in sys.path if Path(place, "hexapod_cosim", "py.typed").is_file()])
"""


def test_the_installed_package_has_the_modules_of_the_wheel_and_no_others(tmp_path: Path) -> None:
    command = [sys.executable, "-c", FIND, str(ROOT), *FOLDERS]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=tmp_path, env={})
    beside, inside, typed = map(ast.literal_eval, done.stdout.splitlines())
    assert beside == []
    assert inside == ["controller", "cosim", "examples", "extensions", "models"]
    assert typed  # for type checkers (PEP 561)


# Tests what .ci/run needs and installs: a Python with venv of a version that is read, and pinned
# versions of every package, with the hashes of their files.

RUN, CONSTRAINTS = ROOT / ".ci" / "run", ROOT / ".ci" / "constraints.txt"
NAME = re.compile(r"[A-Za-z0-9._-]+")
OWN = {"hexapod_cosim", "benchmarks", "tools", ""}  # modules of this repository; "" is relative
PACKAGES = {  # of modules that are not named as their package
    "PIL": "pillow",
    "mcap_ros2": "mcap-ros2-support",
    "pinocchio": "pin",
    "xdist": "pytest-xdist",
    "yaml": "pyyaml",
}


def normal(name: str) -> str:
    """Returns a package's name as package indices compare it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def test_every_dependency_is_pinned_in_a_version() -> None:
    lines = [
        line
        for line in CONSTRAINTS.read_text(encoding="utf-8").splitlines()
        if line and not line.startswith("#")
    ]
    assert [line for line in lines if not re.fullmatch(r"[\w.-]+==[\w.+!-]+", line)] == []
    pinned = {normal(line.partition("==")[0]) for line in lines}
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    needed = [*project["dependencies"], *project["optional-dependencies"]["test"]]
    names = {normal(match[0]) for text in needed if (match := NAME.match(text))}
    assert names - pinned - {"hexapod-cosim"} == set()


def test_the_extra_for_tests_names_every_package_that_the_tests_import() -> None:
    files = sorted((ROOT / "tests").rglob("*.py"))
    known = OWN | {path.stem for path in files} | set(sys.stdlib_module_names)
    used = {name for path in files for name in modules(path)} - known
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    given = [*project["dependencies"], *extras["test"], *extras["studies"], *extras["parquet"]]
    named = {normal(match[0]) for text in given if (match := NAME.match(text))}
    assert "hexapod-cosim[parquet,studies]" in extras["test"]
    assert {normal(PACKAGES.get(name, name)) for name in used} - named == set()


def modules(path: Path) -> set[str]:
    """Returns the first names of the modules that a file imports, wherever in it."""
    nodes = list(ast.walk(parsed(path)))
    names = [one.name for node in nodes if isinstance(node, ast.Import) for one in node.names]
    names += [node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)]
    return {name.partition(".")[0] for name in names}
