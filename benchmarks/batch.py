"""Measures walks per minute, with the compiled and the Python controller, and costs per run.

usage: python -m benchmarks.batch [--walks N] [--memory-runs N]

Rates are measured with one process and with all processors. Every walk is `walk_flat`, 10 s, with
its own variations. Prints a table and writes benchmarks/results/<machine>/batch.csv. Nothing is
asserted: machines are noisy, and other programs lengthen every wall time; processor time depends
less on them.
"""

from __future__ import annotations

import argparse
import csv
import os
import pickle
import statistics
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from typing import Any

from benchmarks import RESULTS, machine
from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.run.batch import run_batch
from hexapod_cosim.cosim.run.preparation import chosen_gains
from hexapod_cosim.cosim.run.walker import Walker
from hexapod_cosim.cosim.run.worker_pool import processor_count
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.cosim.scenario.scenario import load_scenario
from hexapod_cosim.cosim.scenario.variation import STANDARD

# docs/architecture.md says what these settings cost in accuracy
FAST = ("solver.method=ros2", "solver.tolerance=0.01")
SETTINGS: dict[str, tuple[str, ...]] = {"default solver": (), "fast solver": FAST}
CONTROLS = ("compliant", "kinematic")
WARM = 4  # walks that are not measured, because they also build FMUs and caches
PYTHON_WALKS = 8  # measured walks of the slower Python controller
MEGABYTE = 1e6  # bytes


def scenarios(control: str, settings: Sequence[str], count: int) -> list[Scenario]:
    """Returns `count` walks that differ by their seeds."""
    scenario = load_scenario("walk_flat", overrides=[f"control={control}", *settings])
    return [replace(scenario, seed=seed, variation=STANDARD) for seed in range(count)]


def per_minute(
    plans: Sequence[Scenario], gains: Gains | None, *, workers: int, compiled: bool
) -> float:
    """Returns walks per minute, measured after all workers have started."""
    times = []
    with closing(run_batch(plans, gains=gains, workers=workers, compiled=compiled)) as runs:
        for summary in runs:
            assert summary.walked, summary.reason
            times.append(time.perf_counter())
    late = times[max(WARM, 2 * workers) :]
    return 60.0 * (len(late) - 1) / (late[-1] - late[0])


def costs(plans: Sequence[Scenario], gains: Gains | None) -> dict[str, float]:
    """Returns median times of the runs of one process: whole run, loop and overhead [ms of
    processor time], and the size of a run's summary [bytes].
    """
    totals, loops = [], []
    with Walker() as walker:
        for plan in plans:
            begin = time.process_time()
            summary = walker.summary(plan, gains=gains)
            totals.append(1e3 * (time.process_time() - begin))
            loops.append(1e3 * walker.loop_time)
    overheads = [total - loop for total, loop in zip(totals, loops, strict=True)][WARM:]
    found = {"run": totals[WARM:], "loop": loops[WARM:], "overhead": overheads}
    medians: dict[str, float] = {
        f"{name}_ms": round(statistics.median(values), 2) for name, values in found.items()
    }
    return medians | {
        "best_run_ms": round(min(totals), 2),
        "best_overhead_ms": round(min(overheads), 2),
        "bytes": len(pickle.dumps(summary)),
    }


def measured(count: int) -> Iterator[dict[str, Any]]:
    """Yields a row for each control and solver setting, and one for each control in Python."""
    most = processor_count()
    for control in CONTROLS:
        gains = chosen_gains(load_scenario("walk_flat", overrides=[f"control={control}"]))
        for setting, changes in SETTINGS.items():
            plans = scenarios(control, changes, count)
            alone, together = (
                round(per_minute(plans, gains, workers=workers, compiled=True))
                for workers in (1, most)
            )
            yield {
                "controller": "compiled",
                "control": control,
                "setting": setting,
                "one_process": alone,
                "processes": most,
                "all": together,
                "of_ideal": round(together / alone / most, 3),
                **costs(plans, gains),
            }
        few = scenarios(control, (), PYTHON_WALKS + max(WARM, 2 * most))
        alone, together = (
            round(per_minute(few, gains, workers=workers, compiled=False)) for workers in (1, most)
        )
        shown = {
            "one_process": alone,
            "processes": most,
            "all": together,
            "of_ideal": round(together / alone / most, 3),
        }
        yield {"controller": "Python", "control": control, "setting": "default solver", **shown}


def growth(count: int) -> tuple[float, float]:
    """Returns the memory of this process after a tenth of `count` runs and after all of them
    [MB].
    """
    plans = scenarios("kinematic", (*FAST, "duration=1"), count)
    marks = []
    with Walker() as walker:
        for k, plan in enumerate(plans, start=1):
            walker.summary(plan)
            if k in (count // 10, count):
                marks.append(resident() / MEGABYTE)
    return marks[0], marks[-1]


def resident() -> int:
    """Returns the resident memory of this process [bytes]."""
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def main() -> int:
    """Measures and prints; returns the exit code."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--walks", type=int, default=100, help="walks of each kind")
    parser.add_argument(
        "--memory-runs",
        type=int,
        default=1000,
        help="short runs in one process, for the growth of memory",
    )
    given = parser.parse_args()
    rows = []
    for row in measured(given.walks):
        rows.append(row)
        print("  ".join(f"{key} {value}" for key, value in row.items()), flush=True)
    folder = RESULTS / machine()
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "batch.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), restval="")
        writer.writeheader()
        writer.writerows(rows)
    if given.memory_runs:
        begin, end = growth(given.memory_runs)
        few, all_runs = given.memory_runs // 10, given.memory_runs
        print(f"memory after {few} runs {begin:.1f} MB, after {all_runs} {end:.1f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
