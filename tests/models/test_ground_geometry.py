"""Tests the geometry of surfaces against closed forms: planes, paraboloids, spheres, blocks."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from hexapod_cosim.models import load_robot
from hexapod_cosim.models.contact.geometry import foot_contacts
from hexapod_cosim.models.ground.faces import ground, ground_height
from hexapod_cosim.models.ground.smooth import height_and_slopes
from hexapod_cosim.models.ground.surface import Surface
from hexapod_cosim.models.ground.table import make_surface
from hexapod_cosim.models.kinematics import body_states
from hexapod_cosim.models.records import Array, Terrain
from hexapod_cosim.models.statics import standing

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
