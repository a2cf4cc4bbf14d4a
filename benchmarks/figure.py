"""Draws the work-precision figure: error against computing time over the family of walks.

Lines are medians, bands reach from the best walk to the worst.

`python -m benchmarks.figure FOLDER` draws it from the walks.csv of a folder.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from benchmarks.judge import of_series
from benchmarks.measure import Run
from benchmarks.series import OURS, PLANT_LAW, Series, ours, peers
from benchmarks.walks import DURATION
from hexapod_cosim.controller.figure_style import PALETTE, SETTINGS, UNDATED, WIDTH

SHOWN = (1e-9, 1.0)  # m
NAMES = {OURS: "this plant", "mujoco": "MuJoCo", "pinocchio": "Pinocchio", "drake": "Drake"}
COLOURS = (*PALETTE, "0.55")
MARKERS = "osD^v"
CELLS: dict[Any, Any] = {"str": str, "float": float}  # conversions by a field's type
BEST = ("rosw3", "ros2")  # of ours, beside the peers


def draw(runs: Sequence[Run], series: Sequence[Series], folder: Path) -> None:
    """Writes work_precision.svg.

    The left panel shows our integrators, the right one the peers beside the best of ours.
    """
    with rc_context(SETTINGS):
        figure = Figure(figsize=(WIDTH, 5.6))
        left, right = figure.subplots(1, 2, sharex=True, sharey=True)
        figure.suptitle(
            f"Walking for {DURATION:g} s, {len({run.walk for run in runs})} walks:"
            " error against computing time"
        )
        _panel(
            left, runs, [one for one in series if one.engine == OURS], "this plant's integrators"
        )
        _panel(
            right,
            runs,
            [one for one in series if one.engine != OURS or one.method in BEST],
            "against the peers",
        )
        left.set_ylabel(f"largest error of the torso's path over {DURATION:g} s [m]")
        figure.savefig(folder / "work_precision.svg", metadata=UNDATED["svg"])


def read_runs(path: Path) -> list[Run]:
    """Reads the runs of a walks.csv."""
    with path.open(encoding="utf-8", newline="") as file:
        return [
            Run(**{item.name: CELLS[item.type](row[item.name]) for item in fields(Run)})
            for row in csv.DictReader(file)
        ]


def _panel(axes: Any, runs: Sequence[Run], series: Sequence[Series], title: str) -> None:
    """Draws one panel. With several engines colours mean engines and markers mean methods."""
    engines = list(dict.fromkeys(one.engine for one in series))
    for k, one in enumerate(series):
        among = (
            [other for other in series if other.engine == one.engine]
            if len(engines) > 1
            else series
        )
        colour = COLOURS[engines.index(one.engine) if len(engines) > 1 else k % len(COLOURS)]
        _line(axes, of_series(runs, one), one, colour, MARKERS[among.index(one) % len(MARKERS)])
    axes.set(
        xscale="log",
        yscale="log",
        ylim=SHOWN,
        xlabel="computing time per simulated second [s]",
        title=title,
    )
    axes.margins(x=0.03)
    axes.legend(fontsize=6.5, loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=2)


def _line(axes: Any, runs: Sequence[Run], series: Series, colour: Any, marker: str) -> None:
    groups = [[run for run in runs if run.setting == setting] for setting in series.settings]
    groups = [
        group for group in groups if group and np.isfinite(median(run.seconds for run in group))
    ]
    if not groups:
        return
    time = [median(run.seconds for run in group) / DURATION for group in groups]
    errors = [np.clip([run.error for run in group], *SHOWN) for group in groups]
    style = {"adaptive": "-", "fixed": "--", "own": ":"}[
        "own" if series.law != PLANT_LAW else "adaptive" if series.adaptive else "fixed"
    ]
    label = f"{NAMES[series.engine]}: {series.method}" + (
        "" if series.law == PLANT_LAW else " (against itself)"
    )
    axes.plot(
        time,
        [np.median(one) for one in errors],
        style,
        marker=marker,
        markersize=3,
        linewidth=1.0,
        color=colour,
        label=label,
    )
    axes.fill_between(
        time,
        [one.min() for one in errors],
        [one.max() for one in errors],
        color=colour,
        alpha=0.07,
        linewidth=0,
    )


if __name__ == "__main__":
    found = read_runs(Path(sys.argv[1]) / "walks.csv")
    draw(found, [one for one in (*ours(), *peers()) if of_series(found, one)], Path(sys.argv[1]))
