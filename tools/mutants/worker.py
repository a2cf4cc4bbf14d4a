"""Judges mutants: runs tests in the copy, those first that have killed most for their time."""

from __future__ import annotations

import json
import math
import os
import shutil
import signal
import subprocess
import threading
from collections import Counter, defaultdict
from dataclasses import asdict, dataclass
from itertools import accumulate
from pathlib import Path
from typing import Any

from tools.mutants.sample import GROUPS, Mutant
from tools.mutants.tree import BUILD, PYTHON, SESSION, TREE, environment

DURATIONS, BASELINE = BUILD / "durations.json", BUILD / "baseline.json"
TIME_LIMIT = 3600.0  # s of wall time of a run of tests
SECONDS, TIMES = 20.0, 10.0  # of processor time: a test may take this, and its own time so often
OPTIONS = ("-q", "-n", "0", "-p", "tools.mutants.order", "-p", "no:cacheprovider")
_lock = threading.Lock()  # of the files that workers share
_group_locks = {group: threading.Lock() for group in GROUPS}

Told = dict[str, Any]


@dataclass(frozen=True)
class Options:
    """What limits the tests of a mutant."""

    others: tuple[str, ...]  # tests after those of the group
    seconds: float  # s, of the group's tests, those of greatest worth first


class Server:
    """A process that answers jobs by forks."""

    def __init__(self, module: tuple[str, ...], output: Path) -> None:
        """Starts a module with its arguments in the copy."""
        job_reader, self.jobs = os.pipe()
        answer_reader, writer = os.pipe()
        self.output = output
        with output.open("wb") as file:
            self.process = subprocess.Popen(
                [str(PYTHON), "-m", *module],
                cwd=TREE,
                env=environment()
                | {"PYTEST_XDIST_TESTRUNUID": SESSION, "HEXAPOD_JOBS": f"{job_reader},{writer}"},
                pass_fds=(job_reader, writer),
                stdin=subprocess.DEVNULL,
                stdout=file,
                stderr=file,
            )
        os.close(job_reader)
        os.close(writer)
        self.answers = os.fdopen(answer_reader)

    def answer(self, job: Told) -> int:
        """Has a job done; returns the exit code of the tests."""
        os.write(self.jobs, (json.dumps(job) + "\n").encode())
        line = self.answers.readline()
        if not line:
            text = self.output.read_text(encoding="utf-8", errors="replace")[-2000:]
            raise SystemExit(f"mutants: the process that runs the tests has ended\n{text}")
        return int(json.loads(line))

    def close(self) -> None:
        """Ends the process."""
        os.close(self.jobs)
        self.process.wait()
        self.answers.close()


class Worker:
    """Runs tests, in forks of processes that have imported or collected already."""

    def __init__(self, number: int) -> None:
        """Makes the folder of its files."""
        self.folder = BUILD / f"worker-{os.getpid()}-{number}"
        self.folder.mkdir(exist_ok=True)
        self.servers: dict[tuple[str, ...], Server] = {}

    def close(self) -> None:
        """Ends the processes."""
        for server in self.servers.values():
            server.close()
        shutil.rmtree(self.folder, ignore_errors=True)

    def run(self, tests: tuple[str, ...], env: dict[str, str], order: Told, *options: str) -> Told:
        """Runs tests; returns `code`, `failed` and `durations`. A test that ended the process or
        took too long has failed.
        """
        names = {name: self.folder / name for name in ("order", "told", "running", "output")}
        names["order"].write_text(json.dumps(order), encoding="utf-8")
        for name in ("told", "running"):
            names[name].unlink(missing_ok=True)
        paths = {f"HEXAPOD_{name.upper()}": str(path) for name, path in names.items()}
        arguments = (*OPTIONS, *options, *tests)
        job: Told = {
            "arguments": arguments,
            "env": paths | env,
            "output": str(names["output"]),
            "seconds": TIME_LIMIT,
        }
        # tests of mutants of C are collected once
        key = ("pytest", *arguments) if "HX_MUTANT" in env else ("tools.mutants.server",)
        if key not in self.servers:
            self.servers[key] = Server(key, self.folder / f"server-{len(self.servers)}")
        code = self.servers[key].answer(job)
        told: Told = {"durations": {}, "failed": []}
        if names["told"].exists():
            told = json.loads(names["told"].read_text(encoding="utf-8"))
        elif code != 0 and names["running"].exists():
            told["failed"] = [names["running"].read_text(encoding="utf-8")]
            told["why"] = signal.Signals(-code).name if code < 0 else f"exit code {code}"
        elif code != 0:
            told["failed"] = [names["output"].read_text(encoding="utf-8", errors="replace")[-200:]]
        return told | {"code": code}


