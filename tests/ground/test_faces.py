"""Distance and normal of a grid's surface against closed forms."""

from __future__ import annotations

import ctypes as ct

import numpy as np
import pytest
from grids import BLOCKS, CORNER, NEAREST, SIDE, SMOOTH, TOP, WALL, Ground, grid_bytes, sampled
from plant import probed

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.ground.smooth import height_and_slopes, smooth_distance
from hexapod_cosim.models.ground.surface import Surface

RHO = 0.3  # m, radius of the sphere that bump and bowl belong to


def points(n: int, seed: int) -> Array:
    """Returns points around the origin (n, 3): x, y within 60 mm, z from 0 to 30 mm."""
    rng = np.random.default_rng(seed)
    return rng.uniform([-0.06, -0.06, 0.0], [0.06, 0.06, 0.03], (n, 3))


def test_a_grid_that_is_a_plane_has_the_plane_s_distance_and_normal(core: ct.CDLL) -> None:
    ground = Ground(core, sampled(lambda x, y: 0.3 * x - 0.2 * y + 0.05, size=2.0, cell=0.05))
    up = np.array([-0.3, 0.2, 1.0]) / np.sqrt(1.13)
    rng = np.random.default_rng(1)
    for point in rng.uniform([-0.98, -0.98, -0.5], [0.98, 0.98, 0.5], (300, 3)):
        distance, normal, bend = ground.face(point)
        assert distance == pytest.approx(up @ (point - [0.0, 0.0, 0.05]), abs=1e-12)
        assert np.abs(normal - up).max() < 1e-12
        assert np.abs(bend).max() < 1e-9


@pytest.mark.parametrize("side", [1.0, -1.0], ids=["bump", "bowl"])
def test_bump_and_bowl_have_a_sphere_s_distance(core: ct.CDLL, side: float) -> None:
    ground = Ground(
        core,
        sampled(lambda x, y: side * (np.sqrt(RHO**2 - x**2 - y**2) - RHO), size=0.2, cell=5e-4),
    )
    for above in points(200, seed=2):
        rise = side * (np.sqrt(RHO**2 - above[0] ** 2 - above[1] ** 2) - RHO)
        arm = above + np.array([0.0, 0.0, rise + side * RHO])
        distance, normal, bend = ground.face(above + np.array([0.0, 0.0, rise]))
        length = np.linalg.norm(arm)
        assert distance == pytest.approx(side * (length - RHO), abs=1e-9)
        assert np.abs(normal - side * arm / length).max() < 5e-6  # slopes err by h^2 s'''/6
        expected = side * (np.eye(3) - np.outer(arm, arm) / length**2) / length
        assert np.abs(bend - expected).max() < 0.02  # second derivatives of a cubic's cells


def test_the_normal_is_the_distance_s_gradient_and_its_bend_the_next(core: ct.CDLL) -> None:
    rng = np.random.default_rng(3)
    ground = Ground(core, grid_bytes(rng.uniform(0.0, 0.02, (60, 60)), cell=0.05))
    h = 1e-6
    for point in rng.uniform([0.5, 0.5, 0.02], [2.2, 2.2, 0.04], (200, 3)):
        _, normal, bend = ground.face(point)
        sides = [(ground.face(point + h * e), ground.face(point - h * e)) for e in np.eye(3)]
        gradient = np.array([(a[0] - b[0]) / (2 * h) for a, b in sides])
        turn = np.array([(a[1] - b[1]) / (2 * h) for a, b in sides])
        assert np.abs(gradient - normal).max() < 1e-7
        assert np.abs(turn - bend).max() < 1e-3
        assert np.abs(bend @ normal).max() < 1e-7  # the last step of Newton's method


def test_distance_and_normal_are_continuous_over_1000_borders_of_cells(core: ct.CDLL) -> None:
    rng = np.random.default_rng(4)
    ground = Ground(core, grid_bytes(rng.uniform(0.0, 0.01, (60, 60)), cell=0.05))
    nm = np.array([1e-9, 0.0, 0.0])
    for _ in range(1000):
        point = np.array([0.05 * rng.integers(5, 55), rng.uniform(0.3, 2.7), 0.025])
        before, after = ground.face(point - nm), ground.face(point + nm)
        assert abs(after[0] - before[0]) < 3e-9  # the slope times 2 nm
        assert np.abs(after[1] - before[1]).max() < 1e-6


