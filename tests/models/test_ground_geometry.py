"""Tests the geometry of surfaces against closed forms: planes, paraboloids, spheres, blocks."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from hexapod_cosim.models import load_robot
from hexapod_cosim.models.contact.forces import contacts_at, open_contacts
from hexapod_cosim.models.contact.geometry import foot_contacts
from hexapod_cosim.models.ground.blocks import block_faces
from hexapod_cosim.models.ground.catalogue import make_surface
from hexapod_cosim.models.ground.faces import ground, ground_faces, ground_height
from hexapod_cosim.models.ground.smooth import (
    height_and_slopes,
    heights_at,
    nearest_point,
    smooth_distance,
)
from hexapod_cosim.models.ground.surface import Surface
from hexapod_cosim.models.kinematics import body_states, foot_centres
from hexapod_cosim.models.records import Array, Terrain
from hexapod_cosim.models.statics import standing

PLANE = 1e-12  # m
CLOSED_FORM = 1e-9  # m
JUMP = 1e-6  # of the force over 2 nm; the slope of the ground alone makes a part of it
RADIUS = 0.015  # m    of a foot
NORMAL = 3e-6  # error h^2 f'''/6 of a slope by central differences over h = 1 mm
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
        "plane",
        {"slope_x": tangent * math.cos(heading), "slope_y": tangent * math.sin(heading)},
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


def test_a_paraboloid_is_exact_within_its_border_cells() -> None:
    a, surface = 3.0, smooth(lambda x, y: 3.0 * (x * x + y * y), 0.05, 0.5)
    for x, y, _ in points(2, 100, 0.4, 0.0, 1.0):
        height, slope, curvature = height_and_slopes(surface, x, y)
        assert height == pytest.approx(a * (x * x + y * y), abs=PLANE)
        assert slope == pytest.approx([2 * a * x, 2 * a * y], abs=PLANE)
        assert curvature == pytest.approx(2 * a * np.eye(2), abs=1e-10)


def test_the_nearest_point_of_a_paraboloid_solves_its_cubic() -> None:
    a, surface = 3.0, smooth(lambda x, y: 3.0 * (x * x + y * y), 0.05, 0.5)
    for x, y, above in points(3, 100, 0.25, -0.08, 0.08):
        r = math.hypot(x, y)
        z = a * r * r + above
        # 2 a^2 p^3 + (1 - 2 a z) p - r = 0 for the radius p of the nearest point
        roots = np.roots([2.0 * a * a, 0.0, 1.0 - 2.0 * a * z, -r])
        real = roots[np.abs(roots.imag) < 1e-9].real
        distances = np.hypot(real - r, a * real**2 - z)
        expected = math.copysign(float(distances.min()), above)
        assert smooth_distance(surface, np.array([x, y, z]))[0] == pytest.approx(
            expected, abs=CLOSED_FORM
        )


@pytest.mark.parametrize("sign", [1.0, -1.0], ids=["bump", "bowl"])
def test_a_bump_and_a_bowl_are_spheres(sign: float) -> None:
    rho, cell = 0.25, 1e-3

    def sphere(x: Array, y: Array) -> Array:
        return np.asarray(sign * (np.sqrt(rho * rho - x * x - y * y) - rho))

    surface, centre = smooth(sphere, cell, 0.12), np.array([0.0, 0.0, -sign * rho])
    for x, y, depth in points(4, 50, 0.05, 0.0, 1e-3):
        z = float(sphere(np.array(x), np.array(y))) + 0.8 * RADIUS - depth
        point = np.array([x, y, z])
        away = float(np.linalg.norm(point - centre))
        distance, normal = smooth_distance(surface, point)
        assert distance == pytest.approx(sign * (away - rho), abs=CLOSED_FORM)
        assert normal == pytest.approx(sign * (point - centre) / away, abs=NORMAL)


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


def test_the_nearest_point_lies_along_the_normal() -> None:
    surface = make_surface("random_uniform", {"platform_size": 0.0, "max_height": 0.02})
    for x, y, above in points(7, 200, 1.8, 0.0, RADIUS):
        point = np.array([x, y, height_and_slopes(surface, x, y)[0] + above])
        foot, normal = nearest_point(surface, point)
        assert np.cross(point - foot, normal) == pytest.approx(np.zeros(3), abs=1e-14)
        assert foot[2] == pytest.approx(height_and_slopes(surface, foot[0], foot[1])[0], abs=1e-15)


def test_the_force_has_no_jump_at_1000_cell_borders() -> None:
    surface = make_surface("random_uniform", {"platform_size": 0.0, "seed": 3})
    nanometre, generator = 1e-9, np.random.default_rng(8)
    for _ in range(1000):
        border = surface.x0 + surface.cell * int(generator.integers(1, surface.columns - 1))
        y = float(generator.uniform(-1.9, 1.9))
        z = height_and_slopes(surface, border, y)[0] + RADIUS - 1e-3
        forces = []
        for x in (border - nanometre, border + nanometre):
            distance, normal = smooth_distance(surface, np.array([x, y, z]))
            forces.append(max(RADIUS - distance, 0.0) ** 1.5 * normal)
        change = float(np.linalg.norm(forces[1] - forces[0]))
        assert change <= JUMP * float(np.linalg.norm(forces[0]))


def test_beyond_the_map_the_slope_runs_out_and_the_border_goes_on() -> None:
    surface = make_surface("random_uniform", {"platform_size": 0.0})
    left, right, low, high = surface.extent
    inside, slope, _ = height_and_slopes(surface, right, 0.33)
    for way, share in ((0.03, 7.0 / 24.0), (0.06, 1.0 / 3.0), (5.0, 1.0 / 3.0)):
        height = height_and_slopes(surface, right + way, 0.33)[0]
        assert height == pytest.approx(inside + 0.06 * share * slope[0], abs=PLANE)
    corner, slope, curvature = height_and_slopes(surface, left, low)
    expected = corner - 0.02 * (slope[0] + slope[1]) + 0.02**2 * curvature[0, 1]
    assert height_and_slopes(surface, left - 5.0, low - 2.0)[0] == pytest.approx(
        expected, abs=PLANE
    )
    assert heights_at(surface, np.array([left - 5.0]), np.array([low - 2.0]))[0, 0] == (
        pytest.approx(expected, abs=PLANE)
    )
    assert not np.any(height_and_slopes(surface, right + 5.0, high + 2.0)[1])
    block = blocks([[0.0, 0.05], [0.1, 0.02]])
    assert block_faces(block, np.array([5.0, 0.05, 0.06]))[0][0] == pytest.approx(0.01)


def test_the_force_has_no_jump_at_the_map_s_edge() -> None:
    surface = make_surface("plane", {"slope_x": 0.3, "slope_y": -0.2})
    left, right, low, high = surface.extent
    rng, nanometre = np.random.default_rng(9), 1e-9
    for _ in range(50):
        x, y = rng.uniform(left, right), rng.uniform(low, high)
        for place, way in (((right, y), 0), ((left, y), 0), ((x, high), 1), ((x, low), 1)):
            height, slope, _ = height_and_slopes(surface, *place)
            normal = np.array([-slope[0], -slope[1], 1.0]) / math.sqrt(1.0 + slope @ slope)
            centre = np.array([*place, height]) + (RADIUS - 2e-3) * normal
            forces = []
            for side in (-nanometre, nanometre):
                point = centre + side * np.eye(3)[way]
                distance, up = smooth_distance(surface, point)
                forces.append(max(RADIUS - distance, 0.0) ** 1.5 * up)
            change = float(np.linalg.norm(forces[1] - forces[0]))
            assert change <= JUMP * float(np.linalg.norm(forces[0]))


def test_above_a_flat_block_there_is_one_face() -> None:
    surface = blocks([[0.02, 0.02, 0.02]] * 3)
    for x, y in ((0.1, 0.1), (0.15, 0.2), (0.2, 0.2), (0.17, 0.11)):
        faces = block_faces(surface, np.array([x, y, 0.03]))
        assert len(faces) == 1
        assert faces[0][0] == pytest.approx(0.01, abs=PLANE)
        assert faces[0][1].tolist() == [0.0, 0.0, 1.0]


def test_a_wall_pushes_sideways_and_the_floor_upwards() -> None:
    surface = blocks([[0.0, 0.1]])
    floor, wall = block_faces(surface, np.array([0.09, 0.05, 0.012]))
    assert [floor[0], wall[0]] == pytest.approx([0.012, 0.01], abs=PLANE)
    assert [floor[1].tolist(), wall[1].tolist()] == [[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]]


def test_a_nose_is_a_line_and_a_corner_a_point() -> None:
    surface = blocks([[0.0, 0.1], [0.0, 0.0]])
    point = np.array([0.094, 0.05, 0.108])
    _, nose = block_faces(surface, point)
    assert nose[0] == pytest.approx(0.01, abs=PLANE)
    assert nose[1] == pytest.approx([-0.6, 0.0, 0.8], abs=PLANE)
    corner = block_faces(surface, np.array([0.098, 0.103, 0.106]))[1]
    assert corner[0] == pytest.approx(0.007, abs=PLANE)  # sqrt(2^2 + 3^2 + 6^2) mm
    assert corner[1] == pytest.approx(np.array([-2.0, 3.0, 6.0]) / 7.0, abs=PLANE)


def test_a_corner_behind_a_wall_is_hidden() -> None:
    surface = blocks([[0.0, 0.1], [0.1, 0.1]])
    _, wall = block_faces(surface, np.array([0.09, 0.095, 0.05]))
    assert wall[1] == pytest.approx([0.0, -1.0, 0.0])
    assert wall[0] == pytest.approx(0.005)


def test_a_contact_is_handed_over_at_a_nose_without_a_jump() -> None:
    surface = blocks([[0.0, 0.1]])
    nanometre = 1e-9
    before = block_faces(surface, np.array([0.1 - nanometre, 0.05, 0.11]))
    behind = block_faces(surface, np.array([0.1 + nanometre, 0.05, 0.11]))
    assert len(before) == 2
    assert len(behind) == 1
    assert before[1][0] == pytest.approx(behind[0][0], abs=1e-12)
    assert before[1][1] == pytest.approx(behind[0][1], abs=1e-6)


def test_a_foot_beside_a_step_has_two_contacts() -> None:
    robot = load_robot("athena")
    pose = standing(robot)
    body = body_states(
        robot,
        pose.position,
        pose.quaternion,
        STILL,
        STILL,
        pose.angle,
        np.zeros((6, 3)),
    )
    front = float(foot_centres(robot, body)[0, 0])
    step = Surface(kind="blocks", height=[[0.0, 0.04]], x0=front + 0.01 - 1.0, y0=-1.0, cell=1.0)  # type: ignore[arg-type]
    robot = replace(robot, terrain=Terrain(kind="grid", surface=step))
    contacts = contacts_at(robot, body, open_contacts(robot))
    floor, walls = contacts[0], contacts[6:12]
    wall = walls[0]
    assert wall.penetration == pytest.approx(0.005, abs=PLANE)
    assert wall.normal.tolist() == [-1.0, 0.0, 0.0]
    assert floor.penetration == pytest.approx(
        foot_contacts(load_robot("athena"), body)[0].penetration
    )
    touching = [wall.penetration > 0.0 for wall in walls]
    assert touching == [True, False, False] * 2


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
        rough,
        pose.position,
        pose.quaternion,
        STILL,
        STILL,
        pose.angle,
        np.zeros((6, 3)),
    )
    depth = max(foot.penetration for foot in foot_contacts(rough, body))
    below = level.foot_force[:, 2].max()
    allowed = (below / robot.contact.stiffness) ** (2.0 / 3.0)
    assert 0.0 < depth <= allowed + PLANE


def test_a_plane_has_one_face() -> None:
    assert len(ground_faces(Terrain(kind="flat"), np.array([0.0, 0.0, 0.1]))) == 1
