"""Computes the height of a smooth surface (eq. 32) and its nearest point (eq. 31, 33).

Between four nodes the surface is the bicubic polynomial with Catmull-Rom slopes: the slope at a
node is the difference of its neighbours over two cells. Nodes beyond the border follow from linear
extrapolation, so that a plane is exact. Beyond the map the slope across its border runs out over 60
mm: with the distance t from the border and u = t/60 mm the height is b + s (1 - (1 - u)^3)/3 60 mm
up to u = 1 and constant behind, where b and s are height and slope at the border. The surface is C1
everywhere.
"""

from __future__ import annotations

import math

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.ground.surface import Surface

ITERATIONS = 100
HALVINGS = 40
CONVERGED = 1e-14  # m    of a step
RUN_OUT = 0.06  # m    beyond the border, over which its slope falls to 0
SHORT = 1e-6  # m    steps that are not tried: the change of the distance is lost in rounding

# powers of t (1, t, t^2, t^3) in columns; weights of the nodes -1, 0, 1, 2 in rows
CATMULL_ROM = 0.5 * np.array(
    [[0.0, -1.0, 2.0, -1.0], [2.0, 0.0, -5.0, 3.0], [0.0, 1.0, 4.0, -3.0], [0.0, 0.0, -1.0, 1.0]]
)


def grid_place(coordinate: float, count: int) -> tuple[int, float, float]:
    """Returns the cell of a grid coordinate, the place in it from 0 to 1, and how far the
    coordinate is beyond the map, in cells: positive behind its last node, negative before its first
    one.
    """
    inside = min(max(coordinate, 0.0), float(count - 1))
    cell = min(math.floor(inside), count - 2)
    return cell, inside - cell, coordinate - inside


def _with_ghosts(values: Array, cell: int, count: int) -> Array:
    """Returns nodes cell - 1 to cell + 2 along the first axis, extrapolated beyond the border."""
    before = values[cell - 1] if cell > 0 else 2.0 * values[0] - values[1]
    behind = values[cell + 2] if cell + 2 < count else 2.0 * values[-1] - values[-2]
    return np.stack([before, values[cell], values[cell + 1], behind])


def cubic_weights(t: float, beyond: float, cell: float) -> tuple[Array, Array, Array]:
    """Returns the four weights at t (eq. 32), and their first and second derivatives by t.

    beyond: as in `grid_place`; cell: spacing of the nodes [m].
    """
    value = CATMULL_ROM @ np.array([1.0, t, t * t, t**3])
    first = CATMULL_ROM @ np.array([0.0, 1.0, 2.0 * t, 3.0 * t * t])
    if beyond == 0.0:
        return value, first, CATMULL_ROM @ np.array([0.0, 0.0, 2.0, 6.0 * t])
    left = max(1.0 - abs(beyond) * cell / RUN_OUT, 0.0)  # of the run-out
    way = math.copysign(RUN_OUT / cell, beyond)
    second = -2.0 * left / way * first
    return value + way * (1.0 - left**3) / 3.0 * first, left * left * first, second


def height_and_slopes(surface: Surface, x: float, y: float) -> tuple[float, Array, Array]:
    """Returns the height [m] at (x, y), its gradient (2,) and its Hessian (2, 2) [1/m]."""
    column, t, beyond_x = grid_place((x - surface.x0) / surface.cell, surface.columns)
    row, u, beyond_y = grid_place((y - surface.y0) / surface.cell, surface.rows)
    band = surface.height[max(row - 1, 0) : row + 3]
    nodes = _with_ghosts(band, row - max(row - 1, 0), len(band))
    nodes = _with_ghosts(nodes.T, column, surface.columns).T  # (4, 4) rows along y
    a, da, dda = cubic_weights(t, beyond_x, surface.cell)
    b, db, ddb = cubic_weights(u, beyond_y, surface.cell)
    da, db = da / surface.cell, db / surface.cell
    dda, ddb = dda / surface.cell**2, ddb / surface.cell**2
    gradient = np.array([b @ nodes @ da, db @ nodes @ a])
    mixed = db @ nodes @ da
    return (
        float(b @ nodes @ a),
        gradient,
        np.array([[b @ nodes @ dda, mixed], [mixed, ddb @ nodes @ a]]),
    )


def node_weights(coordinates: Array, count: int, size: float) -> Array:
    """Returns the weights (coordinates, nodes) of a grid's nodes at grid coordinates.

    size: of a cell [m].
    """
    weights = np.zeros((len(coordinates), count + 2))  # with a ghost at each end
    for row, coordinate in enumerate(coordinates.tolist()):
        cell, t, beyond = grid_place(coordinate, count)
        weights[row, cell : cell + 4] = cubic_weights(t, beyond, size)[0]
    inner = weights[:, 1:-1]
    inner[:, :2] += weights[:, :1] * np.array([2.0, -1.0])
    inner[:, -2:] += weights[:, -1:] * np.array([-1.0, 2.0])
    return inner


def heights_at(surface: Surface, x: Array, y: Array) -> Array:
    """Returns the heights (y, x) [m] of a smooth surface at all pairs of x and y [m]."""
    across = node_weights((x - surface.x0) / surface.cell, surface.columns, surface.cell)
    along = node_weights((y - surface.y0) / surface.cell, surface.rows, surface.cell)
    return np.asarray(along @ surface.height @ across.T)


def nearest_point(surface: Surface, point: Array) -> tuple[Array, Array]:
    """Returns the point (3,) of the surface nearest to a point (3,), and its unit normal (3,).

    Newton's method starts below the point and follows the distance downhill: each step is halved
    until the distance decreases, and where the Hessian is not positive definite, the part with the
    surface's curvature is left out of it. On a surface with several nearest points the result is
    the one of that valley.
    """
    place = point[:2].copy()
    height, slope, curvature = height_and_slopes(surface, *place)
    for _ in range(ITERATIONS):
        above = height - point[2]
        gradient = place - point[:2] + above * slope
        hessian = np.eye(2) + np.outer(slope, slope)
        if np.all(np.linalg.eigvalsh(hessian + above * curvature) > 0.0):
            hessian = hessian + above * curvature
        step = -np.linalg.solve(hessian, gradient)
        square = float((place - point[:2]) @ (place - point[:2]) + above * above)
        for _ in range(HALVINGS):
            trial = height_and_slopes(surface, *(place + step))
            off = place + step - point[:2]
            if (
                np.max(np.abs(step)) < SHORT
                or float(off @ off) + (trial[0] - point[2]) ** 2 <= square
            ):
                break
            step = 0.5 * step
        else:
            break
        place = place + step
        height, slope, curvature = trial
        if np.max(np.abs(step)) <= CONVERGED:
            break
    normal = np.array([-slope[0], -slope[1], 1.0]) / math.sqrt(1.0 + float(slope @ slope))
    return np.array([*place, height]), normal


def smooth_distance(surface: Surface, point: Array) -> tuple[float, Array]:
    """Returns the signed distance [m] of a point (3,), positive above, and the unit normal (3,)."""
    foot, normal = nearest_point(surface, point)
    return float(normal @ (point - foot)), normal