@pytest.mark.parametrize("kind", [SMOOTH, BLOCKS], ids=["smooth", "blocks"])
@pytest.mark.parametrize("cell", [0.05, 0.004], ids=["50 mm", "4 mm"])
def test_no_sphere_is_deeper_than_its_bound(core: ct.CDLL, kind: int, cell: float) -> None:
    rng = np.random.default_rng(11)
    height = cell * (rng.uniform(-0.03, 0.03, (50, 40)) + np.linspace(0.0, 4.0, 40))
    ground, radius = Ground(core, grid_bytes(height, cell=cell, kind=kind)), 0.015
    for place in rng.uniform([-4.0, -4.0, -0.6], [44.0, 54.0, 6.0], (3000, 3)):  # cells
        rise = np.array([0.0, 0.0, 4.0 * np.clip(place[0] / 39.0, 0.0, 1.0)])
        centre = cell * (place + rise)
        distance, _, _ = ground.face(centre)
        assert ground.depth_bound(centre, radius) >= radius - distance


def test_distance_and_normal_at_the_edge_of_a_map_are_the_twin_s(core: ct.CDLL) -> None:
    rng = np.random.default_rng(13)
    height, cell, first = rng.uniform(0.0, 0.02, (12, 9)), 0.05, np.array([0.4, 0.55])
    surface = Surface(kind="smooth", height=height, x0=0.0, y0=0.0, cell=cell)
    ground = Ground(core, grid_bytes(height, cell=cell))
    for edge in (np.zeros(2), first, np.array([0.0, 0.55])):
        for away in rng.uniform(-0.1, 0.1, (40, 2)):
            above = height_and_slopes(surface, *(edge + away))[0] + rng.uniform(0.005, 0.015)
            point = np.array([*(edge + away), above])
            distance, normal, _ = ground.face(point)
            expected, up = smooth_distance(surface, point)
            assert distance == pytest.approx(expected, abs=1e-12)
            assert normal == pytest.approx(up, abs=1e-9)


def step(core: ct.CDLL) -> Ground:
    """Returns two blocks: height 0 for x < 0 and 0.1 m for x > 0."""
    height = np.array([[0.0, 0.1]])
    return Ground(core, grid_bytes(height, cell=1.0, origin=(-1.0, -0.5), kind=BLOCKS))


@pytest.mark.parametrize(
    ("point", "kind", "distance", "normal"),
    [
        ([-0.03, 0.1, 0.05], TOP, 0.05, [0.0, 0.0, 1.0]),
        ([-0.03, 0.1, 0.05], WALL, 0.03, [-1.0, 0.0, 0.0]),
        ([-0.03, 0.1, 0.14], WALL, 0.05, [-0.6, 0.0, 0.8]),
        ([-0.03, 0.1, 0.14], NEAREST, 0.05, [-0.6, 0.0, 0.8]),
        ([0.03, 0.1, 0.14], TOP, 0.04, [0.0, 0.0, 1.0]),
        ([0.03, 0.1, 0.14], WALL, 1000.0, [0.0, 0.0, 1.0]),
    ],
)
def test_a_step_has_a_top_a_wall_and_an_edge(
    core: ct.CDLL, point: list[float], kind: int, distance: float, normal: list[float]
) -> None:
    got = step(core).face(point, kind)
    assert got[0] == pytest.approx(distance, abs=1e-9)
    assert got[1] == pytest.approx(normal, abs=1e-9)


def test_a_concave_corner_touches_two_walls_and_a_convex_one_its_edge(core: ct.CDLL) -> None:
    height = np.array([[0.0, 0.1], [0.1, 0.1]])
    concave = Ground(core, grid_bytes(height, cell=1.0, origin=(-1.0, -1.0), kind=BLOCKS))
    place = [-0.03, -0.04, 0.05]
    assert concave.face(place, WALL)[0] == pytest.approx(0.03, abs=1e-12)
    assert concave.face(place, SIDE)[0] == pytest.approx(0.04, abs=1e-12)
    # the edge is behind the walls: it has no share in the force
    assert concave.face(place, CORNER)[0] == pytest.approx(0.05, abs=1e-12)
    height = np.array([[0.0, 0.0], [0.0, 0.1]])
    convex = Ground(core, grid_bytes(height, cell=1.0, origin=(-1.0, -1.0), kind=BLOCKS))
    distance, normal, _ = convex.face(place, CORNER)
    assert distance == pytest.approx(0.05, abs=1e-12)
    assert normal == pytest.approx([-0.6, -0.8, 0.0], abs=1e-12)
    distance, normal, _ = convex.face([-0.02, -0.03, 0.16], CORNER)
    assert distance == pytest.approx(0.07, abs=1e-12)
    assert normal == pytest.approx([-2 / 7, -3 / 7, 6 / 7], abs=1e-12)