def measure_baseline(worker: Worker, group: str) -> Told:
    """Runs the tests of a group with unchanged code, once; returns the failed ones of all groups.

    They say nothing about mutants, and judge() leaves them out.
    """
    with _group_locks[group]:
        with _lock:
            known: Told = _read(BASELINE)
        if group not in known:
            told = worker.run(GROUPS[group][1], {}, {"rank": {}, "left_out": {}, "limits": {}})
            if "why" in told:
                raise SystemExit(f"mutants: {told['failed']} ends the process: {told['why']}")
            with _lock:
                known = _read(BASELINE) | {group: sorted(set(told["failed"]))}
                _write(BASELINE, known)
                _write(DURATIONS, _read(DURATIONS) | told["durations"])
    return {test: True for failed in known.values() for test in failed}


def judge(
    worker: Worker, number: int, mutant: Mutant, results: list[Told], options: Options
) -> Told:
    """Tests a mutant with the tests of its group and then with others; returns its fate and what
    killed it.
    """
    left_out = measure_baseline(worker, mutant.group)
    env = {"HX_MUTANT": str(number)}
    if mutant.file.endswith(".py"):
        env = {"HEXAPOD_MUTANT": json.dumps(asdict(mutant) | {"path": str(TREE / mutant.file)})}
    for tests in filter(None, (GROUPS[mutant.group][1], options.others)):
        order = _order(mutant.group, results, left_out, options.seconds)
        told = worker.run(tests, env, order, "-x")
        if told["failed"]:
            why = {"why": told["why"]} if "why" in told else {}
            return {"fate": "killed", "by": told["failed"][0]} | why
        with _lock:
            _write(DURATIONS, _read(DURATIONS) | told["durations"])
    return {"fate": "open" if options.seconds < math.inf else "survived", "by": ""}


def _order(group: str, results: list[Told], left_out: Told, seconds: float) -> Told:
    """Returns the rank and the time limit of each known test, and those that are left out.

    Tests come first that have killed most mutants of the group for the time they take, then the
    fastest files, whole, as the tests of a file share fixtures. Files that do not end within the
    given seconds are left out.
    """
    kills = Counter(str(one["by"]) for one in results if one["group"] == group)
    with _lock:
        durations: dict[str, float] = _read(DURATIONS)
    known = [test for test in durations if test.startswith(tuple(GROUPS[group][1]))]
    of_file: dict[str, float] = defaultdict(float)
    for test in known:
        of_file[test.partition("::")[0]] += durations[test]
    killers = sorted(
        (test for test in known if kills[test]),
        key=lambda test: -kills[test] / (durations[test] + 0.1),
    )
    others = (test for test in known if not kills[test])
    tests = killers + sorted(others, key=lambda test: of_file[test.partition("::")[0]])
    ends = accumulate(durations[test] for test in tests)
    beyond = {
        test.partition("::")[0] for test, end in zip(tests, ends, strict=True) if end > seconds
    }
    late = {test: True for test in tests if test.partition("::")[0] in beyond}
    limits = {test: SECONDS + TIMES * time for test, time in durations.items()}
    return {
        "rank": {test: rank for rank, test in enumerate(tests)},
        "limits": limits | {"others": 300.0},
        "left_out": left_out | late,
    }


def _read(path: Path) -> Told:
    found: Told = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    return found


def _write(path: Path, table: Told) -> None:
    new = path.with_suffix(f".{os.getpid()}")
    new.write_text(json.dumps(table, indent=1), encoding="utf-8")
    new.replace(path)
