"""Torso, knees and shanks on soft ground: depth at rest, shear, energy, footprints, and the motion
of the dense twin.
"""

from __future__ import annotations

import ctypes as ct
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from grids import Ground, start_on_grid
from mirror import HxInput
from plant import Plant
from states import changed

from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.contact.spheres import body_contacts
from hexapod_cosim.models.dynamics import Command
from hexapod_cosim.models.ground.grid_file import grid_bytes
from hexapod_cosim.models.ground.patches import material_row
from hexapod_cosim.models.ground.surface import Surface
from hexapod_cosim.models.integrator import State, integrate, start_state
from hexapod_cosim.models.kinematics import body_states
from hexapod_cosim.models.records import Array, Foot, Terrain
from hexapod_cosim.models.soil import law
from hexapod_cosim.models.soil.presets import soil_preset

MACRO = 0.005  # s
PLACES = 1e-12  # m, 1: some thousands of roundings
SPEEDS = 1e-9  # m/s, rad/s: the same, over the time of an impact
WEIGHT = 54.936  # N
UPTURNED = np.array([0.0, 1.0, 0.0, 0.0])  # turned by half a turn about x
FOLDED = np.tile([0.0, -0.3, 0.2], (6, 1))  # rad: knees and feet of an upturned robot are high
KNEELING = np.tile([0.0, -0.5, -0.75], (6, 1))  # rad: the knees are the lowest points
PAD = 0.0697868  # m: pi a^2 = 0.17 m x 0.09 m, a quarter of the upper side of the torso's box
KNEE = 0.0105  # m


def on_soil(name: str, **sections: dict[str, Any]) -> Robot:
    robot = changed(load_robot("athena"), body={"contact": "on"}, **sections)
    return replace(robot, soil=soil_preset(name).soil)


def shaped(radius: float, pad: float = 0.0) -> Foot:
    return replace(load_robot("athena").foot, radius=radius, pad_radius=pad)


def dropped(core: ct.CDLL, robot: Robot, angle: Array, height: float, **initial: Any) -> Plant:
    return Plant(core, robot, position=(0.0, 0.0, height), angle=angle, **initial)


def lowered(plant: Plant, angle: Array) -> Any:
    """Holds the joint angles under an upward push that falls from 98 % of the weight to 0; returns
    the output.

    The last 2 % take as long as the rest, because the kink at a ramp's end makes the robot bounce
    on its servos by about 0.4 % of the weight, by which it would sink too far.
    """
    for start, (first, last) in ((0.0, (0.98, 0.02)), (1.2, (0.02, 0.0)), (2.4, (0.0, 0.0))):
        slope = (last - first) / 1.2 * WEIGHT
        rate = Command(angle_ref=0.0 * angle, push_force=np.array([0.0, 0.0, slope]))
        for k in range(240 if first > 0.0 else 100):
            push = np.array([0.0, 0.0, first * WEIGHT + slope * k * MACRO])
            now = Command(angle_ref=angle, push_force=push)
            plant.step_ramp(start + (k + 1) * MACRO, now, rate)
    return plant.output(Command(angle_ref=angle))


def settled(plant: Plant, angle: Array, until: float) -> Any:
    command = Command(angle_ref=angle)
    for k in range(round(plant.time / MACRO), round(until / MACRO)):
        plant.step((k + 1) * MACRO, command)
    return plant.output(command)


def depths(plant: Plant) -> Array:
    """Returns the depths (20,) of corners, knees and shanks [m]."""
    return np.array([c.penetration for c in body_contacts(plant.robot, plant.bodies)])


@pytest.mark.parametrize(
    ("soil", "depth"), [("dry_sand", 1.15128e-3), ("lunar", 1.08441e-3), ("granular", 8.97647e-4)]
)
def test_an_upturned_robot_sinks_to_the_closed_form(core: ct.CDLL, soil: str, depth: float) -> None:
    """Each of four corners bears a quarter of the weight, on a pad of a quarter of the box, with b
    the smaller edge of the box of 0.34 m x 0.18 m.
    """
    robot = changed(on_soil(soil), soil={"damping": 3e4})
    plant = dropped(core, robot, FOLDED, 0.0401, quaternion=UPTURNED)
    output = lowered(plant, FOLDED)
    assert output.torso.contact_force[2] == pytest.approx(WEIGHT, rel=1e-5)
    found = depths(plant)
    assert found[found > 0.0] == pytest.approx(np.full(4, depth), rel=1e-4)


