"""Measures what studies wait for: walks a minute, a comparison after set-up, and a new robot's
gains.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

import matplotlib

from benchmarks.batch import SETTINGS, per_minute, scenarios
from hexapod_cosim.cosim.run.preparation import chosen_gains
from hexapod_cosim.cosim.run.worker_pool import processor_count
from hexapod_cosim.cosim.scenario.scenario import load_scenario

WALKS, QUICK_WALKS = 80, 24  # of each setting
CONTROL = "compliant"


@dataclass(frozen=True)
class Studies:
    """Holds what was measured of studies."""

    per_minute: Mapping[str, float]  # compliant walks of 10 s on all cores, by solver setting
    comparison: float  # s    `hexapod compare`, 20 walks of 10 s, after set-up
    gains: float  # s    design of a robot's gains in a new process, with its imports
    kept_gains: float  # s    the same from the user's cache


def measured_studies(*, quick: bool) -> Studies:
    """Measures studies on all cores; `quick` leaves out the comparison and most walks."""
    gains = chosen_gains(load_scenario("walk_flat", overrides=[f"control={CONTROL}"]))
    count = QUICK_WALKS if quick else WALKS
    rates = {
        name: per_minute(
            scenarios(CONTROL, changes, count), gains, workers=processor_count(), compiled=True
        )
        for name, changes in SETTINGS.items()
    }
    with TemporaryDirectory(prefix="hexapod-bench-") as folder:
        design, kept = (_design_time(Path(folder)) for _ in range(2))
        comparison = float("nan") if quick else _comparison_time(Path(folder))
    return Studies(rates, comparison, design, kept)


def _design_time(cache: Path) -> float:
    """Returns the time until gains are there in a new process that uses a cache folder [s]."""
    program = (
        "from hexapod_cosim.cosim.run.preparation import chosen_gains as gains;"
        "from hexapod_cosim.cosim.scenario.scenario import load_scenario as load;"
        f"gains(load('walk_flat', overrides=['control={CONTROL}']))"
    )
    return _seconds([sys.executable, "-c", program], cache)


def _comparison_time(folder: Path) -> float:
    """Returns the time of a comparison whose gains are in the cache [s]."""
    words = [sys.executable, "-m", "hexapod_cosim.cosim.cli", "compare", "-o"]
    return _seconds([*words, str(folder / "compared")], folder)


def _seconds(words: Sequence[str], cache: Path) -> float:
    """Returns the wall time of a command that finds its user's cache in a folder [s].

    matplotlib's list of fonts, which it makes once for each user, is the present one.
    """
    folders = {"XDG_CACHE_HOME": str(cache), "MPLCONFIGDIR": matplotlib.get_cachedir()}
    begin = perf_counter()
    subprocess.run(words, check=True, capture_output=True, env=os.environ | folders)
    return perf_counter() - begin
