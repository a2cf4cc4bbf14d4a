"""Calculates the coefficients of the method rosw3 (plant_fmu/src/method.c).

ROS34PW2 (Rang and Angermann, BIT 45, 2005) is a W-method: of order 3 with one inexact Jacobian A
for all stages. In the plant every stage i has its own A_i, since A depends on the configuration.
Order 3 then requires a further condition, sum b_i c_i gamma_i = 0, which ROS34PW2 misses by 0.0025.
rosw3 has the coefficients nearest to ROS34PW2's that meet it. Unchanged are gamma, the last stage's
a = (0, 0, 1) and stiff accuracy (b = last row of a + g + gamma), so that rosw3 is A- and L-stable.
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
    """Returns a (4, 4), g (4, 4) without gamma, b (4,) of the free coefficients x (9,)."""
    a, g = np.zeros((4, 4)), np.zeros((4, 4))
    a[1, 0], a[2, :2], a[3, 2] = x[0], x[1:3], 1.0
    b = np.array([*x[6:9], GAMMA])
    g[1, 0], g[2, :2], g[3, :3] = x[3], x[4:6], b[:3] - a[3, :3]
    return a, g, b


def conditions(x: Array) -> Array:
    """Returns the residuals of the order conditions: order 3 with any A; the last with any A_i."""
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
    """Returns the weights of order 2 with any A that are nearest to ROS34PW2's embedded ones."""
    a, g, _ = method(x)
    rows = np.vstack([np.ones(4), a.sum(axis=1), (g + GAMMA * np.eye(4)).sum(axis=1)])
    return EMBEDDED + rows.T @ np.linalg.solve(
        rows @ rows.T, np.array([1.0, 0.5, 0.0]) - rows @ EMBEDDED
    )


def main() -> None:
    """Prints the coefficients."""
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
    print("largest residual of the conditions:", float(np.max(np.abs(conditions(solution.x)))))


if __name__ == "__main__":
    main()