@pytest.mark.parametrize("soil", ["sandy_loam", "lete_sand"])
@pytest.mark.parametrize(
    ("turned", "area", "breadth"),
    [
        ((0.0, 1.0), 0.84 * 0.60 / 4.0, 0.60),
        ((1.0, 0.0), 1.00 * 0.60 / 4.0, 0.60),
        (None, 0.84 * 1.00 / 4.0, 0.84),
    ],
)
def test_a_box_sinks_with_the_area_and_the_smaller_edge_of_the_side_that_touches_down(
    core: ct.CDLL, soil: str, turned: tuple[float, float] | None, area: float, breadth: float
) -> None:
    """A box of 1.0 m x 0.84 m x 0.6 m around the robot falls on each of three sides. As long as its
    corners sink, their forces are those of Bekker's law and of the damping at their own depths.
    """
    robot = on_soil(soil)
    robot = changed(robot, body={"torso_box": (0.5, 0.42, 0.3), "torso_centre": (0.0, 0.0, 0.0)})
    half = math.sqrt(0.5)
    quaternion = UPTURNED if turned is None else np.array([half, *np.multiply(half, turned), 0.0])
    edge = 0.3 if turned is None else 0.5 if turned[1] else 0.42
    plant = dropped(core, robot, FOLDED, edge + 0.0102, quaternion=quaternion)
    bekker = robot.soil.cohesive_modulus / breadth + robot.soil.frictional_modulus
    sinking, deepest, command = 0, np.zeros(8), Command(angle_ref=FOLDED)
    for k in range(600):
        plant.step((k + 1) * 1e-4, command)
        corners = body_contacts(robot, plant.bodies)[:8]
        depth, speed = np.array([(c.penetration, c.approach_speed) for c in corners]).T
        deepest, pressed = np.maximum(deepest, depth), depth > 0.0
        if not pressed.any() or np.any(pressed & ((depth < deepest) | (speed <= 0.0))):
            continue
        sinking += 1
        force = bekker * depth[pressed] ** robot.soil.exponent + robot.soil.damping * speed[pressed]
        found = plant.output(command).torso.contact_force[2]
        assert found == pytest.approx(area * force.sum(), rel=1e-6)
    assert sinking >= 1


def test_a_kneeling_robot_sinks_on_its_knees_as_spheres(core: ct.CDLL) -> None:
    """Clay bears it at less than the knee's radius; each knee's depth is that of its own load."""
    robot = changed(on_soil("clay"), soil={"damping": 3e5})
    plant = dropped(core, robot, KNEELING, 0.0636)
    output = lowered(plant, KNEELING)
    assert output.body.knee_force[:, 2].sum() == pytest.approx(WEIGHT, rel=1e-4)
    for leg in range(6):
        expected = law.sinkage(robot.soil, shaped(KNEE), float(output.body.knee_force[leg, 2]))
        assert depths(plant)[8 + leg] == pytest.approx(expected, rel=2e-4)
        assert expected < KNEE


@pytest.mark.parametrize("soil", ["dry_sand", "granular", "mud"])
def test_the_energy_books_of_a_drop_on_soil_close_with_the_tolerance(
    core: ct.CDLL, soil: str
) -> None:
    residual = {}
    for tolerance in (1e-4, 1e-7):
        robot = changed(on_soil(soil), solver={"tolerance": tolerance})
        plant = dropped(core, robot, FOLDED, 0.06, quaternion=UPTURNED)
        output = settled(plant, FOLDED, 0.3)
        assert output.energy.contact_loss > 0.5
        residual[tolerance] = abs(output.energy.residual) / output.energy.dissipated
    assert residual[1e-4] < 1e-3
    assert residual[1e-7] < 1e-5


