"""The work-precision figure: error against time, medians over the family, bands from the best walk to the worst."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from matplotlib import colormaps, rc_context
from matplotlib.figure import Figure

from benchmarks.judge import of_series
from benchmarks.measure import Run
from benchmarks.series import OURS, PLANT_LAW, Series
from benchmarks.walks import DURATION

SHOWN = (1e-9, 1.0)  # m
NAMES = {OURS: "this plant", "mujoco": "MuJoCo", "pinocchio": "Pinocchio", "simbody": "Simbody", "drake": "Drake"}
BEST = ("rosw3", "ros2")  # of ours, beside the peers


def draw(runs: Sequence[Run], series: Sequence[Series], path: Path, *, title: str) -> None:
    """Writes the figure: our integrators on the left, the peers' beside the best of ours on the right."""
    figure = Figure(figsize=(13.0, 7.0), layout="constrained")
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    figure.suptitle(title)
    _panel(left, runs, [one for one in series if one.engine == OURS], "this plant's integrators")
    _panel(right, runs, [one for one in series if one.engine != OURS or one.method in BEST], "against the peers")
    left.set_ylabel("largest error of the torso's path over 2 s [m]")
    with rc_context({"svg.hashsalt": path.name}):  # the same figures make the same bytes
        figure.savefig(path, metadata={"Date": None})


def _panel(axes: Any, runs: Sequence[Run], series: Sequence[Series], title: str) -> None:
    for k, one in enumerate(series):
        _line(axes, of_series(runs, one), one, colormaps["tab20"](k % 20))
    axes.set(xscale="log", yscale="log", ylim=SHOWN, xlabel="computing time per simulated second [s]", title=title)
    axes.grid(visible=True, which="major", alpha=0.3)
    axes.legend(fontsize="x-small", loc="upper center", bbox_to_anchor=(0.5, -0.1), ncols=3)


def _line(axes: Any, runs: Sequence[Run], series: Series, colour: Any) -> None:
    groups = [[run for run in runs if run.setting == setting] for setting in series.settings]
    groups = [group for group in groups if group and np.isfinite(median(run.seconds for run in group))]
    if not groups:
        return
    time = [median(run.seconds for run in group) / DURATION for group in groups]
    errors = [np.clip([run.error for run in group], *SHOWN) for group in groups]
    style = {"adaptive": "-", "fixed": "--", "own": ":"}["own" if series.law != PLANT_LAW else "adaptive" if series.adaptive else "fixed"]
    label = f"{NAMES[series.engine]}: {series.method}" + ("" if series.law == PLANT_LAW else " (against itself)")
    axes.plot(time, [np.median(one) for one in errors], style, marker=".", color=colour, label=label)
    axes.fill_between(time, [one.min() for one in errors], [one.max() for one in errors], color=colour, alpha=0.1)
