"""Tests the whole plant on soft ground: sinkage at rest, footprints that stay, forces of the laws,
energy balance, and the same bits after a restore.
"""

from __future__ import annotations

import ctypes as ct
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from grids import Ground, grid_bytes, on_grid
from plant import Plant, PlantError, pointer
from states import changed

from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.dynamics import Command
from hexapod_cosim.models.soil import law
from hexapod_cosim.models.soil.presets import soil_preset
from hexapod_cosim.models.statics import standing

REST = 1e-9  # relative: forces of the law at the plant's own depths
SINKING = 1e-4  # relative: what is left to sink after three seconds
BALANCE = 1e-3  # of the work of the motors at the default tolerance of 1e-4, as on rigid ground
STEP = 0.005  # s


def on_soil(name: str, pad: float = 0.025, **sections: dict[str, Any]) -> Robot:
    robot = changed(load_robot("athena"), foot={"pad_radius": pad}, **sections)
    return replace(robot, soil=soil_preset(name).soil)


def placed(core: ct.CDLL, robot: Robot, height: float) -> Plant:
    """Returns the robot at rest in its standing pose, raised by a height [m]."""
    pose = standing(robot)
    return Plant(
        core,
        robot,
        position=np.add(pose.position, (0.0, 0.0, height)),
        quaternion=pose.quaternion,
        angle=pose.angle,
    )


def push(robot: Robot, share: float) -> Command:
    """Returns the stance with an upward push by a share of the weight."""
    return Command(angle_ref=robot.stance, push_force=np.array([0.0, 0.0, share * robot.weight]))


def pushed(plant: Plant, until: float, start: float, end: float) -> None:
    """Steps with an upward push that changes linearly between shares of the weight."""
    robot, t0 = plant.robot, plant.time
    slope = (end - start) / (until - t0)
    rate = replace(push(robot, slope), angle_ref=np.zeros((6, 3)))
    for k in range(1, round((until - t0) / STEP) + 1):
        begin = start + slope * (plant.time - t0)
        plant.step_ramp(t0 + k * STEP, push(robot, begin), rate)


def walk(plant: Plant, duration: float) -> None:
    """Steps through a stepping motion: legs swing and rise in two groups."""
    robot, t0 = plant.robot, plant.time
    group, side = np.arange(6) % 2, np.array([1.0, 1.0, 1.0, -1.0, -1.0, -1.0])
    for k in range(round(duration / STEP)):
        phase = 2.0 * np.pi * (t0 + k * STEP) + np.pi * group
        angle = robot.stance.copy()
        angle[:, 0] += 0.2 * np.cos(phase) * side
        angle[:, 1] += 0.35 * np.maximum(np.sin(phase), 0.0)
        plant.step(t0 + (k + 1) * STEP, Command(angle_ref=angle))


def footprints(plant: Plant) -> Array:
    """Returns x, y, depth and radius (n, 4) of the plant's footprints."""
    plant.core.hx_plant_footprints.restype = ct.c_size_t
    plant.core.hx_plant_footprints.argtypes = None  # type: ignore[assignment]
    found = np.zeros((2048, 4))
    size = ct.c_size_t(len(found))
    number = plant.core.hx_plant_footprints(ct.c_void_p(plant.handle), pointer(found), size)
    return found[:number]


@pytest.mark.parametrize(
    ("name", "pad"),
    [
        ("dry_sand", 0.025),
        ("dry_sand", 0.0),
        ("lunar", 0.04),
        ("granular", 0.025),
        ("rubicon_sandy_loam", 0.015),
        ("mud", 0.01),
    ],
)
def test_a_robot_that_is_put_down_gently_sinks_to_the_closed_form(
    core: ct.CDLL, name: str, pad: float
) -> None:
    """More damping than soil has keeps the robot from sinking further by its inertia."""
    robot = changed(on_soil(name, pad), soil={"damping": 3e5})
    plant = placed(core, robot, 0.0004)
    pushed(plant, 2.0, 0.98, 0.0)
    pushed(plant, 5.0, 0.0, 0.0)
    out = plant.output()
    assert out.foot.normal_force.sum() == pytest.approx(robot.weight, rel=1e-6)
    for leg in range(6):
        force, z = out.foot.normal_force[leg], out.foot.penetration[leg]
        assert z == pytest.approx(law.sinkage(robot.soil, robot.foot, force), rel=SINKING)
        plastic, sinking = out.foot.sinkage[leg], -out.foot.velocity[leg][2]
        expected = law.soil_normal_force(robot.soil, robot.foot, plastic, z, sinking)
        assert force == pytest.approx(expected, rel=REST)


@pytest.mark.parametrize("name", ["dry_sand", "clay", "lunar", "poppy_seed_close", "mud"])
def test_the_energy_balance_of_a_walk_on_soil_holds(core: ct.CDLL, name: str) -> None:
    residuals = []
    for tolerance in (1e-4, 1e-6):
        robot = on_soil(name, solver={"tolerance": tolerance})
        plant = placed(core, robot, 0.002)
        walk(plant, 1.0)
        energy = plant.output().energy
        work = plant.output().positive_work.sum() + plant.output().negative_work.sum()
        residuals.append(abs(energy.residual) / work)
        assert energy.contact_loss > 0.0
        assert energy.friction_loss > 0.0
    assert residuals[0] < BALANCE
    # of order 2 in the step, which falls with the third root of the tolerance
    assert residuals[1] < 0.2 * residuals[0]