def test_a_robot_on_its_back_creeps_down_a_slope_of_sand_as_its_shear_says(core: ct.CDLL) -> None:
    """At rest but for the creep of the regularised law, W sin(a) = T_max tanh(k_t v)."""
    incline = 0.1
    slope = {"kind": "slope", "incline": incline, "heading": 0.0}
    robot = changed(on_soil("dry_sand"), terrain=slope)
    turn = np.array([0.0, math.cos(0.5 * incline), 0.0, math.sin(0.5 * incline)])
    plant = dropped(core, robot, FOLDED, 0.041, quaternion=turn)
    output = settled(plant, FOLDED, 1.5)
    along = np.array([math.cos(incline), 0.0, math.sin(incline)])
    normal = np.array([-math.sin(incline), 0.0, math.cos(incline)])
    force = output.torso.contact_force
    assert force @ normal == pytest.approx(WEIGHT * math.cos(incline), rel=1e-3)
    assert force @ along == pytest.approx(WEIGHT * math.sin(incline), rel=1e-3)
    soil, pad = robot.soil, shaped(0.01, PAD)
    limit = 4.0 * law.shear_limit(soil, pad, 1e-3, 0.25 * float(force @ normal))
    speed = math.atanh(WEIGHT * math.sin(incline) / limit) / robot.friction.slope
    assert -(output.torso.velocity @ along) == pytest.approx(speed, rel=1e-2)


@pytest.mark.parametrize(("soil", "friction"), [("dry_sand", "bristle"), ("granular", "none")])
def test_a_robot_that_lands_on_its_back_in_soil_moves_as_the_twin(
    core: ct.CDLL, soil: str, friction: str
) -> None:
    robot = changed(on_soil(soil), friction={"law": friction})
    turn = np.array([0.05, 1.0, 0.02, 0.03])
    start = (np.array([0.0, 0.0, 0.042]), turn / np.linalg.norm(turn), [0.2, 0.0, -0.8], [0, 0, 0])
    _, state = moved_with_the_twin(core, robot, body_of(robot, start, FOLDED), FOLDED, 0.005)
    assert state.touchdowns >= 2


def test_knees_and_shanks_that_fall_on_patches_of_soil_move_as_the_twins(core: ct.CDLL) -> None:
    """Some land on loam, some on mud, the others on rigid ground."""
    level, material = np.zeros((41, 41)), np.zeros((41, 41), dtype=np.uint8)
    material[20:, :20], material[20:, 20:] = 1, 2
    table = np.array([material_row({"soil": soil}) for soil in ("sandy_loam", "mud")])
    surface = Surface(
        kind="smooth", height=level, x0=-2.0, y0=-2.0, cell=0.1, material=material, materials=table
    )
    robot = changed(load_robot("athena"), body={"contact": "on"})
    robot = replace(robot, terrain=Terrain(kind="grid", surface=surface))
    start = (np.array([0.01, 0.02, 0.0645]), np.eye(4)[0], [0.1, 0.0, -0.8], [0.0, 0.0, 0.0])
    _, state = moved_with_the_twin(core, robot, body_of(robot, start, KNEELING), KNEELING, 0.01)
    assert state.touchdowns >= 6
    knees = [state.contacts.states[k] for k in range(14, 20)]
    assert {held.soil.law for held in knees if not held.is_open} == {"none", "bekker", "mud"}


def test_prints_of_the_torso_are_found_again_and_are_the_twins(core: ct.CDLL) -> None:
    """The robot leaves the sand into which it is pressed, with four prints, and falls into them."""
    robot = on_soil("dry_sand")
    start = (np.array([0.0, 0.0, 0.0389]), UPTURNED, [0.0, 0.0, 0.2], [0.0, 0.0, 0.0])
    plant, state = moved_with_the_twin(core, robot, body_of(robot, start, FOLDED), FOLDED, 0.05)
    prints = state.contacts.footprints
    assert plant.output(Command(angle_ref=FOLDED)).footprints == len(prints) == 4
    assert prints[:, 3] == pytest.approx(np.full(4, PAD), rel=1e-5)
    assert prints[:, 2].min() > 1e-3
    corners = state.contacts.soil_depth[6:14]
    assert np.sort(corners)[-4:].min() >= prints[:, 2].min()
    assert np.count_nonzero(~np.isnan(state.contacts.damping[6:14])) == 4


