"""Fuzzes the C code by libFuzzer and the Python readers by Hypothesis; prints figures.

usage: python -m tools.fuzz [--seed N] SECONDS [TARGET ...]

Each target of tests/fuzz gets an equal share of the time; the readers (tests/fuzz/test_readers.py),
which are the target "readers", get one share too. Inputs that reach new code are kept in
build/fuzz/corpus, inputs that violate a rule are written to build/fuzz/findings. With --seed
libFuzzer draws its mutations from that seed (a positive number), so that runs from an empty corpus
begin with the same inputs. The exit code is 1 after a finding.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BUILD = ROOT / "build" / "fuzz"
SEEDS = BUILD / "seeds"  # written by tests/support/fuzz_seeds.py
READERS = "readers"
READING = ("-q", "-n", "0", "--hypothesis-show-statistics", "tests/fuzz/test_readers.py")
LONGEST_INPUT = 4096  # bytes
LONGEST_CALL = 60  # s  an input that takes longer is a finding
STATISTIC = re.compile(r"stat::number_of_executed_units: +(\d+)")
COVERAGE = re.compile(r"cov: (\d+)")
DRAWN = re.compile(r"- (\d+) passing")
SHOWN = 6000  # characters of the output of a run with a finding


@dataclass(frozen=True)
class Figures:
    """Results of one target: inputs, edges of the control flow (0: not measured), a finding."""

    inputs: int
    covered: int
    found: bool


def build(targets: Sequence[str]) -> None:
    """Builds targets. Raises SystemExit when clang is missing or the build fails."""
    if shutil.which("clang") is None:
        raise SystemExit(
            "fuzz: no clang, expected one with libFuzzer; install it (Debian, Ubuntu: "
            "apt-get install clang libclang-rt-dev)"
        )
    search = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    cmake = shutil.which("cmake", path=search) or "cmake"
    generator = [] if (BUILD / "CMakeCache.txt").exists() else ["-G", "Ninja"]
    settings = ROOT / "tools" / "cmake" / "fuzz.cmake"
    where = ["-S", str(ROOT / "packaging"), "-B", str(BUILD), "-C", str(settings)]
    for command in (
        [cmake, *where, f"-DPython_EXECUTABLE={sys.executable}", *generator],
        [cmake, "--build", str(BUILD), "--target", *targets],
    ):
        done = run(command, env=os.environ | {"PATH": search})
        if done.returncode != 0:
            raise SystemExit(f"fuzz: {' '.join(command)} failed\n{done.stdout}{done.stderr}")


def run(
    command: Sequence[str], *, env: dict[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """Runs a command in the repository and returns its outputs."""
    return subprocess.run(
        command, cwd=ROOT, env=env, capture_output=True, text=True, errors="replace", check=False
    )


def fuzz(target: str, seconds: float, seed: int) -> Figures:
    """Runs one libFuzzer target; prints its messages after a finding.

    Mutations are drawn from the seed; 0 stands for one that libFuzzer chooses.
    """
    corpus, findings = BUILD / "corpus" / target, BUILD / "findings" / target
    for folder in (corpus, findings):
        folder.mkdir(parents=True, exist_ok=True)
    program = str(BUILD / "tests" / "fuzz" / target)
    options = {
        "max_total_time": max(1, round(seconds)),
        "max_len": LONGEST_INPUT,
        "timeout": LONGEST_CALL,
        "print_final_stats": 1,
        "seed": seed,
        "artifact_prefix": f"{findings}/",
    }
    words = [f"-{name}={value}" for name, value in options.items()]
    done = run([program, *words, str(corpus), str(SEEDS / target)])
    found = done.returncode != 0 and not was_only_delayed(program, findings)
    if found:
        print(done.stderr[-SHOWN:], file=sys.stderr)
    inputs, covered = STATISTIC.search(done.stderr), COVERAGE.findall(done.stderr)
    return Figures(int(inputs[1]) if inputs else 0, int(covered[-1]) if covered else 0, found)


def was_only_delayed(program: str, findings: Path) -> bool:
    """Returns whether all findings are inputs that end within LONGEST_CALL of processor time.

    libFuzzer measures wall time, which other jobs on the machine lengthen. Such inputs are deleted.
    """
    slow = list(findings.glob("timeout-*"))
    if not slow or len(slow) < len(list(findings.iterdir())):
        return False
    limited = ["sh", "-c", f'ulimit -t {LONGEST_CALL} && exec "$@"', "sh", program, "-timeout=0"]
    if any(run([*limited, str(path)]).returncode != 0 for path in slow):
        return False
    for path in slow:
        path.unlink()
    return True


def read(seconds: float) -> Figures:
    """Draws files for the readers by Hypothesis, a new seed each time, until the time is over."""
    begin, inputs, found = time.monotonic(), 0, False
    while not found and (inputs == 0 or time.monotonic() - begin < seconds):
        done = run(
            [sys.executable, "-m", "pytest", *READING], env=os.environ | {"HEXAPOD_FUZZ": "1"}
        )
        found = done.returncode != 0
        if found:
            print(done.stdout[-SHOWN:], file=sys.stderr)
        inputs += sum(map(int, DRAWN.findall(done.stdout)))
        if inputs == 0:
            break
    return Figures(inputs, 0, found)


def main() -> int:
    """Runs the targets and returns the exit code."""
    run([sys.executable, "tests/support/fuzz_seeds.py", str(SEEDS)])
    known = [*sorted(folder.name for folder in SEEDS.iterdir()), READERS]
    parser = argparse.ArgumentParser(description="Fuzzes the C code and the Python readers.")
    parser.add_argument("--seed", type=int, default=0, help="of libFuzzer's mutations")
    parser.add_argument("seconds", type=int, help="for all targets together")
    parser.add_argument("targets", nargs="*", metavar="TARGET", help=", ".join(known))
    given = parser.parse_args()
    if unknown := set(given.targets) - set(known):
        parser.error(f"unknown target {min(unknown)!r}: choose from {', '.join(known)}")
    chosen = given.targets or known
    if set(chosen) != {READERS}:
        build([target for target in chosen if target != READERS])
    share, findings = given.seconds / len(chosen), 0
    for target in chosen:
        one = read(share) if target == READERS else fuzz(target, share, given.seed)
        findings += one.found
        said = "a finding" if one.found else "no finding"
        print(f"{target:30}{one.inputs:12,} inputs {one.covered:7,} edges  {said}", flush=True)
    return int(findings > 0)


if __name__ == "__main__":
    sys.exit(main())
