"""A pytest plugin of tools/mutants.py: runs tests in a given order and stores how long they take.

The environment names two JSON files. HEXAPOD_ORDER is read and has the rank of each test; tests
without one come last. HEXAPOD_DURATIONS is written and has the seconds of each test that was run.
Either may be missing.
"""

from __future__ import annotations

import json
import math
import os
from pathlib import Path

import pytest

_durations: dict[str, float] = {}


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Sorts the tests by their rank; equal ranks keep their order."""
    path = os.environ.get("HEXAPOD_ORDER", "")
    if path and Path(path).exists():
        rank = json.loads(Path(path).read_text(encoding="utf-8"))
        items.sort(key=lambda item: rank.get(item.nodeid, math.inf))


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Adds the duration of a phase of a test. Set-up counts with the first test that needs it."""
    _durations[report.nodeid] = _durations.get(report.nodeid, 0.0) + report.duration


def pytest_sessionfinish() -> None:
    """Writes the durations [s]."""
    path = os.environ.get("HEXAPOD_DURATIONS", "")
    if path:
        Path(path).write_text(json.dumps(_durations), encoding="utf-8")
