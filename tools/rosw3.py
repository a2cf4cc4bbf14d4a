"""Makes the coefficients of the method rosw3 (plant_fmu/src/method.c): those nearest to ROS34PW2's
that keep order 3 with A_i formed anew.

ROS34PW2 (Rang and Angermann, BIT 45, 2005) is a W-method: order 3 with one inexact Jacobian A for
all its stages. Here every stage has its own (its masses and joints are where the stage is), which
asks for one condition more, sum b_i c_i gamma_i = 0; ROS34PW2 misses it by 0.0025.
Kept: gamma, the last stage's a = (0, 0, 1) and stiff accuracy (b = last row of a + g + gamma), so
that it stays A- and L-stable.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

Array = NDArray[np.float64]

GAMMA = 0.435866521508459
# ROS34PW2's a_21, a_31, a_32, g_21, g_31, g_32, b_1..b_3, and its embedded weights
START = np.array(
    [
        *(0.871733043016918, 0.844574600153694, -0.112990642364842),
        *(-0.871733043016918, -0.903380570130441, 0.054180672388095),
        *(0.242123807060953, -1.223250583904515, 1.545260255335102),
    ]
)
EMBEDDED = np.array([0.378109031458194, -0.096042292212423, 0.5, 0.217933260754230])


def method(x: Array) -> tuple[Array, Array, Array]:
    """a (4, 4), g (4, 4) without gamma, b (4,)"""
    a, g = np.zeros((4, 4)), np.zeros((4, 4))
    a[1, 0], a[2, :2], a[3, 2] = x[0], x[1:3], 1.0
    b = np.array([*x[6:9], GAMMA])
    g[1, 0], g[2, :2], g[3, :3] = x[3], x[4:6], b[:3] - a[3, :3]
    return a, g, b


def conditions(x: Array) -> Array:
    """What must vanish: order 3 with any A, and with A changing along the solution (the last)."""
    a, g, b = method(x)
    full, c = g + GAMMA * np.eye(4), a.sum(axis=1)
    rows = full.sum(axis=1)
    two = [b.sum() - 1.0, b @ c - 1.0 / 2.0, b @ rows]
    three = [
        b @ c**2 - 1.0 / 3.0,
        b @ a @ c - 1.0 / 6.0,
        b @ a @ rows,
        b @ full @ c,
        b @ full @ rows,
        (b * c) @ rows,
    ]
    return np.array([*two, *three])


def embedded_weights(x: Array) -> Array:
    """The weights nearest to ROS34PW2's embedded ones that have order 2 with any A."""
    a, g, _ = method(x)
    rows = np.vstack([np.ones(4), a.sum(axis=1), (g + GAMMA * np.eye(4)).sum(axis=1)])
    return EMBEDDED + rows.T @ np.linalg.solve(
        rows @ rows.T, np.array([1.0, 0.5, 0.0]) - rows @ EMBEDDED
    )


def main() -> None:
    solution = least_squares(conditions, START, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    a, g, b = method(solution.x)
    for name, value in (
        ("a", a),
        ("g", g),
        ("c", a.sum(axis=1)),
        ("b", b),
        ("e", b - embedded_weights(solution.x)),
    ):
        print(name, [[float(entry) for entry in row] for row in np.atleast_2d(value)])
    print("largest condition left:", float(np.max(np.abs(conditions(solution.x)))))


if __name__ == "__main__":
    main()
