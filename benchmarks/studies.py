"""Measures what studies wait for: walks a minute, a comparison after set-up, and a new robot's
gains.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

import matplotlib

from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.run.batch import run_batch
from hexapod_cosim.cosim.run.plan import chosen_gains
from hexapod_cosim.cosim.run.worker_pool import processor_count
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.cosim.scenario.variation import STANDARD

WALKS, QUICK_WALKS = 80, 24  # of each setting
WARM = 4  # walks that are not measured, because they also build FMUs and caches
# benchmarks/results/solvers.csv says what these settings cost in accuracy
FAST = ("solver.method=ros2", "solver.tolerance=0.01")
SETTINGS: Mapping[str, Sequence[str]] = {"default solver": (), "fast solver": FAST}
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
        name: per_minute(scenarios(changes, count), gains, workers=processor_count())
        for name, changes in SETTINGS.items()
    }
    with TemporaryDirectory(prefix="hexapod-bench-") as folder:
        design, kept = (_design_time(Path(folder)) for _ in range(2))
        comparison = float("nan") if quick else _comparison_time(Path(folder))
    return Studies(rates, comparison, design, kept)


def scenarios(settings: Sequence[str], count: int) -> list[Scenario]:
    """Returns `count` walks that differ by their seeds."""
    scenario = load_scenario("walk_flat", overrides=[f"control={CONTROL}", *settings])
    return [replace(scenario, seed=seed, variation=STANDARD) for seed in range(count)]


def per_minute(plans: Sequence[Scenario], gains: Gains | None, *, workers: int) -> float:
    """Returns walks per minute, measured after all workers have started."""
    times = []
    with closing(run_batch(plans, gains=gains, workers=workers, compiled=True)) as runs:
        for summary in runs:
            assert summary.walked, summary.reason
            times.append(perf_counter())
    late = times[max(WARM, 2 * workers) :]
    return 60.0 * (len(late) - 1) / (late[-1] - late[0])


def _design_time(cache: Path) -> float:
    """Returns the time until gains are there in a new process that uses a cache folder [s]."""
    program = (
        "from hexapod_cosim.cosim.run.plan import chosen_gains as gains;"
        "from hexapod_cosim.cosim.scenario.reading import load_scenario as load;"
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
