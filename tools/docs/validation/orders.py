"""Shows the integrators' orders on the problems of tests/plant/test_plant_integrator.py."""

from __future__ import annotations

import ctypes as ct
from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from test_plant_integrator import ORDER, PROBLEMS, Problem, end, reference, slope

from tools.docs.validation.shown import MARKERS, PALETTE, Shown

TITLES = {"tumbling": "free flight, legs whirling", "pressed": "six feet sliding in soft ground"}
Line = tuple[Sequence[float], Sequence[float]]  # steps, errors


def orders(core: ct.CDLL) -> Shown:
    """Shows the error of every method against the step, and the slope."""
    found = {
        name: {method: _line(core, PROBLEMS[name], method) for method in ORDER} for name in TITLES
    }

    def draw(figure: Figure) -> None:
        panels = figure.subplots(1, 2, sharey=True)
        for axes, (name, title) in zip(panels, TITLES.items(), strict=True):
            for k, (method, (steps, errors)) in enumerate(found[name].items()):
                axes.loglog(
                    steps,
                    errors,
                    MARKERS[k] + "-",
                    color=PALETTE[k],
                    label=method,
                    markersize=4,
                    linewidth=1.2,
                )
            axes.set(title=title, xlabel="step [s]")
        panels[0].set_ylabel("largest error of all states")
        panels[0].legend()

    rows = [
        (f"`{method}`", str(order), *(f"{slope(*found[name][method]):.2f}" for name in TITLES))
        for method, order in ORDER.items()
    ]
    return Shown(
        columns=("method", "order", *(f"measured: {title}" for title in TITLES.values())),
        rows=rows,
        draw=draw,
        alt="Error against step size of five methods, straight lines with the slopes of the table",
    )


def _line(core: ct.CDLL, problem: Problem, method: str) -> Line:
    exact, steps = (
        reference(core, problem),
        problem.duration / np.array(problem.counts(ORDER[method])),
    )
    return list(steps), [
        float(np.max(np.abs(end(core, problem, method=method, step=float(step)) - exact)))
        for step in steps
    ]
