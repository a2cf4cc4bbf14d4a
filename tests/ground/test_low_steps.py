"""The force on a foot over steps and corners of blocks of any height."""

from __future__ import annotations

import ctypes as ct

import numpy as np
import pytest
from grids import BLOCKS, CORNER, SIDE, TOP, WALL, Ground, grid_bytes
from plant import probed

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.contact.geometry import contact_shares
from hexapod_cosim.models.ground.blocks import FACES, block_face, cell_at
from hexapod_cosim.models.ground.surface import Surface

RADIUS = 0.015  # m  of the foot
CELL = 0.05  # m
JUMP = 1e-6  # of the largest force along a line, over 2e-13 m
SAMPLES = 24  # of the force along a line, before its largest change is bisected
KINDS = (TOP, WALL, SIDE, CORNER)


class Blocks:
    """Three by three blocks, and the force of a foot without friction on them."""

    def __init__(self, core: ct.CDLL, height: Array) -> None:
        self.core, self.height = core, height
        self.ground = Ground(core, grid_bytes(height, cell=CELL, kind=BLOCKS))

    def faces(self, place: Array) -> tuple[Array, Array]:
        """Returns depths (n,) and normals (n, 3) of the faces that a foot touches."""
        found = [self.ground.face(place, kind) for kind in KINDS]
        near = [(RADIUS - face[0], face[1]) for face in found if face[0] < RADIUS]
        return np.array([depth for depth, _ in near]), np.array([normal for _, normal in near])

    def shares(self, depth: Array, normal: Array) -> Array:
        """Returns the plant's shares (n,)."""
        return np.array(
            probed(
                self.core.hx_probe_shares,
                ct.c_int(len(depth)),
                depth,
                np.ascontiguousarray(normal),
                RADIUS,
                size=len(depth),
            )
        )

    def force(self, place: Array) -> Array:
        """Returns the force (3,) over the contact's stiffness [m^1.5]."""
        depth, normal = self.faces(place)
        if not len(depth):
            return np.zeros(3)
        return np.asarray((self.shares(depth, normal) * depth**1.5) @ normal)


def any_heights(rng: np.random.Generator) -> Array:
    """Returns heights (3, 3) of which about half are 0 and the others 1 nm to 40 mm; in a third of
    the cases they are multiples of 5 mm, so that walls of one height meet, too.
    """
    height = 10.0 ** rng.uniform(-9.0, np.log10(0.04), (3, 3)) * rng.integers(0, 2, (3, 3))
    return np.asarray(np.round(height * 200.0) / 200.0 if rng.random() < 0.3 else height)


def any_line(rng: np.random.Generator, height: Array) -> Array:
    """Returns places (SAMPLES, 3) along a line near the corner of four blocks, at which a foot is
    10 um to 4 mm deep in one of them.
    """
    middle = CELL + rng.normal(size=2) * 10.0 ** rng.uniform(-6.0, -2.0)
    depth = 10.0 ** rng.uniform(-5.0, np.log10(0.004))
    level = rng.choice(height[:2, :2].ravel()) + RADIUS - depth
    way = rng.normal(size=3) * np.array([1.0, 1.0, rng.integers(0, 2)])
    length = 10.0 ** rng.uniform(-6.0, -2.0)
    along = np.linspace(-length, length, SAMPLES)[:, None]
    return np.asarray([*middle, level] + along * way / np.linalg.norm(way))


def largest_jump(blocks: Blocks, places: Array) -> float:
    """Returns the change of the force where it changes most, bisected to 2e-13 m, of the force."""
    forces = np.array([blocks.force(place) for place in places])
    k = int(np.argmax(np.linalg.norm(np.diff(forces, axis=0), axis=1)))
    low, high, below, above = places[k], places[k + 1], forces[k], forces[k + 1]
    while np.linalg.norm(high - low) > 2e-13:
        middle = 0.5 * (low + high)
        force = blocks.force(middle)
        if np.linalg.norm(force - below) > np.linalg.norm(force - above):
            high, above = middle, force
        else:
            low, below = middle, force
    return float(np.linalg.norm(above - below) / np.linalg.norm(forces, axis=1).max())


def test_the_force_has_no_jump_over_steps_of_1_nm_to_40_mm(core: ct.CDLL) -> None:
    rng, lines, worst = np.random.default_rng(1), 0, 0.0
    while lines < 250:
        blocks = Blocks(core, any_heights(rng))
        places = any_line(rng, blocks.height)
        depths = [blocks.faces(place)[0].max(initial=0.0) for place in places]
        if not 0.0 < max(depths) <= 0.5 * RADIUS:
            continue
        worst, lines = max(worst, largest_jump(blocks, places)), lines + 1
    assert worst <= JUMP


def test_a_step_whose_height_goes_to_0_carries_as_the_plane(core: ct.CDLL) -> None:
    rng, plane = np.random.default_rng(2), Blocks(core, np.zeros((3, 3)))
    for height in (1e-9, 1e-11, 1e-13):
        low = Blocks(core, height * rng.integers(0, 2, (3, 3)).astype(float))
        for _ in range(100):
            away = 10.0 ** rng.uniform(-9.0, -1.7, 2) * rng.choice([-1.0, 1.0], 2)
            place = np.array([*(CELL + away), RADIUS - 1e-3])
            expected = plane.force(place)
            error = np.linalg.norm(low.force(place) - expected) / np.linalg.norm(expected)
            # the normal turns by sqrt(h/R) at most, the depth grows by h
            assert error < 2.0 * np.sqrt(height / RADIUS) + 3.0 * height / 1e-3


def test_two_contacts_share_by_the_solution_of_two_equations() -> None:
    depth, normal = np.array([1e-3, 1.2e-3]), np.array([[0.0, 0.0, 1.0], [0.28, 0.0, 0.96]])
    # rho^2 = 25 * 1.2/12.6 = 2.380952, |n - n'|^2 = 0.08, r = 0.18330303
    overlap = 0.96 * (1.0 - 0.183303028) ** 4 * (4.0 * 0.183303028 + 1.0)
    first = (1e-3 - overlap * 1.2e-3) / (1.0 - overlap**2)
    second = (1.2e-3 - overlap * 1e-3) / (1.0 - overlap**2)
    shares = contact_shares(depth, normal, RADIUS)
    assert shares == pytest.approx([first / 1e-3, second / 1.2e-3], rel=1e-7)
    assert shares == pytest.approx([0.24714, 0.84755], abs=1e-5)


def test_the_plant_and_the_twin_share_alike(core: ct.CDLL) -> None:
    rng, shared = np.random.default_rng(4), 0
    while shared < 100:
        blocks = Blocks(core, any_heights(rng))
        place = any_line(rng, blocks.height)[0]
        depth, normal = blocks.faces(place)
        if len(depth) < 2 or depth.max() > 0.5 * RADIUS:
            continue
        surface = Surface(kind="blocks", height=blocks.height, x0=0.0, y0=0.0, cell=CELL)
        cell = cell_at(surface, float(place[0]), float(place[1]))
        twin = [block_face(surface, place, kind, cell) for kind in FACES]
        near = [face for face in twin if face is not None and face[0] < RADIUS]
        assert [RADIUS - face[0] for face in near] == pytest.approx(depth, abs=1e-15)
        expected = contact_shares(depth, normal, RADIUS)
        assert blocks.shares(depth, normal) == pytest.approx(expected, abs=1e-7)
        shared += int(0.0 < expected.min() < 1.0)
