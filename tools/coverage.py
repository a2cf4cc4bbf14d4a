"""Measures which branches of plant, controllers and FMI layer their tests take, file by file.

usage: python -m tools.coverage [--reuse]      (make coverage)

Everything is built by gcc with counters (preset coverage: -Og, the baseline kernel alone, and no
function inlined). The native tests and the Python tests in TESTS run on that build; gcovr reads the
counters. Each branch of the source counts once: not once for each place where its function is
inlined, and not once for each file that includes a header of plant_fmu/src/lanes. Prints a table in
Markdown and writes build/coverage/branches.json and build/coverage/lines.txt, which marks the
branches that no test took. --reuse reads the counters of an earlier run.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BUILD = ROOT / "build" / "coverage"
TESTS = (
    *(f"tests/fmi/test_{name}.py" for name in ("fmi", "fmi3", "fmi3_order", "fmi_state")),
    "tests/fmi/test_fmi_values.py",
    "tests/exchange",
    *(f"tests/plant/test_plant_{name}.py" for name in ("misuse", "coordinates", "functions")),
    *(f"tests/plant/test_plant_{name}.py" for name in ("events", "state", "measure")),
    "tests/native_control",
    "tests/fuzz/test_findings.py",
    "tests/friction",
    "tests/ground",
    "tests/soil",
    "tests/servos",
    "tests/trust/test_grid_refusals.py",
)
# gcc's own counters are exported functions too
LEFT_OUT = ("--deselect", "tests/fmi/test_fmi.py::test_no_other_function_is_exported")
FILES = ("plant_fmu/.*", "controller/fmu/.*", "fmi/.*")
NO_TESTS_NEEDED = (".*/generated/.*",)  # tables


def run(*command: str, check: bool = True) -> bool:
    """Runs a command in the repository with the environment's programs first; returns whether it
    succeeded. Raises SystemExit when it must and did not.
    """
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    env = os.environ | {"PATH": path, "HEXAPOD_PRESET": "coverage"}
    done = subprocess.run(command, cwd=ROOT, env=env, check=False)
    if check and done.returncode != 0:
        raise SystemExit(f"coverage: {' '.join(command[:3])} ... returned {done.returncode}")
    return done.returncode == 0


def measure() -> bool:
    """Builds with counters and runs the tests; returns whether all passed."""
    for counters in BUILD.rglob("*.gcda"):
        counters.unlink()
    settings = str(ROOT / "tools" / "cmake" / "coverage.cmake")
    where = ["-S", str(ROOT), "-B", str(BUILD), "-C", settings]
    configure = ["cmake", *where, f"-DPython_EXECUTABLE={sys.executable}"]
    fresh = not (BUILD / "CMakeCache.txt").exists()
    run(*configure, "--log-level=WARNING", *(["-G", "Ninja"] if fresh else []))
    run("cmake", "--build", str(BUILD), "--", "--quiet")
    native = run("ctest", "--test-dir", str(BUILD), "--output-on-failure", check=False)
    return run(sys.executable, "-m", "pytest", "-q", *TESTS, *LEFT_OUT, check=False) and native


def table() -> str:
    """Returns the table of all files, the least covered first, and writes the details."""
    options = [f"--filter={pattern}" for pattern in FILES]
    options += [f"--exclude={pattern}" for pattern in NO_TESTS_NEEDED]
    summary = BUILD / "branches.json"
    run(
        str(Path(sys.executable).parent / "gcovr"),
        *("--root", str(ROOT), "--object-directory", str(BUILD)),
        *(str(BUILD / part) for part in ("plant_fmu", "controller/fmu", "tests")),
        *options,
        *("--merge-mode-functions=merge-use-line-min", "--exclude-throw-branches"),
        "--gcov-suspicious-hits-threshold=0",  # loads of lanes are counted more than 2^32 times
        *("--json-summary", str(summary), "--txt", str(BUILD / "lines.txt"), "--txt-metric=branch"),
    )
    found = json.loads(summary.read_text(encoding="utf-8"))
    files = [one for one in found["files"] if one["branch_total"]]
    files.sort(key=lambda one: one["branch_covered"] / one["branch_total"])
    rows = [(one["filename"], one["branch_covered"], one["branch_total"]) for one in files]
    rows.append(("all", found["branch_covered"], found["branch_total"]))
    lines = [f"| {name} | {got} of {of} | {100.0 * got / of:.1f} |" for name, got, of in rows]
    return "\n".join(["| file | branches | % |", "|---|---|---|", *lines])


def main(arguments: Sequence[str]) -> int:
    """Measures the coverage, or reads an earlier run's, and prints the table."""
    if set(arguments) - {"--reuse"}:
        print((__doc__ or "").splitlines()[2], file=sys.stderr)
        return 2
    passed = bool(arguments) or measure()
    print(table())
    if not passed:
        print("coverage: tests failed; their branches count as far as they ran", file=sys.stderr)
    return int(not passed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
