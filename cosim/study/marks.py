"""What a study's figures have in common: colours, marks, names of axes."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.colors import LogNorm
from numpy.typing import NDArray

from hexapod_cosim.cosim.metrics import FLOORS
from hexapod_cosim.cosim.study.records import Factor
from hexapod_cosim.cosim.study.table import Point

Array = NDArray[np.float64]

COLOURS = {"kinematic": "#D55E00", "compliant": "#0072B2"}
MARKS = {"kinematic": "s", "compliant": "o"}
SLIP, COST = "slip_per_metre", "cost_of_transport"
NAMES = {SLIP: "slip [m/m]", COST: "cost of transport [1]"}
COLOURMAP, CHANGES = "viridis", "RdBu_r"
MOST_LINES, MOST_CELLS = 1500, 40  # beyond them a figure only gets slower and darker


def mean_of(point: Point, control: str, metric: str) -> float:
    """NaN where there is none."""
    return point.means[control][metric].value if control in point.means else math.nan


def label_of(factor: Factor) -> str:
    unit = "designed" if factor.relative else factor.unit
    return f"{factor.name} [{unit}]" if unit else factor.name


def logarithmic(slips: Array) -> LogNorm:
    """Colours of slips that lie decades apart."""
    seen = np.clip(slips[np.isfinite(slips)], FLOORS[SLIP], None)
    return LogNorm(float(seen.min()), float(seen.max()) * (1.0 + 1e-9)) if len(seen) else LogNorm(FLOORS[SLIP], 1.0)


def some_of(points: Sequence[Point]) -> list[Point]:
    """Not more than can be seen, evenly chosen."""
    step = max(math.ceil(len(points) / MOST_LINES), 1)
    return list(points[::step])
