"""Laws on every surface of the catalogue: energy books, touch-downs on the ground, and the same
bits by another instance, after a restore and by every kernel.
"""

from __future__ import annotations

import ctypes as ct
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from grids import Ground, start_on_grid
from plant import Plant, PlantError
from states import changed
from test_grid_motion import march, marching

from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.contact.forces import contacts_at, open_contacts
from hexapod_cosim.models.contact.geometry import FootContact
from hexapod_cosim.models.ground.grid_file import grid_bytes
from hexapod_cosim.models.ground.surface import Surface, Terrain
from hexapod_cosim.models.ground.table import CATALOGUE, make_surface
from hexapod_cosim.models.kinematics import body_states
from hexapod_cosim.models.soil.presets import soil_preset

BOOKS = 1e-4  # of the motors' gross work, at the default tolerance of 1e-4
LANDED = 1.0001e-10  # m: depth to which a touch-down is located, and rounding
PLACE = (0.45, 0.3)  # m: off the platform around the origin
PLANES: dict[str, dict[str, Any]] = {
    "flat": {"kind": "flat"},
    "slope": {"kind": "slope", "incline": 0.1, "heading": 0.7},
}
KINDS = [*PLANES, *CATALOGUE]
BLOCKS = ["stairs", "rubble", "stepping_stones"]


@cache
def surface(kind: str) -> Surface:
    """Returns a surface by its defaults, `heightfield` from a random map."""
    if kind != "heightfield":
        return make_surface(kind, {})
    with TemporaryDirectory() as folder:
        file = Path(folder) / "map.npy"
        np.save(file, np.random.default_rng(0).uniform(0.0, 0.02, (60, 60)))
        return make_surface(kind, {"file": str(file), "horizontal_scale": 0.05})


def robot_on(kind: str, **sections: dict[str, Any]) -> Robot:
    pad = {"pad_radius": 0.025} if kind == "sand" else {}
    robot = changed(load_robot("athena"), foot=pad, **sections)
    if kind in PLANES:
        return changed(robot, terrain=PLANES[kind])
    return replace(robot, terrain=Terrain(kind="grid", surface=surface(kind)))


def depths(robot: Robot, body: Array) -> list[FootContact]:
    return contacts_at(robot, body, open_contacts(robot))


def above_ground(robot: Robot) -> Array:
    """Returns the robot in its stance at PLACE, its lowest part some mm above the ground."""
    still = np.zeros(3)
    body = body_states(
        robot, np.array([*PLACE, 0.5]), np.eye(4)[0], still, still, robot.stance, np.zeros((6, 3))
    )
    for _ in range(2):  # the nearest part may be another one from nearby
        body[:, 2] += max(contact.penetration for contact in depths(robot, body)) + 2e-3
    return body


def put(core: ct.CDLL, robot: Robot, ground: Ground | None) -> Plant:
    """Returns a plant on its ground, which the caller keeps."""
    plant = Plant(core, changed(robot, terrain={"kind": "flat"} if ground else {}))
    if ground:
        start_on_grid(plant, ground, position=(0.0, 0.0, 0.5))
    plant.bodies = above_ground(robot)
    return plant


def ground_of(core: ct.CDLL, kind: str) -> Ground | None:
    return None if kind in PLANES else Ground(core, grid_bytes(surface(kind)))


@pytest.mark.parametrize(
    ("kind", "law"),
    [*((kind, "bristle") for kind in KINDS), *((kind, "tanh") for kind in ("slope", *BLOCKS[:2]))],
)
def test_the_energy_books_of_two_seconds_of_stepping_close(
    core: ct.CDLL, kind: str, law: str
) -> None:
    ground = ground_of(core, kind)
    plant = put(core, robot_on(kind, friction={"law": law}), ground)
    march(plant, 2.0)
    output = plant.output()
    gross = output.positive_work.sum() + output.negative_work.sum()
    assert output.energy.dissipated > 5.0
    assert abs(output.energy.residual) < BOOKS * gross


@pytest.mark.parametrize("kind", KINDS)
def test_a_step_ends_on_each_touch_down(core: ct.CDLL, kind: str) -> None:
    """At the events of a walk the foot that has just touched down is at most 0.1 nm deep, in soil
    below the bottom of its footprint.
    """
    ground, robot = ground_of(core, kind), robot_on(kind)
    plant = put(core, robot, ground)
    landed, before = [], np.zeros(6, dtype=bool)
    for k in range(50):
        while plant.time < (k + 1) / 50:
            plant.step_to_event((k + 1) / 50, marching(robot, k / 50))
            foot = plant.output().foot
            now = np.array(foot.contact) != 0
            depth = np.array(foot.penetration) - np.array(foot.sinkage)
            landed += [float(depth[leg]) for leg in np.flatnonzero(now & ~before)]
            before = now
    assert len(landed) >= 6
    assert max(landed) < LANDED


@pytest.mark.parametrize("kind", KINDS)
def test_two_instances_and_a_restored_one_move_by_the_same_bits(core: ct.CDLL, kind: str) -> None:
    ground, robot = ground_of(core, kind), robot_on(kind)
    one, two, third = (put(core, robot, ground) for _ in range(3))
    for plant in (one, two):  # by turns: an instance knows nothing of another
        march(plant, 0.3)
    saved = one.save()
    march(one, 0.7)
    march(two, 0.7)
    assert one.save() == two.save()
    third.restore(saved)
    march(third, 0.7)
    assert third.save() == one.save()


def saved_by_kernels(core: ct.CDLL, robot: Robot, kind: str) -> dict[str, bytes]:
    """Returns the saved states after 3 s of stepping, by the names of all kernels of the build that
    run on this machine.
    """
    choose, found = core.hx_probe_choose_kernel, {}
    choose.restype = ct.c_char_p
    ground = ground_of(core, kind)
    try:
        for place in range(8):
            name = choose(place)
            if name:
                plant = put(core, robot, ground)
                march(plant, 3.0)
                found[name.decode()] = plant.save()
    finally:
        choose(0)
    return found


def assert_same(saved: dict[str, bytes]) -> None:
    """Asserts that all kernels have the bytes of the baseline."""
    for name, state in saved.items():
        assert state == saved["baseline"], name


@pytest.mark.parametrize(
    ("kind", "method"),
    [*((kind, "rosw3") for kind in KINDS), *((kind, "ros2") for kind in ("flat", *BLOCKS[:2]))],
)
def test_every_kernel_walks_by_the_same_bits(core: ct.CDLL, kind: str, method: str) -> None:
    """Slots past the last leg are in packs of their own with some kernels only: they count in the
    error of a step, so that their contacts must be those of leg 0.
    """
    assert_same(saved_by_kernels(core, robot_on(kind, solver={"method": method}), kind))


def test_soil_on_blocks_is_refused_by_the_plant(core: ct.CDLL) -> None:
    soft = replace(robot_on("stairs"), soil=soil_preset("dry_sand").soil)
    with pytest.raises(PlantError, match="soil on blocks"):
        put(core, soft, ground_of(core, "stairs"))
