"""Measures what coarser solver settings cost in accuracy and save in steps.

usage: python -m benchmarks.solvers

Walks are `walk_flat`, 10 s, under both controls, with variations. Errors are against a solver that
is a thousand times as exact as the default one. The results do not depend on the machine. Writes
benchmarks/results/solvers.csv: errors in the metric's unit and relative to its mean.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks import RESULTS
from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.common.files import atomic_text
from hexapod_cosim.cosim.results.metric_table import METRICS
from hexapod_cosim.cosim.run.plan import chosen_gains
from hexapod_cosim.cosim.run.runner import Runner
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.cosim.scenario.variation import STANDARD

BOTH = ("kinematic", "compliant")
SEEDS = 6
SHOWN = (
    "slip_per_metre",
    "cost_of_transport",
    "torque_rms",
    "peak_force",
    "loading_rate",
    "path_error",
    "stability_margin",
)
STEPS = "solver.steps"
REFERENCE = ("solver.tolerance=1e-7", "solver.step_max=0.001")
SETTINGS: dict[str, tuple[str, ...]] = {
    "rosw3, 1e-4 (default)": (),
    **{
        f"ros2, {tolerance}": ("solver.method=ros2", f"solver.tolerance={tolerance}")
        for tolerance in ("1e-3", "3e-3", "1e-2", "1e-1")
    },
}
Array = NDArray[np.float64]


def walked(
    runner: Runner, control: str, gains: Gains | None, settings: Sequence[str]
) -> tuple[Array, float]:
    """Returns metrics of walks (seeds, SHOWN) and their mean number of steps."""
    scenario = load_scenario("walk_flat", overrides=[f"control={control}", *settings])
    results = [
        runner.simulate(replace(scenario, seed=seed, variation=STANDARD), gains=gains)
        for seed in range(SEEDS)
    ]
    figures = np.array([[result.metrics[name] for name in SHOWN] for result in results])
    return figures, float(
        np.mean([result.outcome.recording.column(STEPS)[-1] for result in results])
    )


def errors(control: str) -> list[dict[str, Any]]:
    """Returns for each setting the steps and the largest errors of the metrics over the seeds.

    Errors are in the metric's unit and relative to its mean.
    """
    gains = chosen_gains(load_scenario("walk_flat", overrides=[f"control={control}"]))
    rows = []
    with Runner(everything=True) as runner:
        exact, _ = walked(runner, control, gains, REFERENCE)
        for name, settings in SETTINGS.items():
            figures, steps = walked(runner, control, gains, settings)
            off = np.abs(figures - exact).max(axis=0)
            share = off / np.abs(exact).mean(axis=0)
            rows.append(
                {"control": control, "solver": name, "steps": round(steps)}
                | {
                    key: float(f"{value:.3g}")
                    for metric, error, part in zip(SHOWN, off, share, strict=True)
                    for key, value in ((metric, error), (f"{metric} relative", part))
                }
            )
    return rows


def main() -> None:
    """Computes the errors, prints and writes them."""
    assert set(SHOWN) <= set(METRICS)
    rows = [row for control in BOTH for row in errors(control)]
    path = RESULTS / "solvers.csv"
    with atomic_text(path) as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    print(f"wrote {path}")


if __name__ == "__main__":
    main()
