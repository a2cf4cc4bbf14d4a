"""Tests torso, knees and shanks on rigid and soft ground: rest, energy, symmetry, depth, shear,
footprints, and the motion of the twin.
"""

from __future__ import annotations

import ctypes as ct
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from grids import Ground, start_on_grid
from mirror import LEGS
from plant import Plant
from states import changed

from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.contact.spheres import body_contacts
from hexapod_cosim.models.dynamics import Command
from hexapod_cosim.models.ground.grid_file import grid_bytes
from hexapod_cosim.models.integrator import State, integrate, start_state
from hexapod_cosim.models.kinematics import body_states
from hexapod_cosim.models.records import Array
from hexapod_cosim.models.soil.presets import soil_preset

MACRO = 0.005  # s
PLACES = 1e-12  # m, 1: some thousands of roundings
SPEEDS = 1e-9  # m/s, rad/s: the same, over the time of an impact
UPTURNED = np.array([0.0, 1.0, 0.0, 0.0])  # turned by half a turn about x
FOLDED = np.tile([0.0, -0.3, 0.2], (6, 1))  # rad: knees and feet of an upturned robot are high
PAD = 0.0697868  # m: pi a^2 = 0.17 m x 0.09 m, a quarter of the upper side of the torso's box


def on_soil(name: str, **sections: dict[str, Any]) -> Robot:
    robot = changed(load_robot("athena"), body={"contact": "on"}, **sections)
    return replace(robot, soil=soil_preset(name).soil)


def dropped(core: ct.CDLL, robot: Robot, angle: Array, height: float, **initial: Any) -> Plant:
    """Returns a plant with these joint angles, its torso at a height [m]."""
    return Plant(core, robot, position=(0.0, 0.0, height), angle=angle, **initial)


def depths(plant: Plant) -> Array:
    """Returns the depths (20,) of corners, knees and shanks [m]."""
    return np.array([c.penetration for c in body_contacts(plant.robot, plant.bodies)])


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


@pytest.mark.parametrize(("soil", "friction"), [("dry_sand", "bristle"), ("granular", "none")])
def test_a_robot_that_lands_on_its_back_in_soil_moves_as_the_twin(
    core: ct.CDLL, soil: str, friction: str
) -> None:
    robot = changed(on_soil(soil), friction={"law": friction})
    turn = np.array([0.05, 1.0, 0.02, 0.03])
    start = (np.array([0.0, 0.0, 0.042]), turn / np.linalg.norm(turn), [0.2, 0.0, -0.8], [0, 0, 0])
    _, state = moved_with_the_twin(core, robot, body_of(robot, start, FOLDED), FOLDED, 0.005)
    assert state.touchdowns >= 2


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


# Tests laws of a robot whose torso, knees and shanks touch the ground: rest, energy, symmetry, and
# the same bits by all kernels and after a restore.

REST = 1e-6  # relative: what is left of the motion after settling
ON = {"contact": "on"}
FOLDED_LEGS = np.tile(
    [0.0, -0.3, 0.2], (LEGS, 1)
)  # rad: knees and feet of an upturned robot are high
KNEELING = np.tile([0.0, -0.5, -0.75], (LEGS, 1))  # rad: the knees are the lowest points


def athena(**sections: dict[str, Any]) -> Robot:
    return changed(load_robot("athena"), **{"body": ON} | sections)


def settle(plant: Plant, angle: Array, seconds: float) -> Any:
    """Holds the joint angles for a time [s]; returns the output."""
    command = Command(angle_ref=angle)
    for k in range(round(seconds / MACRO)):
        plant.step((k + 1) * MACRO, command)
    return plant.output(command)


def static_depth(robot: Robot, force: Any) -> Array:
    """Returns the depth [m] at which the normal law bears a force [N]."""
    depth: Array = (np.asarray(force) / robot.contact.stiffness) ** (2.0 / 3.0)
    return depth


def test_an_upturned_robot_comes_to_rest_on_the_corners_of_its_torso(core: ct.CDLL) -> None:
    robot = athena()
    plant = dropped(core, robot, FOLDED_LEGS, 0.06, quaternion=UPTURNED)
    output = settle(plant, FOLDED_LEGS, 3.0)
    assert output.torso.contact_force[2] == pytest.approx(54.936, rel=REST)
    assert np.abs(output.torso.contact_force[:2]).max() < 1e-6 * 54.936
    assert output.foot.normal_force.sum() == 0.0
    assert output.body.knee_force.max() == output.body.shank_force.max() == 0.0
    depth = np.array([contact.penetration for contact in body_contacts(robot, plant.bodies)])
    resting = depth[depth > 0.0]
    assert resting == pytest.approx(static_depth(robot, np.full(4, 54.936 / 4.0)), rel=1e-5)
    assert output.torso.position[2] == pytest.approx(0.04 - resting[0], abs=1e-9)


@pytest.mark.parametrize("body", [ON, ON | {"shank_radius": 0.0}], ids=["shanks", "knees alone"])
def test_a_kneeling_robot_rests_on_its_knees(core: ct.CDLL, body: dict[str, Any]) -> None:
    robot = athena(body=body)
    plant = dropped(core, robot, KNEELING, 0.07)
    output = settle(plant, KNEELING, 3.0)
    assert output.body.knee_force[:, 2].sum() == pytest.approx(54.936, rel=REST)
    assert output.body.knee_force[:, 2].min() > 5.0
    assert output.foot.normal_force.sum() == 0.0
    assert np.all(output.torso.contact_force == 0.0)
    depth = np.array([contact.penetration for contact in body_contacts(robot, plant.bodies)])
    allowed = static_depth(robot, output.body.knee_force[:, 2].max())
    assert depth.max() <= allowed * (1.0 + 1e-5)


@pytest.mark.parametrize("angle", [FOLDED_LEGS, KNEELING])
def test_the_energy_books_of_a_drop_close_with_the_tolerance(core: ct.CDLL, angle: Array) -> None:
    """The residual is the error of the integrator, so it falls with the tolerance."""
    start = {"quaternion": UPTURNED} if angle is FOLDED_LEGS else {}
    residual = {}
    for tolerance in (1e-4, 1e-7):
        robot = athena(solver={"tolerance": tolerance})
        output = settle(dropped(core, robot, angle, 0.1, **start), angle, 0.3)
        assert output.energy.dissipated > 0.5
        residual[tolerance] = abs(output.energy.residual) / output.energy.dissipated
    assert residual[1e-4] < 1e-2
    assert residual[1e-7] < 1e-5


def test_every_kernel_gives_the_same_rates_with_the_body_in_the_ground(core: ct.CDLL) -> None:
    plant = dropped(core, athena(), FOLDED_LEGS, 0.039, quaternion=UPTURNED)
    command = Command(angle_ref=FOLDED_LEGS)
    seen = plant.rates_of_kernels(command)
    assert plant.output(command).torso.contact_force[2] > 10.0
    assert all(np.array_equal(rate, seen["baseline"]) for rate in seen.values())
