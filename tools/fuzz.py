"""Fuzzes the C code by libFuzzer or AFL++ and the Python readers by Hypothesis; prints and writes
figures.

usage: python -m tools.fuzz [--afl | --seed N] SECONDS [TARGET ...]
       python -m tools.fuzz [--afl] ledger

Each target of tests/fuzz gets an equal share of the time; the readers (tests/fuzz/test_readers.py),
which are the target "readers", get one share too. Inputs that reach new code are kept in
build/fuzz/corpus, inputs that violate a rule are written to build/fuzz/findings. A line of figures
is added to build/fuzz/ledger.jsonl after each target, so that the times of several runs add up;
targets with the least processor time until now come first. `ledger` prints the sums as a table.
With --afl the C targets alone are run, by AFL++, with all files in build/fuzz-afl. With --seed
libFuzzer draws its mutations from that seed (a positive number), so that runs from an empty corpus
begin with the same inputs. The exit code is 1 after a finding.
"""

from __future__ import annotations

import json
import math
import os
import re
import resource
import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
BUILD, AFL_BUILD = ROOT / "build" / "fuzz", ROOT / "build" / "fuzz-afl"
SEEDS = ROOT / "tests" / "fuzz" / "seeds"
READERS = "readers"
LEDGER = "ledger.jsonl"
READING = ("-q", "-n", "0", "--hypothesis-show-statistics", "tests/fuzz/test_readers.py")
LONGEST_INPUT = 4096  # bytes
LONGEST_CALL = 60  # s  an input that takes longer is a finding
STATISTIC = re.compile(r"stat::number_of_executed_units: +(\d+)")
COVERAGE = re.compile(r"cov: (\d+)")
# AFL++ without its display, and without its advice about the system's settings
AFL_SETTINGS = dict.fromkeys(
    (
        "AFL_NO_UI",
        "AFL_QUIET",
        "AFL_SKIP_CPUFREQ",
        "AFL_NO_AFFINITY",
        "AFL_I_DONT_CARE_ABOUT_MISSING_CRASHES",
    ),
    "1",
)
DRAWN = re.compile(r"- (\d+) passing")


@dataclass(frozen=True)
class Figures:
    """Holds what a run of one target drew, reached and took."""

    target: str
    inputs: int
    covered: int  # edges of the control flow; 0: not measured
    seconds: float  # wall time
    processor: float  # s  of the target's processes
    found: bool


class Clock:
    """Measures the wall time, and the processor time of processes that have ended, from now on."""

    def __init__(self) -> None:
        self._begin, self._used = time.monotonic(), _used_by_children()

    @property
    def seconds(self) -> float:
        """Returns the wall time [s]."""
        return time.monotonic() - self._begin

    @property
    def processor(self) -> float:
        """Returns the processor time [s]."""
        return _used_by_children() - self._used


