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