def test_a_restored_state_goes_on_with_the_same_bits_and_footprints(core: ct.CDLL) -> None:
    robot = on_soil("dry_sand")
    first, second = placed(core, robot, 0.005), placed(core, robot, 0.1)
    walk(first, 1.2)
    assert first.output().footprints > 0.0
    second.restore(first.save())
    assert second.save() == first.save()
    assert np.array_equal(footprints(second), footprints(first))
    for plant in (first, second):
        walk(plant, 0.8)
    assert second.save() == first.save()
    assert len(footprints(first)) > 6


def test_a_damaged_footprint_is_refused(core: ct.CDLL) -> None:
    robot = on_soil("dry_sand")
    plant = placed(core, robot, 0.005)
    walk(plant, 1.2)
    saved = plant.save()
    depth = footprints(plant)[0, 2]
    place = saved.rindex(np.float64(depth).tobytes())
    with pytest.raises(PlantError, match="damaged"):
        plant.restore(saved[:place] + np.float64(2.0 * depth).tobytes() + saved[place + 8 :])
    assert plant.save() == saved


def test_a_call_that_fails_takes_back_its_footprints(core: ct.CDLL) -> None:
    robot = on_soil("dry_sand", servo={"mode": "kinematic"})
    plant = placed(core, robot, 0.0004)
    pushed(plant, 1.0, 0.9, 0.0)
    before = plant.save()
    up = push(robot, 1.5)
    fling = replace(up, push_force=np.array([0.0, 0.0, 1e12]), angle_ref=np.zeros((6, 3)))
    with pytest.raises(PlantError):
        plant.step_ramp(2.0, up, fling)
    assert plant.save() == before
    assert len(footprints(plant)) == 0


def test_the_ring_forgets_the_oldest_footprints_and_takes_back_those_of_a_call(
    core: ct.CDLL,
) -> None:
    """The probe adds 1500 footprints at x = 0, 1, 2, ..., of depth 1, 2, 3, ... [mm], begins a call
    that adds 100 more at the first places, and takes these back.
    """
    depth = np.zeros((3, 4))
    core.hx_probe_footprints(pointer(depth))
    # at x = 0, 987, 988 and 1499: before the call, in it, and after it was taken back
    assert depth[0] == pytest.approx([0.0, 0.0, 0.989, 1.5])
    assert depth[1] == pytest.approx([2.0, 0.0, 0.0, 1.5])
    assert depth[2] == pytest.approx([0.0, 0.0, 0.989, 1.5])


def test_soil_on_a_slope_creeps_less_than_it_shears(core: ct.CDLL) -> None:
    """On a slope below the friction angle the shear force at rest is the weight's along it, at
    b/K = tan(alpha)/(tan(phi) + A c/F_n) of the shear curve.
    """
    robot = on_soil("dry_sand", terrain={"kind": "slope", "incline": 0.2})
    plant = Plant(core, robot, position=(0.0, 0.0, 0.16))
    for k in range(1, 1001):
        plant.step(k * STEP)
    out = plant.output()
    assert out.foot.force.sum(axis=0) == pytest.approx([0.0, 0.0, robot.weight], abs=1e-3)
    assert np.max(np.linalg.norm(out.foot.bristle, axis=1)) < robot.soil.shear_displacement


def test_a_soil_of_a_grids_table_is_the_same_as_that_of_the_definition(core: ct.CDLL) -> None:
    """A level grid whose material is dry sand, and a definition of rigid ground."""
    soil, rigid = on_soil("dry_sand"), changed(load_robot("athena"), foot={"pad_radius": 0.025})
    row = np.concatenate([[np.nan] * 3, law.table_row(soil.soil)])
    flat, soft = np.zeros((5, 5)), np.ones((5, 5))
    file = grid_bytes(flat, cell=1.0, origin=(-2.0, -2.0), material=soft, table=row[None])
    ground = Ground(core, file)
    pose = standing(soil)
    start: dict[str, Any] = {
        "position": np.add(pose.position, (0.0, 0.0, 0.002)),
        "quaternion": pose.quaternion,
        "angle": pose.angle,
    }
    plane, grid = Plant(core, soil, **start), on_grid(core, rigid, ground, **start)
    for plant in (plane, grid):
        walk(plant, 0.5)
    here, there = plane.output(), grid.output()
    assert here.footprints == there.footprints
    assert there.torso.position == pytest.approx(here.torso.position, abs=1e-9)
    assert there.foot.sinkage == pytest.approx(here.foot.sinkage, abs=1e-9)
    assert np.max(there.foot.sinkage) > 0.001


def test_a_foot_may_start_deeper_than_its_radius_in_soil_and_not_in_rigid_ground(
    core: ct.CDLL,
) -> None:
    soft = on_soil("dry_sand", 0.0)
    pose = standing(soft)
    start: dict[str, Any] = {"quaternion": pose.quaternion, "angle": pose.angle}
    deep = np.subtract(pose.position, (0.0, 0.0, 0.02))
    out = Plant(core, soft, position=deep, **start).output()
    assert np.all(out.foot.penetration > soft.foot.radius)
    for leg in range(6):
        force = law.virgin_force(soft.soil, soft.foot, out.foot.penetration[leg])
        assert out.foot.normal_force[leg] == pytest.approx(force, rel=REST)
    rigid = replace(soft, soil=load_robot("athena").soil)
    with pytest.raises(PlantError, match="deep in the ground"):
        Plant(core, rigid, position=np.subtract(standing(rigid).position, (0, 0, 0.02)), **start)
