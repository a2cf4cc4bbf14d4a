"""Chooses the figures of a study's report, and saves them.

Colour-blind readers can distinguish the colours, and marks differ in shape as well.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import matplotlib
from matplotlib.figure import Figure

from hexapod_cosim.controller.figure_style import DPI, SETTINGS, UNDATED
from hexapod_cosim.cosim.common.files import atomic_path
from hexapod_cosim.cosim.study.plan.records import GRID, VALUES, Study
from hexapod_cosim.cosim.study.report.coordinates import parallel
from hexapod_cosim.cosim.study.report.curves import (
    effects,
    history,
    pareto,
    response,
    shown_effects,
    slip_and_cost,
)
from hexapod_cosim.cosim.study.report.heat import heat_map
from hexapod_cosim.cosim.study.report.style import MAX_CELLS, SLIP, mean_of
from hexapod_cosim.cosim.study.store.table import Point
from hexapod_cosim.cosim.study.store.trials import Trial
from hexapod_cosim.models import HexapodError

EMPTY_CELLS = (
    "A dot: no run (no pair) there yet; a cross: none walked; "
    "a dash: walked, too short for a figure."
)


@dataclass(frozen=True)
class Drawing:
    """A figure with its title and caption."""

    title: str
    caption: str
    draw: Callable[[], Figure]


def drawings(
    study: Study, points: Sequence[Point], trials: Sequence[Trial], *, before: float = math.nan
) -> dict[str, Drawing]:
    """Returns the figures that a study's points allow, by the names of their files.

    Args:
        before: the first objective before the optimisation, NaN without one.
    """
    found: dict[str, Drawing] = {}
    walks = any(
        math.isfinite(mean_of(point, control, SLIP))
        for point in points
        for control in study.run_controls
    )
    if study.optimise is not None and trials:
        caption = (
            f"Mean {study.optimise.metrics[0]} of each trial over its training runs, and the best "
            "so far; dashed: before the optimisation."
        )
        found["history"] = Drawing("Optimisation", caption, partial(history, study, trials, before))
    elif study.optimise is None:
        found |= _of_factors(study, points, walks=walks)
    if len(study.factors) > 1 and walks:
        why = "Grey, dashed: without a figure, as no run walked, or not long enough."
        caption = f"A line per point and control; colour: mean slip per metre. {why}"
        found["parallel"] = Drawing("All factors", caption, partial(parallel, points, study))
    if any(
        len(slip_and_cost([item for item in points if not item.held_out], control))
        for control in study.run_controls
    ):
        caption = (
            "A mark per point and control, means over its walks; "
            "line: the points that no other point betters in both."
        )
        found["pareto"] = Drawing(
            "Slip against cost of transport", caption, partial(pareto, points, study)
        )
    return found


def _of_factors(study: Study, points: Sequence[Point], *, walks: bool) -> dict[str, Drawing]:
    """Returns the figure over two factors of a grid, over the only factor or over each factor."""
    axes = [
        factor
        for factor in study.factors
        if factor.kind == VALUES and 1 < len(factor.values) <= MAX_CELLS
    ]
    if study.design == GRID and len(axes) >= 2 and walks:
        title = f"{axes[0].name} and {axes[1].name}"
        averaged = ", averaged over the others" if len(study.factors) > 2 else ""
        caption = f"Mean slip per metre{averaged}. {EMPTY_CELLS}"
        return {
            "heat_map": Drawing(title, caption, partial(heat_map, points, axes[0], axes[1], study))
        }
    if len(study.factors) == 1 and walks:
        bars = "; bars: Student's 95 % intervals over seeds" if len(study.seeds) > 1 else ""
        return {
            "response": Drawing(
                study.factors[0].name,
                f"Means of the walks at each point{bars}.",
                partial(response, points, study.factors[0], study),
            )
        }
    if study.factors and shown_effects(study) and walks:
        caption = (
            "Mean slip per metre of each point over each factor by itself; "
            "crosses at the lower edge: no run walked."
        )
        return {
            "effects": Drawing("Slip over each factor", caption, partial(effects, points, study))
        }
    return {}


def save(found: dict[str, Drawing], folder: Path) -> list[Path]:
    """Writes every figure as SVG and PNG; returns the files. Raises HexapodError."""
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise HexapodError("cannot write", got=error.strerror, where=str(folder)) from error
    files: list[Path] = []
    with matplotlib.rc_context(SETTINGS):
        for name, item in found.items():
            figure = item.draw()
            for kind, metadata in UNDATED.items():
                with atomic_path(folder / f"{name}.{kind}") as path:
                    figure.savefig(path, format=kind, dpi=DPI, metadata=metadata)
                # the layout takes as long as the drawing, and is the same for both formats
                figure.set_layout_engine("none")
                files.append(folder / f"{name}.{kind}")
    return files
