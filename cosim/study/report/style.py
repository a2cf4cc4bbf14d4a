"""The style of a study's figures: colours, marks, names of axes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np
from matplotlib.colors import LogNorm
from numpy.typing import NDArray

from hexapod_cosim.cosim.results.metrics import FLOORS
from hexapod_cosim.cosim.study.plan.records import VALUES, Factor
from hexapod_cosim.cosim.study.store.table import Point

Array = NDArray[np.float64]
_Item = TypeVar("_Item")

SLIP, COST = "slip_per_metre", "cost_of_transport"
NAMES = {SLIP: "slip [m/m]", COST: "cost of transport [1]"}
COLOURMAP, CHANGES = "viridis", "RdBu_r"
MAX_LINES, MAX_CELLS = 1500, 40  # more make a figure slower and no clearer


def mean_of(point: Point, control: str, metric: str) -> float:
    """Returns the mean of a metric at a point, NaN where there is none."""
    return point.means[control][metric].value


def label_of(factor: Factor) -> str:
    """Returns the name of a factor with its unit."""
    unit = "x designed" if factor.relative else factor.unit
    return f"{factor.name} [{unit}]" if unit else factor.name


def named(factor: Factor) -> bool:
    """Returns whether the values of a factor are names or booleans rather than numbers."""
    return factor.kind == VALUES and not all(
        isinstance(value, int | float) and not isinstance(value, bool) for value in factor.values
    )


def place_of(factor: Factor, value: Any) -> float:
    """Returns the coordinate of a value on an axis; for a name, its index."""
    return float(list(dict.fromkeys(factor.values)).index(value)) if named(factor) else float(value)


def ticks_of(factor: Factor) -> list[str]:
    """Returns the different values of a factor as labels."""
    return [
        f"{value:.4g}" if isinstance(value, float) else str(value)
        for value in dict.fromkeys(factor.values)
    ]


def logarithmic(slips: Array) -> LogNorm:
    """Returns the logarithmic colour scale of slips."""
    seen = np.clip(slips[np.isfinite(slips)], FLOORS[SLIP], None)
    return (
        LogNorm(float(seen.min()), float(seen.max()) * (1.0 + 1e-9))
        if len(seen)
        else LogNorm(FLOORS[SLIP], 1.0)
    )


def some_of(items: Sequence[_Item]) -> list[_Item]:
    """Returns at most MAX_LINES items, evenly chosen."""
    step = max(math.ceil(len(items) / MAX_LINES), 1)
    return list(items[::step])
