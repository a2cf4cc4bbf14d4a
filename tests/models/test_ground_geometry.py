"""Tests the geometry of surfaces against closed forms, and the smallest concave
radius of smooth ones.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from hexapod_cosim.models import load_robot
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.contact.geometry import foot_contacts
from hexapod_cosim.models.ground.faces import ground, ground_height
from hexapod_cosim.models.ground.smooth import height_and_slopes
from hexapod_cosim.models.ground.surface import Surface, Terrain
from hexapod_cosim.models.ground.table import make_surface
from hexapod_cosim.models.ground.valleys import Valley, tightest_valley
from hexapod_cosim.models.kinematics import body_states
from hexapod_cosim.models.records import Robot
from hexapod_cosim.models.statics import standing
from hexapod_cosim.models.validation.bodies import check_settings

PLANE = 1e-12  # m
STILL, RAISED = np.zeros(3), np.array([0.0, 0.0, 0.2])


def smooth(function: Callable[[Array, Array], Array], cell: float, half: float) -> Surface:
    """Returns the surface of a function on a square of half an edge `half` [m]."""
    n = round(half / cell)
    x = cell * np.arange(-n, n + 1)
    return Surface(
        kind="smooth", height=function(*np.meshgrid(x, x)), x0=-n * cell, y0=-n * cell, cell=cell
    )


def blocks(rows: list[list[float]], cell: float = 0.1) -> Surface:
    """Returns blocks with the corner of the first one at the origin."""
    return Surface(kind="blocks", height=np.array(rows), x0=0.0, y0=0.0, cell=cell)


def points(seed: int, count: int, half: float, low: float, high: float) -> Array:
    generator = np.random.default_rng(seed)
    return np.column_stack(
        [generator.uniform(-half, half, (count, 2)), generator.uniform(low, high, count)]
    )


def test_a_grid_that_is_a_plane_is_the_slope() -> None:
    incline, heading = 0.2, 0.7
    tangent = math.tan(incline)
    surface = make_surface(
        "plane", {"slope_x": tangent * math.cos(heading), "slope_y": tangent * math.sin(heading)}
    )
    grid = Terrain(kind="grid", height=0.3, surface=surface)
    slope = Terrain(kind="slope", height=0.3, incline=incline, heading=heading)
    for point in points(1, 200, 1.5, -0.1, 0.6):
        distance, normal = ground(grid, point)
        expected, straight = ground(slope, point)
        assert distance == pytest.approx(expected, abs=PLANE)
        assert normal == pytest.approx(straight, abs=PLANE)
        assert ground_height(grid, *point[:2]) == pytest.approx(
            ground_height(slope, *point[:2]), abs=PLANE
        )


def test_the_error_of_a_smooth_surface_falls_with_the_third_power_of_its_cells() -> None:
    def error(cell: float) -> float:
        surface = smooth(lambda x, y: 0.05 * np.sin(7.0 * x) * np.cos(5.0 * y), cell, 0.6)
        places = points(5, 200, 0.4, 0.0, 1.0)
        exact = 0.05 * np.sin(7.0 * places[:, 0]) * np.cos(5.0 * places[:, 1])
        found = [height_and_slopes(surface, x, y)[0] for x, y, _ in places]
        return float(np.max(np.abs(exact - found)))

    assert error(0.02) / error(0.01) == pytest.approx(8.0, rel=0.4)


def test_slopes_and_curvatures_are_the_derivatives_of_the_height() -> None:
    surface, step = make_surface("random_uniform", {"platform_size": 0.0}), 1e-5
    for x, y, _ in points(6, 50, 1.9, 0.0, 1.0):
        _, slope, curvature = height_and_slopes(surface, x, y)
        for axis, way in enumerate(step * np.eye(2)):
            ahead = height_and_slopes(surface, x + way[0], y + way[1])
            behind = height_and_slopes(surface, x - way[0], y - way[1])
            assert (ahead[0] - behind[0]) / (2 * step) == pytest.approx(slope[axis], abs=1e-7)
            assert (ahead[1] - behind[1]) / (2 * step) == pytest.approx(curvature[axis], abs=2e-3)


@pytest.mark.parametrize("name", ["stairs", "random_uniform", "stepping_stones", "dune", "course"])
def test_the_robot_stands_on_the_platform_as_on_level_ground(name: str) -> None:
    robot = load_robot("athena")
    terrain = Terrain(kind="grid", height=0.2, surface=make_surface(name, {}))
    pose, level = standing(replace(robot, terrain=terrain)), standing(robot)
    assert pose.position == pytest.approx(level.position + RAISED, abs=PLANE)
    assert pose.angle == pytest.approx(level.angle, abs=PLANE)


def test_on_uneven_ground_no_foot_begins_deeper_than_on_level_ground() -> None:
    robot = load_robot("athena")
    surface = make_surface("random_uniform", {"platform_size": 0.0, "seed": 5, "max_height": 0.03})
    rough = replace(robot, terrain=Terrain(kind="grid", surface=surface))
    pose, level = standing(rough), standing(robot)
    body = body_states(
        rough, pose.position, pose.quaternion, STILL, STILL, pose.angle, np.zeros((6, 3))
    )
    depth = max(foot.penetration for foot in foot_contacts(rough, body))
    below = level.foot_force[:, 2].max()
    allowed = (below / robot.contact.stiffness) ** (2.0 / 3.0)
    assert 0.0 < depth <= allowed + PLANE


# The smallest concave radius of smooth surfaces against closed forms, and what is refused.

ALL = 100.0  # m    a limit that no valley here reaches
BRUTE = 0.01  # of the radius, of a search with places 1/30 cell apart
SMOOTH = ("dune", "ramp", "random_uniform", "wave")  # with a difficulty


def rough(seed: int, rows: int = 12, columns: int = 9) -> Surface:
    """Returns random heights up to 20 mm at nodes 50 mm apart."""
    height = np.random.default_rng(seed).uniform(0.0, 0.02, (rows, columns))
    return Surface(kind="smooth", height=height, x0=0.3, y0=-0.2, cell=0.05)


def narrowest(surface: Surface, limit: float = ALL) -> Valley:
    """Returns the valley of the smallest radius, which is below the limit."""
    valley = tightest_valley(surface, limit)
    assert valley is not None
    return valley


def standing_on(surface: Surface, name: str = "athena") -> Robot:
    """Returns a robot on a surface, not yet checked."""
    return replace(load_robot(name), terrain=Terrain(kind="grid", surface=surface))


def test_the_radius_of_a_sine_is_that_of_its_trough() -> None:
    """A sine of 20 mm height and 0.4 m length has 1/(A k^2) = 202.642 mm; the error falls with the
    square of the cell.
    """

    def sine(cell: float) -> Valley:
        return narrowest(
            smooth(lambda x, y: 0.02 * np.sin(2.0 * math.pi / 0.4 * x) + 0.0 * y, cell, 1.0)
        )

    coarse, fine = sine(0.01), sine(0.005)
    assert fine.radius == pytest.approx(0.202642, rel=5e-3)
    assert 0.2 <= abs(fine.radius - 0.202642) / abs(coarse.radius - 0.202642) <= 0.3
    assert fine.x % 0.4 == pytest.approx(0.3, abs=0.0051)  # a cell


def test_the_radius_of_a_turned_paraboloid_is_that_at_its_bottom() -> None:
    """Curvatures of 1/50 mm and 1/80 mm, in axes that are turned by 0.6 rad."""
    cos, sin = math.cos(0.6), math.sin(0.6)

    def bowl(x: Array, y: Array) -> Array:
        return np.asarray((cos * x + sin * y) ** 2 / 0.1 + (cos * y - sin * x) ** 2 / 0.16)

    valley = narrowest(smooth(bowl, 0.01, 0.25))
    assert valley.radius == pytest.approx(0.05, rel=1e-9)
    assert (valley.x, valley.y) == pytest.approx((0.0, 0.0), abs=1e-9)


def test_hills_planes_and_blocks_have_no_valley() -> None:
    dome = smooth(lambda x, y: -(x * x + y * y) / 0.02, 0.01, 0.1)
    plane = smooth(lambda x, y: 0.3 * x - 0.2 * y, 0.05, 1.0)
    assert tightest_valley(dome, 0.02) is None  # its hill has a radius of 10 mm
    assert tightest_valley(plane, 1e6) is None
    assert tightest_valley(make_surface("stairs", {}), ALL) is None


def brute_radius(surface: Surface) -> float:
    """Returns the smallest radius [m] by eigenvalues of the shape operator at 31 x 31 places inside
    each cell, 1e-9 cells off its borders.
    """
    largest, t = 0.0, np.linspace(1e-9, 1.0 - 1e-9, 31)
    for row, column, u, v in product(range(surface.rows - 1), range(surface.columns - 1), t, t):
        x, y = surface.x0 + surface.cell * (column + v), surface.y0 + surface.cell * (row + u)
        _, slope, hessian = height_and_slopes(surface, x, y)
        first = np.eye(2) + np.outer(slope, slope)
        shape = np.linalg.solve(first, hessian) / math.sqrt(1.0 + float(slope @ slope))
        largest = max(largest, float(np.linalg.eigvals(shape).real.max()))
    return 1.0 / largest


@pytest.mark.parametrize("seed", range(1))
def test_the_radius_is_that_of_a_search_of_all_places(seed: int) -> None:
    surface = rough(seed, 6, 5)
    assert narrowest(surface).radius == pytest.approx(brute_radius(surface), rel=BRUTE)


@pytest.mark.parametrize("robot", ["athena", "phantomx_mk4"])
@pytest.mark.parametrize("name", SMOOTH)
def test_a_smooth_surface_of_the_catalogue_is_accepted_at_every_difficulty(
    robot: str, name: str
) -> None:
    for difficulty in (0.0, 0.2, 1.0):
        check_settings(standing_on(make_surface(name, {"difficulty": difficulty}), robot))
