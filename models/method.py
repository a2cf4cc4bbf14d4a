"""Integration methods as coefficients: explicit Runge-Kutta and linearly implicit Rosenbrock-W.

The same rows stand in plant_fmu/src/method.c. What a row means is eq. 15; `e` holds the weights
`b` less those of the embedded method.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hexapod_cosim.models.records import Array


@dataclass(frozen=True)
class Method:
    """One method with s stages: coefficients of eq. 15 and of its error estimate (eq. 20)."""

    order: int
    error_order: int  # of the embedded method; 0: there is none, so fixed steps only
    gamma: float  # 0: explicit
    a: Array  # (s, s)
    g: Array  # (s, s)
    c: Array  # (s,)
    b: Array  # (s,)
    e: Array  # (s,)

    @property
    def stages(self) -> int:
        """s"""
        return len(self.b)


def _lower(rows: Sequence[Sequence[float]]) -> Array:
    """(s, s) matrix whose row i holds the i given numbers left of the diagonal."""
    matrix = np.zeros((len(rows), len(rows)))
    for i, row in enumerate(rows):
        matrix[i, : len(row)] = row
    return matrix


def _explicit(order: int, a: list[list[float]], b: list[float], embedded: list[float] | None) -> Method:
    """An explicit method, whose c is the row sums of a; embedded: the weights it is compared with."""
    A, error = _lower(a), np.zeros(len(b)) if embedded is None else np.subtract(b, embedded)
    error_order = 0 if embedded is None else order - 1
    return Method(order, error_order, 0.0, A, np.zeros_like(A), A.sum(axis=1), np.array(b), error)


def _implicit(
    order: int, gamma: float, a: list[list[float]], g: list[list[float]], b: list[float], e: list[float]
) -> Method:
    """A linearly implicit method, whose c is the row sums of a."""
    A = _lower(a)
    return Method(order, order - 1, gamma, A, _lower(g), A.sum(axis=1), np.array(b), np.array(e))


_ROS2_GAMMA = 1.0 - 1.0 / math.sqrt(2.0)

METHODS_BY_NAME = {
    # near ROS34PW2 (Rang and Angermann 2005), made by tools/rosw3.py: L-stable, stiffly accurate
    "rosw3": _implicit(
        3,
        0.435866521508459,
        [
            [],
            [0.8600765640643095],
            [0.8279797393140516, -0.11004647855982283],
            [0.0, 0.0, 1.0],
        ],
        [
            [],
            [-0.8600765640643084],
            [-0.8859926672530537, 0.05043946654533214],
            [0.23418392804962088, -1.2153107048931744, 0.5452602553350947],
        ],
        [0.23418392804962088, -1.2153107048931744, 1.5452602553350947, 0.435866521508459],
        [-0.13692238301635248, -1.1228581716475137, 1.0424361172393994, 0.21734443742446677],
    ),
    # Verwer, Spee, Blom and Hundsdorfer 1999: L-stable
    "ros2": _implicit(
        2, _ROS2_GAMMA, [[], [1.0]], [[], [-2.0 * _ROS2_GAMMA]], [0.5, 0.5], [-0.5, 0.5]
    ),
    # Dormand and Prince 1980
    "dp54": _explicit(
        5,
        [
            [],
            [1 / 5],
            [3 / 40, 9 / 40],
            [44 / 45, -56 / 15, 32 / 9],
            [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729],
            [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656],
            [35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
        ],
        [35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84, 0.0],
        [5179 / 57600, 0.0, 7571 / 16695, 393 / 640, -92097 / 339200, 187 / 2100, 1 / 40],
    ),
    # Bogacki and Shampine 1989
    "bs32": _explicit(
        3,
        [[], [1 / 2], [0.0, 3 / 4], [2 / 9, 1 / 3, 4 / 9]],
        [2 / 9, 1 / 3, 4 / 9, 0.0],
        [7 / 24, 1 / 4, 1 / 3, 1 / 8],
    ),
    # the classic method of Kutta
    "rk4": _explicit(
        4, [[], [1 / 2], [0.0, 1 / 2], [0.0, 0.0, 1.0]], [1 / 6, 1 / 3, 1 / 3, 1 / 6], None
    ),
}  # fmt: skip


def step(method: Method, rate: Rate, t: float, y: Array, h: float, A: Array | None = None) -> tuple[Array, Array]:
    raise NotImplementedError