PLAIN = grid_bytes(np.zeros((3, 4)), cell=0.1)
BAD = {
    "not begin with hxGrid01": b"hxGrid02" + PLAIN[8:],
    "at least the 128 bytes": b"hxGrid01",
    "cut off or damaged": PLAIN[:-1],
    r"height\[1\]\[2\]: got nan": grid_bytes(
        np.where(np.arange(12).reshape(3, 4) == 6, np.nan, 0.0), cell=0.1
    ),
    r"height\[0\]\[0\]: got 20000": grid_bytes(np.full((2, 2), 2e4), cell=0.1),
    "rows: got 1, expected 2": grid_bytes(np.zeros((1, 4)), cell=0.1),
    "cell: got 0": grid_bytes(np.zeros((3, 4)), cell=0.0),
    "cell: got nan": grid_bytes(np.zeros((3, 4)), cell=np.nan),
    "kind: got 3": grid_bytes(np.zeros((3, 4)), cell=0.1, kind=3),
    "mu: got -1": grid_bytes(
        np.zeros((2, 2)), cell=0.1, material=np.ones((2, 2)), table=np.full((1, 16), -1.0)
    ),
    "material: got 2": grid_bytes(
        np.zeros((2, 2)), cell=0.1, material=np.full((2, 2), 2), table=np.zeros((1, 16))
    ),
}


@pytest.mark.parametrize("message", BAD)
def test_a_bad_grid_is_refused_by_name(core: ct.CDLL, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Ground(core, BAD[message])


def after_a_search(ground: Ground, first: Array, second: Array) -> Array:
    """Returns distance [m] and normal at the second point (3, 4): after a search at the first one,
    after one whose patch was forgotten, and without one.
    """
    handle, find = ct.c_void_p(ground.handle), ground.core.hx_probe_kept_patch
    found = probed(find, handle, first, second, size=13)
    assert found[12] == 1.0
    return found[:12].reshape(3, 4)


def rough_ground(core: ct.CDLL) -> tuple[Ground, Array]:
    """Returns heights up to 20 mm at nodes every 50 mm, and points above them (300, 3) [m]."""
    rng = np.random.default_rng(8)
    ground = Ground(core, grid_bytes(rng.uniform(0.0, 0.02, (60, 60)), cell=0.05))
    return ground, rng.uniform([0.5, 0.5, 0.02], [2.2, 2.2, 0.04], (300, 3))


def test_a_kept_patch_finds_the_nearest_point_within_its_expansion_s_error(core: ct.CDLL) -> None:
    """Both searches end with a move of d = 3e-4 cells = 16 um at most, by an expansion without the
    third derivatives, s = 12 (20 mm) / (50 mm)^3 at most. By their Taylor terms a slope errs by
    s (|dx| + |dy|)^2/2 = s d^2, the distance by s (|dx| + |dy|)^3/6 = 0.5 s d^3. Twice that is
    1e-6 and 8e-12 m.
    """
    ground, above = rough_ground(core)
    moves, uses = np.random.default_rng(9).uniform(-5e-6, 5e-6, above.shape), 0
    for point, move in zip(above, moves, strict=True):
        kept, forgotten, without = after_a_search(ground, point, point + move)
        assert np.array_equal(forgotten, without)
        assert kept[0] == pytest.approx(without[0], abs=8e-12)
        assert np.abs(kept[1:] - without[1:]).max() < 1e-6
        uses += not np.array_equal(kept, without)
    assert uses > 250


def test_a_kept_patch_is_not_used_farther_than_its_expansion_is_exact(core: ct.CDLL) -> None:
    ground, above = rough_ground(core)
    moves = np.random.default_rng(10).choice([-1e-3, 1e-3], above.shape)
    for point, move in zip(above, moves, strict=True):
        kept, _forgotten, without = after_a_search(ground, point, point + move)
        assert np.array_equal(kept, without)
