"""Draws curves of a study: metrics over factors, slip against cost, and metrics over trials."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from hexapod_cosim.cosim.common.control_style import ControlStyle, control_styles
from hexapod_cosim.cosim.results.metrics import METRICS
from hexapod_cosim.cosim.study.plan.records import Factor, Study
from hexapod_cosim.cosim.study.report.style import (
    COST,
    NAMES,
    SLIP,
    Array,
    label_of,
    mean_of,
    named,
    place_of,
    some_of,
    ticks_of,
)
from hexapod_cosim.cosim.study.store.table import Point
from hexapod_cosim.cosim.study.store.trials import Trial

MAX_EFFECTS, COLUMNS = 9, 3  # panels, and panels side by side
LOG_RATIO = 10.0  # largest over least value beyond which an axis is logarithmic
GREY = "0.55"


def response(points: Sequence[Point], factor: Factor, study: Study) -> Figure:
    """Draws slip and cost over one factor, with the intervals over the seeds."""
    figure = Figure(figsize=(9.0, 3.4))
    styles = control_styles(study.run_controls)
    for axes, metric in zip(figure.subplots(1, 2), (SLIP, COST), strict=True):
        for control in study.run_controls:
            _curve(
                axes, points, factor, (control, metric), styles[control], joined=not named(factor)
            )
        _factor_axis(axes, factor)
        axes.set(ylabel=NAMES[metric], ylim=(0.0, None))
    figure.axes[0].legend()
    return figure


def _curve(
    axes: Axes,
    points: Sequence[Point],
    factor: Factor,
    what: tuple[str, str],
    style: ControlStyle,
    *,
    joined: bool,
) -> None:
    control, metric = what
    shown = sorted(
        (place_of(factor, item.values[factor.name]), item.means[control][metric]) for item in points
    )
    x, mean, half = (
        np.array([(place, item.value, item.half_width) for place, item in shown]).reshape(-1, 3).T
    )
    half = np.where(np.isfinite(half), half, 0.0)
    line = "-" if joined else ""
    axes.errorbar(
        x,
        mean,
        half,
        marker=style.marker,
        color=style.light,
        markersize=4,
        linestyle=line,
        linewidth=1.2,
        capsize=2.5,
        label=control,
    )


def _factor_axis(axes: Axes, factor: Factor) -> None:
    if named(factor):
        names = ticks_of(factor)
        axes.set_xticks(range(len(names)), names, rotation=20 if max(map(len, names)) > 8 else 0)
        axes.set_xlim(-0.5, len(names) - 0.5)
    axes.set_xlabel(label_of(factor))


def effects(points: Sequence[Point], study: Study) -> Figure:
    """Draws slip over each factor by itself; points where no run walked are at the lower edge."""
    factors = shown_effects(study)
    columns = min(len(factors), COLUMNS)
    rows = math.ceil(len(factors) / columns)
    figure = Figure(figsize=(3.1 * columns + 0.6, 2.5 * rows + 0.5))
    panels = np.atleast_1d(figure.subplots(rows, columns, sharey=True, squeeze=False).ravel())
    for axes, factor in zip(panels, factors, strict=False):
        for control in study.run_controls:
            _marks(axes, some_of(points), factor, control, study)
        _factor_axis(axes, factor)
        axes.set_yscale("log")
        axes.margins(x=0.05, y=0.12)
    for axes in panels[len(factors) :]:
        axes.set_visible(False)
    for axes in panels[::columns]:
        axes.set_ylabel(NAMES[SLIP])
    panels[0].legend(fontsize=7)
    return figure


def shown_effects(study: Study) -> list[Factor]:
    """Returns the factors that vary, MAX_EFFECTS at most."""
    return [factor for factor in study.factors if len(set(factor.values)) != 1][:MAX_EFFECTS]


def _marks(axes: Axes, points: Sequence[Point], factor: Factor, control: str, study: Study) -> None:
    """Draws a mark per point, and a cross at the bottom where no run walked."""
    style = control_styles(study.run_controls)[control]
    place = np.array([place_of(factor, item.values[factor.name]) for item in points])
    slip = np.array([mean_of(item, control, SLIP) for item in points])
    lost = np.array(
        [item.runs[control] > 0 and item.walked[control] == 0 for item in points], dtype=np.bool_
    )
    axes.plot(
        place,
        slip,
        linestyle="",
        marker=style.marker,
        markersize=4,
        alpha=0.6,
        color=style.light,
        label=control,
    )
    height = 0.02 + 0.05 * study.run_controls.index(control)
    axes.plot(
        place[lost],
        np.full(np.sum(lost), height),
        linestyle="",
        marker="x",
        markersize=4,
        color=style.light,
        transform=axes.get_xaxis_transform(),
    )


def pareto(points: Sequence[Point], study: Study) -> Figure:
    """Draws slip against cost of transport with the Pareto front of each control."""
    figure = Figure(figsize=(6.4, 4.2))
    axes = figure.subplots()
    for control, style in control_styles(study.run_controls).items():
        pairs = slip_and_cost([point for point in points if not point.held_out], control)
        if not len(pairs):
            continue
        shown = some_of(pairs.tolist())
        axes.plot(
            *np.array(shown).T,
            linestyle="",
            marker=style.marker,
            markersize=4,
            alpha=0.5,
            color=style.light,
            label=control,
        )
        edge = front(pairs)
        axes.plot(*edge.T, drawstyle="steps-post", color=style.light, linewidth=1.4)
        axes.plot(*edge.T, linestyle="", marker=style.marker, markersize=5.5, color=style.light)
    costs, slips = (np.concatenate([line.get_data()[k] for line in axes.lines]) for k in (0, 1))
    for name, values in (("xscale", np.asarray(costs)), ("yscale", np.asarray(slips))):
        axes.set(
            **{
                name: "log"
                if values.min() > 0.0 and values.max() > LOG_RATIO * values.min()
                else "linear"
            }
        )
    axes.set(xlabel=NAMES[COST], ylabel=NAMES[SLIP])
    axes.margins(0.05)
    axes.legend(title="line: the front")
    return figure


def slip_and_cost(points: Sequence[Point], control: str) -> Array:
    """Returns cost of transport and slip (k, 2) of the points that have both."""
    pairs = np.array(
        [(mean_of(point, control, COST), mean_of(point, control, SLIP)) for point in points]
    ).reshape(-1, 2)
    return np.asarray(pairs[np.isfinite(pairs).all(axis=1)])


def front(pairs: Array) -> Array:
    """Returns the Pareto front (k, 2) of points (n, 2), less being better, by the first value."""
    kept, best = [], math.inf
    for first, second in pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))].tolist():
        if second < best:
            kept.append((first, second))
            best = second
    return np.array(kept, dtype=np.float64).reshape(-1, 2)


def history(study: Study, trials: Sequence[Trial], before: float) -> Figure:
    """Draws the first metric of each trial, the best so far, and the value before."""
    assert study.optimise is not None
    name = study.optimise.metrics[0]
    unit, less, _ = METRICS[name]
    figure = Figure(figsize=(8.0, 3.4))
    axes = figure.subplots()
    _trial_marks(axes, trials, name)
    complete = [trial for trial in trials if trial.feasible and math.isfinite(trial.means[name])]
    if complete:
        best = (np.minimum if less else np.maximum).accumulate(
            [trial.means[name] for trial in complete]
        )
        axes.step(
            [trial.number for trial in complete],
            best,
            where="post",
            color="#009E73",
            label="best so far",
        )
    if math.isfinite(before):
        axes.axhline(before, color="#D55E00", linestyle="--", linewidth=1.2, label="before")
    axes.set(
        xlabel="trial",
        ylabel=f"{name} [{unit}]",
        xlim=(-0.5, max(study.optimise.trials - 0.5, 0.5)),
    )
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    figure.legend(loc="outside upper center", ncols=5)
    return figure


def _trial_marks(axes: Axes, trials: Sequence[Trial], name: str) -> None:
    """Draws a mark for the metric of each trial, and one at the lower edge where it has none."""
    for feasible, mark, label in ((True, "o", "trial"), (False, "x", "breaks a constraint")):
        shown = [
            (trial.number, trial.means[name])
            for trial in trials
            if trial.feasible is feasible and math.isfinite(trial.means[name])
        ]
        if shown:
            axes.plot(
                *zip(*shown, strict=True),
                linestyle="",
                marker=mark,
                markersize=4.5,
                color="#0072B2" if feasible else GREY,
                label=label,
            )
    lost = [trial.number for trial in trials if not math.isfinite(trial.means[name])]
    if lost:
        axes.plot(
            lost,
            [0.03] * len(lost),
            "|",
            color="#D55E00",
            label="no figure: a run fell",
            transform=axes.get_xaxis_transform(),
        )