def body_of(robot: Robot, start: Any, angle: Array) -> Array:
    """Returns bodies (19, 13) at a start: position, quaternion, velocity, angular velocity."""
    position, quaternion, velocity, turn = map(np.asarray, start)
    still = np.zeros((6, 3))
    return body_states(robot, position, quaternion, velocity, turn, angle, still)


def moved_with_the_twin(
    core: ct.CDLL, robot: Robot, body: Array, angle: Array, until: float
) -> tuple[Plant, State]:
    """Steps plant and twin to a time [s], and asserts that they take the same steps."""
    plant, state = Plant(core, changed(robot, terrain={"kind": "flat"})), start_state(robot, body)
    if robot.terrain.surface is not None:
        ground = Ground(core, grid_bytes(robot.terrain.surface))
        start_on_grid(plant, ground, position=(0.0, 0.0, 0.5))
    plant.bodies = body
    command = Command(angle_ref=angle)
    for k in range(round(until / MACRO)):
        plant.step((k + 1) * MACRO, command)
        state = integrate(robot, command, state, (k + 1) * MACRO)
    assert np.abs(plant.bodies[:, :7] - state.body[:, :7]).max() < PLACES
    assert np.abs(plant.bodies[:, 7:] - state.body[:, 7:]).max() < SPEEDS
    counts = (state.evaluations, state.steps, state.rejected, state.touchdowns)
    assert counts == tuple(int(x) for x in vars(plant.output(command).solver).values())
    assert state.contacts.soil_depth[6:].max() > 1e-4
    return plant, state


def test_every_kernel_and_a_restored_plant_have_the_same_bits_with_the_body_in_soil(
    core: ct.CDLL,
) -> None:
    plant = dropped(core, on_soil("dry_sand"), FOLDED, 0.045, quaternion=UPTURNED)
    settled(plant, FOLDED, 0.05)
    command = Command(angle_ref=FOLDED)
    assert plant.output(command).torso.contact_force[2] > 10.0
    seen = plant.rates_of_kernels(command)
    assert all(np.array_equal(rate, seen["baseline"]) for rate in seen.values())
    other = Plant(core, load_robot("phantomx_mk4"))
    other.restore(plant.save())
    for each in (plant, other):
        settled(each, FOLDED, 0.1)
    assert other.save() == plant.save()


@pytest.mark.parametrize("soil", ["dry_sand", "granular"])
def test_derivatives_with_the_body_in_soil_are_those_of_differences(
    core: ct.CDLL, soil: str
) -> None:
    """The robot lies on its back, lifted by 12 N on the line of unloading.

    While a contact sinks, its force has a kink at the present depth; the line is 2 um long.
    """
    start: dict[str, Any] = {"quaternion": UPTURNED, "velocity": (0.2, 0.1, -0.4)}
    plant = dropped(core, on_soil(soil), FOLDED, 0.0401, **start)
    settled(plant, FOLDED, 0.1)
    command = Command(angle_ref=FOLDED, push_force=np.array([0.0, 0.0, 12.0]))
    plant.step(0.11, command)
    x, rng = plant.coordinates, np.random.default_rng(2)
    assert plant.output(command).torso.contact_force[2] > 5.0
    dx = rng.normal(size=x.size)
    dx[3:7] -= (dx[3:7] @ x[3:7]) * x[3:7]
    exact, _ = plant.tangent(command, np.zeros(ct.sizeof(HxInput) // 8), dx)
    difference = plant.rates_between(command, dx, 1e-8)
    assert np.abs(exact - difference).max() < 1e-4 * np.abs(difference).max()
