"""A pytest plugin: runs tests in a given order, and tells their time, failures and the one that ran
last.

The environment names JSON files. HEXAPOD_ORDER is read and has the rank of each test; tests without
one come last. It also has the processor time that each may take; SIGPROF ends the process after it,
because a mutant may loop for ever. HEXAPOD_TOLD is written: the seconds of each test that has run,
and the tests that failed. HEXAPOD_RUNNING is a text file with the test that is running.

With HEXAPOD_JOBS, two file descriptors, pytest collects the tests once and runs them for each job
that it reads (tools/mutants/server.py), in a fork. Only libraries that tests load are new in each
fork, so this is for mutants of C.
"""

from __future__ import annotations

import json
import math
import os
import signal
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from _pytest.main import pytest_runtestloop as default_loop

from tools.mutants.server import redirect, wait

_told: dict[str, Any] = {"durations": {}, "failed": []}


def _given(key: str) -> dict[str, Any]:
    """Returns a part of the file HEXAPOD_ORDER."""
    path = os.environ.get("HEXAPOD_ORDER", "")
    if not path or not Path(path).exists():
        return {}
    table: dict[str, Any] = json.loads(Path(path).read_text(encoding="utf-8"))[key]
    return table


@pytest.hookimpl(tryfirst=True)
def pytest_runtestloop(session: pytest.Session) -> bool | None:
    """Answers jobs until there are none, if there may be jobs."""
    given = os.environ.get("HEXAPOD_JOBS")
    if not given:
        return None
    reading, writing = map(int, given.split(","))
    with os.fdopen(reading) as jobs, os.fdopen(writing, "w") as answers:
        for line in jobs:
            job = json.loads(line)
            child = os.fork()
            if child == 0:
                _run_forked(session, job)
            print(json.dumps(wait(child, job["seconds"])), file=answers, flush=True)
    return True


def _run_forked(session: pytest.Session, job: dict[str, Any]) -> None:
    """Runs the tests of a job up to the first failure and ends the process."""
    code = 1
    try:
        redirect(job)
        del os.environ["HEXAPOD_JOBS"]
        choose(session.config, session.items)
        with suppress(session.Failed):
            default_loop(session)
        code = int(bool(_told["failed"]))
        pytest_sessionfinish()
    finally:
        os._exit(code)


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Sorts the tests by their rank; equal ranks keep their order. Removes those that fail with
    unchanged code.
    """
    if "HEXAPOD_JOBS" in os.environ:
        return
    choose(config, items)


def choose(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Sorts and removes tests as HEXAPOD_ORDER says."""
    rank, left_out = _given("rank"), _given("left_out")
    items.sort(key=lambda item: rank.get(item.nodeid, math.inf))
    config.hook.pytest_deselected(items=[item for item in items if item.nodeid in left_out])
    items[:] = [item for item in items if item.nodeid not in left_out]


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_logstart(nodeid: str) -> None:
    """Notes the test and starts the clock of its processor time."""
    path = os.environ.get("HEXAPOD_RUNNING")
    if path:
        Path(path).write_text(nodeid, encoding="utf-8")
    limits = _given("limits")
    if limits:
        signal.signal(signal.SIGPROF, signal.SIG_DFL)
        signal.setitimer(signal.ITIMER_PROF, limits.get(nodeid, limits["others"]))


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Adds the duration of a phase of a test. Set-up counts with the first test that needs it."""
    durations = _told["durations"]
    durations[report.nodeid] = durations.get(report.nodeid, 0.0) + report.duration
    if report.failed:
        _told["failed"].append(report.nodeid)


def pytest_collectreport(report: pytest.CollectReport) -> None:
    """Notes a file that cannot be imported as a failure."""
    if report.failed:
        _told["failed"].append(report.nodeid)


def pytest_sessionfinish() -> None:
    """Writes what was noted."""
    signal.setitimer(signal.ITIMER_PROF, 0.0)
    path = os.environ.get("HEXAPOD_TOLD", "")
    if path:
        Path(path).write_text(json.dumps(_told), encoding="utf-8")