def _used_by_children() -> float:
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def build(folder: Path, targets: Sequence[str]) -> None:
    """Builds targets. Raises SystemExit when a tool is missing or the build fails."""
    if shutil.which("clang") is None:
        raise SystemExit(
            "fuzz: no clang, expected one with libFuzzer; install it (Debian, Ubuntu: "
            "apt-get install clang libclang-rt-dev)"
        )
    if folder == AFL_BUILD and shutil.which("afl-clang-fast") is None:
        raise SystemExit(
            "fuzz: no afl-clang-fast, expected AFL++; install it (Debian, Ubuntu: "
            "apt-get install afl++)"
        )
    search = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    cmake = shutil.which("cmake", path=search) or "cmake"
    fresh = not (folder / "CMakeCache.txt").exists()
    settings = ROOT / "tools" / "cmake" / f"{folder.name}.cmake"
    where = ["-S", str(ROOT), "-B", str(folder), "-C", str(settings)]
    configure = [cmake, *where, f"-DPython_EXECUTABLE={sys.executable}"]
    commands = [
        [*configure, *(["-G", "Ninja"] if fresh else [])],
        [cmake, "--build", str(folder), "--target", *targets],
    ]
    for command in commands:
        done = subprocess.run(
            command,
            cwd=ROOT,
            env=os.environ | AFL_SETTINGS | {"PATH": search},
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode != 0:
            raise SystemExit(f"fuzz: {' '.join(command)} failed\n{done.stdout}{done.stderr}")


def fuzz(target: str, seconds: float, seed: int = 0) -> Figures:
    """Runs one libFuzzer target; prints what it says when it found something.

    Mutations are drawn from the seed; 0 stands for one that libFuzzer chooses.
    """
    corpus, findings = BUILD / "corpus" / target, BUILD / "findings" / target
    for folder in (corpus, findings):
        folder.mkdir(parents=True, exist_ok=True)
    options = {
        "max_total_time": max(1, round(seconds)),
        "max_len": LONGEST_INPUT,
        "timeout": LONGEST_CALL,
        "print_final_stats": 1,
        "seed": seed,
        "artifact_prefix": f"{findings}/",
    }
    clock = Clock()
    done = subprocess.run(
        [
            str(BUILD / "tests" / "fuzz" / target),
            *(f"-{name}={value}" for name, value in options.items()),
            str(corpus),
            str(SEEDS / target),
        ],
        capture_output=True,
        text=True,
        errors="replace",
        check=False,
    )
    found = done.returncode != 0 and not was_only_delayed(target, findings)
    if found:
        print(done.stderr[-6000:], file=sys.stderr)
    inputs, covered = STATISTIC.search(done.stderr), COVERAGE.findall(done.stderr)
    return Figures(
        target,
        int(inputs[1]) if inputs else 0,
        int(covered[-1]) if covered else 0,
        clock.seconds,
        clock.processor,
        found,
    )


def was_only_delayed(target: str, findings: Path) -> bool:
    """Returns whether all findings are inputs that end within LONGEST_CALL of processor time.

    libFuzzer measures wall time, which other jobs on the machine lengthen. Such inputs are deleted.
    """
    slow = list(findings.glob("timeout-*"))
    if not slow or len(slow) < len(list(findings.iterdir())):
        return False
    for path in slow:
        limit = f"ulimit -t {LONGEST_CALL} && exec " + '"$@"'
        command = ["sh", "-c", limit, "sh", str(BUILD / "tests" / "fuzz" / target), "-timeout=0"]
        done = subprocess.run([*command, str(path)], capture_output=True, check=False)
        if done.returncode != 0:
            return False
    for path in slow:
        path.unlink()
    return True


def fuzz_by_afl(target: str, seconds: float) -> Figures:
    """Runs one target by AFL++; prints what it says when it could not run."""
    out = AFL_BUILD / "runs" / target
    out.mkdir(parents=True, exist_ok=True)
    clock = Clock()
    done = subprocess.run(
        [
            *("afl-fuzz", "-V", str(max(1, round(seconds))), "-t", str(1000 * LONGEST_CALL)),
            *("-m", "none", "-i", "-" if (out / "default").exists() else str(SEEDS / target)),
            *("-o", str(out), "--", str(AFL_BUILD / "tests" / "fuzz" / target)),
        ],
        env=os.environ | AFL_SETTINGS,
        capture_output=True,
        text=True,
        errors="replace",
        check=False,
    )
    told = out / "default" / "fuzzer_stats"
    if done.returncode != 0 or not told.exists():
        print((done.stdout + done.stderr)[-6000:], file=sys.stderr)
        return Figures(target, 0, 0, clock.seconds, clock.processor, found=True)
    lines = told.read_text(encoding="utf-8").splitlines()
    value = {key.strip(): text.strip() for key, _, text in (line.partition(":") for line in lines)}
    found = int(value["saved_crashes"]) + int(value["saved_hangs"]) > 0
    if found:
        print(f"{target}: see {out / 'default'}", file=sys.stderr)
    inputs, edges = int(value["execs_done"]), int(value["edges_found"])
    return Figures(target, inputs, edges, clock.seconds, clock.processor, found)


def read(seconds: float) -> Figures:
    """Draws files for the readers by Hypothesis, a new seed each time, until the time is over."""
    clock, inputs, found = Clock(), 0, False
    while not found and (inputs == 0 or clock.seconds < seconds):
        done = subprocess.run(
            [sys.executable, "-m", "pytest", *READING],
            cwd=ROOT,
            env=os.environ | {"HEXAPOD_FUZZ": "1"},
            capture_output=True,
            text=True,
            check=False,
        )
        found = done.returncode != 0
        if found:
            print(done.stdout[-6000:], file=sys.stderr)
        inputs += sum(map(int, DRAWN.findall(done.stdout)))
        if inputs == 0:
            break
    return Figures(READERS, inputs, 0, clock.seconds, clock.processor, found)


# ---- the ledger ----


def note(place: Path, one: Figures) -> None:
    """Adds a target's figures, with the time and the commit, to the ledger."""
    command = ["git", "describe", "--always", "--dirty"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    finished = datetime.now(UTC).isoformat(timespec="seconds")
    line = {"finished": finished, "code": done.stdout.strip(), **asdict(one)}
    place.mkdir(parents=True, exist_ok=True)
    with (place / LEDGER).open("a", encoding="utf-8") as file:
        file.write(json.dumps(line) + "\n")


def noted(place: Path) -> list[dict[str, Any]]:
    """Returns the lines of the ledger; one that a killed run left incomplete is skipped."""
    lines = []
    if (place / LEDGER).exists():
        for line in (place / LEDGER).read_text(encoding="utf-8").splitlines():
            with suppress(json.JSONDecodeError):
                lines.append(json.loads(line))
    return lines


def processor_time_of(place: Path, target: str) -> float:
    """Returns the processor time that a target has had in all [s].

    Lines of older versions have none and count as 0.
    """
    lines = [line for line in noted(place) if line["target"] == target]
    return math.fsum(line.get("processor", 0.0) for line in lines)


def table(place: Path) -> str:
    """Returns the sums of the ledger as a table in Markdown."""
    lines = noted(place)
    rows = [
        "| target | runs | inputs | edges reached | processor time, s | findings |",
        "|---|---|---|---|---|---|",
    ]
    for target in sorted({line["target"] for line in lines}):
        of = [line for line in lines if line["target"] == target]
        inputs, found = (sum(line[key] for line in of) for key in ("inputs", "found"))
        edges = f"{max(line['covered'] for line in of):,}"
        rows.append(
            f"| {target} | {len(of)} | {inputs:,} | {'not measured' if edges == '0' else edges} "
            f"| {processor_time_of(place, target):,.0f} | {found} |"
        )
    if lines:
        rows += ["", f"From {lines[0]['finished']} to {lines[-1]['finished']}."]
    return "\n".join(rows)


def main(arguments: Sequence[str]) -> int:
    """Runs the targets and returns the exit code."""
    by_afl = "--afl" in arguments
    seed = 0
    arguments = [word for word in arguments if word != "--afl"]
    if arguments[:1] == ["--seed"] and len(arguments) > 1 and arguments[1].isdigit():
        seed, arguments = int(arguments[1]), arguments[2:]
    place = AFL_BUILD if by_afl else BUILD
    known = [*sorted(folder.name for folder in SEEDS.iterdir()), *([] if by_afl else [READERS])]
    if arguments == ["ledger"]:
        print(table(place))
        return 0
    if not arguments or not arguments[0].isdigit() or set(arguments[1:]) - set(known):
        print(
            "usage: python -m tools.fuzz [--afl | --seed N] SECONDS [TARGET ...] | ledger; "
            f"targets: {', '.join(known)}"
        )
        return 2
    chosen = sorted(arguments[1:] or known, key=partial(processor_time_of, place))
    share = int(arguments[0]) / len(chosen)
    if set(chosen) != {READERS}:
        build(place, [target for target in chosen if target != READERS])
    findings = 0
    for target in chosen:
        by_clang = partial(fuzz_by_afl, target) if by_afl else partial(fuzz, target, seed=seed)
        run = read if target == READERS else by_clang
        one = run(share)
        note(place, one)
        findings += one.found
        said = "a finding" if one.found else "no finding"
        print(
            f"{target:30}{one.inputs:12,} inputs {one.covered:7,} edges",
            f"{one.seconds:7.0f} s  {said}",
            flush=True,
        )
    return int(findings > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
