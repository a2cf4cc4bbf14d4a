"""Makes small changes to a copy of the code, one at a time, and runs the tests that should fail.

usage: python -m tools.mutants COUNT [--seed N] [--jobs N] [--seconds S] [--with TEST ...]
                               [--groups GROUP ...] [--survivors]

A mutant changes one operator, comparison, sign or constant. One build contains all mutants of C
that can be chosen at run time (tools/mutants/switch.py); each of the others has a build of its own.
Mutants of Python need no build (tools/mutants/hook.py). Its tests are those of its group in GROUPS
and then those given by --with, up to the first failure. Tests that have killed most mutants of the
group for their time come first. A test that takes more than 20 s and ten times its own processor
time is a failure too, because a mutant may loop for ever. Tests that fail in the copy without a
mutant are left out. With --seconds only the first S seconds of a group's tests are run; mutants
that pass them are "open", and --survivors judges them again.

The sample is drawn with a seed, from each group in turn, so that each part of it is a fair sample.
Results are in build/mutants/results.json; a second call continues there until COUNT mutants are
judged. --survivors judges the survivors again, after tests were added. A mutant that does not build
is left out; one that no test can find is equivalent, with its reason (tools/mutants/explained.py).
The copy is built with the baseline kernel alone, and with --kernels with all: wide lanes show some
mutants that narrow ones hide. With --alone each mutant has a build of its own, whose sources keep
the change, for tests that build anew. The copy is build/mutants/tree. Delete build/mutants after a
change of the code.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from datetime import UTC, datetime
from queue import SimpleQueue
from typing import Any

from filelock import FileLock

from tools.mutants.explained import EQUIVALENT
from tools.mutants.sample import GROUPS, Mutant, changed, sample
from tools.mutants.tree import BUILD, TREE, alone, build_switched, copy_tree
from tools.mutants.worker import Options, Worker, judge

RESULTS = BUILD / "results.json"

Results = dict[int, dict[str, Any]]  # by the mutant's number in the sample, from 1


def read_results() -> Results:
    """Returns the results of earlier calls."""
    stored = json.loads(RESULTS.read_text(encoding="utf-8")) if RESULTS.exists() else []
    return {one["number"]: one for one in stored}


def changed_line(mutant: Mutant) -> str:
    """Returns the line of a mutant with its change."""
    text = changed(mutant, (TREE / mutant.file).read_text(encoding="utf-8"))
    return text.splitlines()[mutant.line - 1].strip()


class Judges:
    """Workers, and the results that they add to."""

    def __init__(self, given: argparse.Namespace, mutants: dict[int, Mutant]) -> None:
        """Starts workers and reads the results of earlier calls."""
        self.options, self.mutants = Options(tuple(given.others), given.seconds), mutants
        self.lines = {number: changed_line(mutant) for number, mutant in mutants.items()}
        self.results = read_results()
        self.workers = [Worker(number) for number in range(given.jobs)]
        self.free: SimpleQueue[Worker] = SimpleQueue()
        for worker in self.workers:
            self.free.put(worker)

    def close(self) -> None:
        """Ends the workers."""
        for worker in self.workers:
            worker.close()

    def judge_together(self, numbers: list[int]) -> None:
        """Judges mutants that need no build of their own."""
        with ThreadPoolExecutor(len(self.workers)) as pool:
            for _ in pool.map(self.judge, numbers):
                pass

    def judge_alone(self, number: int) -> None:
        """Builds and judges one mutant."""
        with alone(self.mutants[number]) as (passed, _):
            if passed:
                self.judge(number)
            else:
                self.keep(number, {"fate": "does not build", "by": ""})

    def judge(self, number: int) -> None:
        """Judges a mutant by a free worker, unless no test can find it."""
        reason = EQUIVALENT.get((self.mutants[number].file, self.lines[number]))
        if reason:
            self.keep(number, {"fate": "equivalent", "by": reason})
            return
        worker = self.free.get()
        try:
            known = [*self.results.values()]
            self.keep(number, judge(worker, number, self.mutants[number], known, self.options))
        finally:
            self.free.put(worker)

    def keep(self, number: int, fate: dict[str, Any]) -> None:
        """Stores and prints the fate of a mutant."""
        mutant = self.mutants[number]
        line = self.lines[number]
        at = datetime.now(UTC).isoformat(timespec="seconds")
        one = {"number": number, **asdict(mutant), **fate, "text": line, "at": at}
        print(f"{one['fate']:10}{number:5} {mutant.file}:{mutant.line}: {line}  {one['by']}")
        sys.stdout.flush()
        with FileLock(RESULTS.with_suffix(".lock")):  # two commands may judge different groups
            self.results = read_results() | {number: one}
            stored = [self.results[key] for key in sorted(self.results)]
            RESULTS.write_text(json.dumps(stored, indent=1) + "\n", encoding="utf-8")


def wanted(judges: Judges, given: argparse.Namespace) -> Iterator[int]:
    """Yields the numbers of the mutants that are to be judged."""
    for number, mutant in judges.mutants.items():
        fate = judges.results.get(number, {}).get("fate")
        left = ("survived", "open") if given.survivors else (None,)
        if mutant.group in given.groups and fate in left:
            yield number


def main() -> int:
    """Judges the first COUNT mutants of the sample; prints the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("count", type=int, help="the number of mutants to judge")
    parser.add_argument("--seed", type=int, default=1, help="of the sample")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--with", nargs="+", dest="others", default=[], help="further tests")
    parser.add_argument("--seconds", type=float, default=math.inf, help="of a group's tests")
    parser.add_argument("--survivors", action="store_true", help="judge survivors again")
    parser.add_argument("--alone", action="store_true", help="a build for each mutant")
    parser.add_argument("--kernels", action="store_true", help="build all kernels")
    parser.add_argument("--groups", nargs="+", choices=[*GROUPS], default=[*GROUPS])
    given = parser.parse_args()
    BUILD.mkdir(parents=True, exist_ok=True)
    with FileLock(BUILD / "build.lock"):
        copy_tree(given.kernels)
        drawn = sample(TREE, given.seed, [*GROUPS])[: given.count]
        mutants = dict(enumerate(drawn, start=1))
        in_c = {number: one for number, one in mutants.items() if one.file.endswith((".c", ".h"))}
        chosen = mutants.keys() - in_c.keys()
        if not given.alone:
            chosen |= build_switched(in_c, given.kernels)
    judges = Judges(given, mutants)
    try:
        numbers = [*wanted(judges, given)]
        judges.judge_together([number for number in numbers if number in chosen])
        for number in numbers:
            if number not in chosen:
                judges.judge_alone(number)
    finally:
        judges.close()
    for group in GROUPS:
        fates = Counter(one["fate"] for one in judges.results.values() if one["group"] == group)
        counts = "".join(f"{count:4} {fate}" for fate, count in sorted(fates.items()))
        print(f"{group:12}{counts}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
