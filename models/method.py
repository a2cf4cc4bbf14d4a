"""Defines the integrator's settings, and its methods by their coefficients: explicit Runge-Kutta
and linearly implicit Rosenbrock-W; and cubics through the ends of a step.

plant_fmu/src/method.c contains the same coefficients.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.schema import Choice, Number

PROJECTIONS = ("none", "step")

Stage = Callable[[float, Array, Array], Array]


@dataclass(frozen=True, kw_only=True)
class Baumgarte:
    """Baumgarte stabilisation of the constraints (eq. 1)."""

    alpha: Annotated[float, Number("1/s", at_least=0.0)]
    beta: Annotated[float, Number("1/s", at_least=0.0)]


@dataclass(frozen=True, kw_only=True)
class Solver:
    """Settings of the integrator."""

    method: Annotated[str, Choice(METHODS)]
    step: Annotated[float, Number("s", at_least=0.0)]  # 0: error control
    tolerance: Annotated[float, Number("1", above=0.0, below=1.0)]
    step_max: Annotated[float, Number("s", above=0.0)]
    projection: Annotated[str, Choice(PROJECTIONS)] = "none"


@dataclass(frozen=True)
class Method:
    """Coefficients of a method with s stages (eq. 19) and of its error estimate."""

    order: int  # one more than that of the embedded method
    gamma: float  # 0: explicit
    a: Array  # (s, s)
    g: Array  # (s, s)
    c: Array  # (s,)
    b: Array  # (s,)
    e: Array  # (s,)  b minus the weights of the embedded method

    @property
    def stages(self) -> int:
        """Number of stages s."""
        return len(self.b)


def method_step(method: Method, stage: Stage, y_0: Array, h: float) -> tuple[Array, Array]:
    """Computes one step of eq. 19 from y_0 (n,) over h [s].

    Args:
        method: the coefficients.
        stage: gives k_i/h (n,) from c_i h, y_i (n,) and sum g_ij k_j (n,). An explicit method's
            stage returns f(t_0 + c_i h, y_i).
        y_0: start of the step.
        h: length of the step [s].

    Returns:
        y_1 (n,) and the estimate of its error (n,).
    """
    k = np.zeros((method.stages, len(y_0)))
    for i in range(method.stages):
        k[i] = h * stage(method.c[i] * h, y_0 + method.a[i] @ k, method.g[i] @ k)
    return y_0 + method.b @ k, method.e @ k


def _lower(rows: Sequence[Sequence[float]]) -> Array:
    """Returns the (s, s) matrix with the i numbers of rows[i] left of the diagonal of row i."""
    matrix = np.zeros((len(rows), len(rows)))
    for i, row in enumerate(rows):
        matrix[i, : len(row)] = row
    return matrix


def _row(
    order: int,
    a: Sequence[Sequence[float]],
    b: Sequence[float],
    e: Sequence[float],
    gamma: float = 0.0,
    g: Sequence[Sequence[float]] = ((),),
) -> Method:
    """Returns a method with c as the row sums of a, and an embedded method of one order less."""
    s, matrix = len(b), _lower(a)
    return Method(
        order=order,
        gamma=gamma,
        a=matrix,
        g=_lower(g) if gamma > 0.0 else np.zeros((s, s)),
        c=matrix.sum(axis=1),
        b=np.array(b),
        e=np.array(e),
    )


ROS2_GAMMA = 1.0 - 1.0 / math.sqrt(2.0)

METHOD: dict[str, Method] = {
    # close to ROS34PW2 (Rang and Angermann 2005), by tools/rosw3.py: L-stable, stiffly accurate
    "rosw3": _row(
        order=3,
        gamma=0.435866521508459,
        a=[[], [0.8600765640643095], [0.8279797393140516, -0.11004647855982283], [0.0, 0.0, 1.0]],
        g=[
            [],
            [-0.8600765640643084],
            [-0.8859926672530537, 0.05043946654533214],
            [0.23418392804962088, -1.2153107048931744, 0.5452602553350947],
        ],
        b=[0.23418392804962088, -1.2153107048931744, 1.5452602553350947, 0.435866521508459],
        e=[-0.13692238301635248, -1.1228581716475137, 1.0424361172393994, 0.21734443742446677],
    ),
    # Verwer, Spee, Blom and Hundsdorfer 1999: L-stable
    "ros2": _row(
        order=2,
        gamma=ROS2_GAMMA,
        a=[[], [1.0]],
        g=[[], [-2.0 * ROS2_GAMMA]],
        b=[0.5, 0.5],
        e=[-0.5, 0.5],
    ),
    # Dormand and Prince 1980
    "dp54": _row(
        order=5,
        a=[
            [],
            [1 / 5],
            [3 / 40, 9 / 40],
            [44 / 45, -56 / 15, 32 / 9],
            [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729],
            [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656],
            [35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
        ],
        b=[35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84, 0.0],
        e=[71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40],
    ),
}
METHODS = tuple(METHOD)


# cubics


def cubic(
    start: Array, slope_start: Array, rise: Array, slope_end: Array, x: Array
) -> tuple[Array, Array, Array]:
    """Returns value, first and second derivative at x (nodes,) in [0, 1] of cubics (eq. 28).

    The cubics are given by values and rates per step at both ends.
    """
    bend = slope_start + slope_end - 2.0 * rise
    curve = rise - slope_start - bend
    x = x.reshape(-1, *(1 for _ in np.shape(start)))
    value = start + x * (slope_start + x * (curve + x * bend))
    return value, slope_start + x * (2.0 * curve + 3.0 * x * bend), 2.0 * curve + 6.0 * x * bend


def parabola(start: Array, end: Array, mean: Array, x: Array) -> Array:
    """Returns values at x (nodes,) in [0, 1] of parabolas through both ends with these means
    (eq. 28).
    """
    x = x.reshape(-1, *(1 for _ in np.shape(start)))
    ends = (1.0 - x * (4.0 - 3.0 * x)) * start + x * (3.0 * x - 2.0) * end
    return np.asarray(ends + 6.0 * x * (1.0 - x) * mean)


def deepest(start: float, slope_start: float, end: float, slope_end: float) -> float:
    """Returns the largest value on [0, 1] of the cubic with these ends and slopes (eq. 28)."""
    if not (slope_start > 0.0 and slope_end < 0.0):
        return max(start, end)
    bend = slope_start + slope_end - 2.0 * (end - start)
    curve = end - start - slope_start - bend
    low, high = 0.0, 1.0
    for _ in range(60):
        x = 0.5 * (low + high)
        rises = slope_start + x * (2.0 * curve + 3.0 * x * bend) > 0.0
        low, high = (x, high) if rises else (low, x)
    top = start + low * (slope_start + low * (curve + low * bend))
    return max(top, start, end)
