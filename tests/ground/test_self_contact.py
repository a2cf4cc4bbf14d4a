"""Tests contacts between neighbouring legs: C plant against the dense twin, conservation of
momentum, closed forms of a rebound, energy, bits, and what is refused.
"""

from __future__ import annotations

import ctypes as ct
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mirror import LEGS
from plant import Plant, PlantError
from states import changed, distance, lopsided, random_command

from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.constraints import constraints
from hexapod_cosim.models.contact.bodies import clearances, leg_pairs, pair_contacts, standing_pairs
from hexapod_cosim.models.contact.forces import open_contacts, pair_wrenches
from hexapod_cosim.models.dynamics import (
    Command,
    accelerations,
    mass_matrix,
    masses,
    world_inertias,
)
from hexapod_cosim.models.integrator import integrate
from hexapod_cosim.models.kinematics import body_states
from hexapod_cosim.models.step import start_state

DENSE = 1e-10  # relative: the error of the dense solution, whose condition number is about 1e6
FORCES = 1e-12  # relative: rounding of forces
PLACES, SPEEDS = 1e-13, 1e-10  # as in test_twin_motion
FREE: dict[str, Any] = {
    "body": {"contact": "off", "self_contact": "force"},
    "servo": {"mode": "torque", "coulomb_friction": 0.0},
}
HELD = np.zeros(3)


def floating(robot: Robot, **sections: dict[str, Any]) -> Robot:
    """Returns a robot without gravity whose joints are free and whose legs touch each other."""
    return changed(replace(robot, gravity=(0.0, 0.0, 0.0)), **(FREE | sections))


def athena(**sections: dict[str, Any]) -> Robot:
    return floating(load_robot("athena"), **sections)


def posed(robot: Robot, turn: float, speed: float) -> Array:
    """Returns bodies (19, 13) whose legs LF and LM are turned towards each other by an angle [rad]
    and approach at a joint speed [rad/s]; no two lines are parallel.
    """
    angle, speeds = np.array(robot.stance), np.zeros((LEGS, 3))
    angle[1] += [0.0, 0.15, -0.1]
    angle[0, 0], angle[1, 0] = turn, -turn
    speeds[0, 0], speeds[1, 0] = speed, -speed
    still = {"velocity": HELD, "angular_velocity": HELD, "quaternion": np.array([1.0, 0, 0, 0])}
    position = np.array([0.0, 0.0, 1.0])
    return body_states(robot, position=position, angle=angle, speed=speeds, **still)


def clasped(robot: Robot, gap: float, speed: float) -> Array:
    """Returns these bodies with a gap [m] between the legs, < 0: an overlap."""
    low, high = 0.3, 0.6
    for _ in range(60):
        middle = 0.5 * (low + high)
        apart = clearances(robot, posed(robot, middle, 0.0)).min() > gap
        low, high = (middle, high) if apart else (low, middle)
    return posed(robot, low, speed)


def at(core: ct.CDLL, robot: Robot, body: Array) -> Plant:
    plant = Plant(core, robot)
    plant.bodies = body
    return plant


def free(robot: Robot) -> Command:
    return Command(angle_ref=np.array(robot.stance))


@pytest.mark.parametrize("friction", ["tanh", "none", "bristle"])
@pytest.mark.parametrize("seed", [1, 2])
def test_accelerations_with_legs_in_contact_are_those_of_the_dense_system(
    core: ct.CDLL, friction: str, seed: int
) -> None:
    robot = changed(
        floating(lopsided(seed), friction={"law": friction}),
        body={"knee_radius": 0.012, "shank_radius": 0.02},
    )
    body, command = clasped(robot, -3e-4, 0.8), random_command(robot, seed)
    plant = at(core, robot, body)
    dense = accelerations(robot, body, command, np.full(LEGS, np.nan))
    ours = plant.accelerations(command)
    assert distance(ours.dv, dense.dv) < DENSE
    assert distance(ours.multipliers, dense.multipliers) < DENSE
    assert np.abs(plant.output(command).body.neighbour_force).max() > 10.0


def test_the_output_is_the_force_of_the_twin(core: ct.CDLL) -> None:
    robot = athena(friction={"mu": 0.7})
    body = clasped(robot, -3e-4, 0.8)
    contacts = replace(open_contacts(robot), pairs=standing_pairs(robot, body))
    force = pair_wrenches(robot, body, contacts)[1:, 0:3].reshape(LEGS, 3, 3).sum(axis=1)
    ours = at(core, robot, body).output().body.neighbour_force
    assert np.abs(force).max() > 100.0
    assert distance(ours, force) < FORCES
    assert np.all(ours[2:] == 0.0)


def test_forces_between_legs_change_no_momentum(core: ct.CDLL) -> None:
    """The rates of momentum follow from accelerations alone: force and counterforce cancel."""
    robot = floating(lopsided(1), friction={"mu": 0.7})
    radii = {"knee_radius": 0.012, "shank_radius": 0.02}
    robot = changed(robot, body=radii, servo={"rotor_inertia": 0.0})
    body = clasped(robot, -3e-4, 0.8)
    plant = at(core, robot, body)
    dv, w = plant.accelerations(free(robot)).dv, body[:, 10:13]
    force = masses(robot)[:, None] * dv[:, 0:3]
    J = world_inertias(robot, body)
    spin = np.einsum("kij,kj->ki", J, dv[:, 3:6]) + np.cross(w, np.einsum("kij,kj->ki", J, w))
    moment = np.cross(body[:, 0:3], force) + spin
    pressed = np.abs(plant.output().body.neighbour_force).max()
    assert pressed > 100.0
    assert np.abs(force.sum(axis=0)).max() < FORCES * np.abs(force).max()
    assert np.abs(moment.sum(axis=0)).max() < FORCES * np.abs(force).max()


# a rebound

STIFF: dict[str, Any] = {"stiffness": 1e12, "restitution": 0.5}
IMPACT = 2e-3  # relative: what the legs turn during the impact changes its direction and mass


@pytest.fixture(scope="module")
def rebound(core: ct.CDLL) -> Callable[..., tuple[Robot, Array, Plant]]:
    """Returns a robot, its bodies 10 um before two legs meet without friction, and its plant."""

    def prepared(**contact: Any) -> tuple[Robot, Array, Plant]:
        robot = athena(
            contact=STIFF | contact,
            friction={"law": "none"},
            solver={"tolerance": 1e-7},
            servo=FREE["servo"] | {"stop_stiffness": 0.0},
        )
        body = clasped(robot, 1e-5, 1.5)
        return robot, body, at(core, robot, body)

    return prepared


def collision(robot: Robot, body: Array) -> tuple[float, float, Array]:
    """Returns approach speed [m/s] and effective mass [kg] of the nearest pair, and the change of
    all velocities (19, 6) by a unit impulse.
    """
    found = pair_contacts(robot, body)
    k = int(np.argmax([contact.penetration for contact in found]))
    pair, contact = leg_pairs(robot)[k], found[k]
    pull = np.zeros((19, 6))
    for number, sign in ((pair.body, 1.0), (pair.other_body, -1.0)):
        arm = contact.point - body[number, 0:3]
        pull[number] = sign * np.concatenate([contact.normal, np.cross(arm, contact.normal)])
    joints = constraints(robot, body)
    D = joints.D
    system = np.block([[mass_matrix(robot, body, joints), D.T], [D, np.zeros((90, 90))]])
    moved = np.linalg.solve(system, np.concatenate([pull.ravel(), np.zeros(90)]))[:114]
    return contact.approach_speed, 1.0 / float(pull.ravel() @ moved), moved.reshape(19, 6)


Rebound = Callable[..., tuple[Robot, Array, Plant]]


def test_two_legs_rebound_with_the_restitution_of_the_law(core: ct.CDLL, rebound: Rebound) -> None:
    """After the impact all bodies move as the closed form says: impulse (1 + e) m v."""
    robot, body, plant = rebound()
    speed, mass, moved = collision(robot, body)
    flying = at(core, changed(robot, body={"self_contact": "off"}), body)
    for one in (plant, flying):
        one.step(1e-5 / speed + 1e-4, free(robot))
    assert plant.output().solver.touchdowns == 1.0
    assert plant.output().body.clearance.min() > 0.0 > flying.output().body.clearance.min()
    change = plant.bodies[:, 7:13] - flying.bodies[:, 7:13]
    expected = 1.5 * mass * speed * moved
    assert np.abs(expected).max() > 1.0
    assert np.abs(change - expected).max() < IMPACT * np.abs(expected).max()
    assert collision(robot, plant.bodies)[0] == pytest.approx(-0.5 * speed, rel=IMPACT)


@pytest.mark.parametrize("law", ["none", "tanh"])
def test_the_energy_books_of_colliding_legs_close_with_the_tolerance(
    core: ct.CDLL, law: str
) -> None:
    residual = {}
    for tolerance in (1e-4, 1e-7):
        robot = athena(solver={"tolerance": tolerance}, friction={"law": law, "mu": 0.8})
        plant = at(core, robot, clasped(robot, 1e-3, 1.5))
        plant.step(0.02, free(robot))
        energy = plant.output().energy
        assert energy.contact_loss > 1e-3
        assert (energy.friction_loss > 1e-5) == (law == "tanh")
        residual[tolerance] = abs(energy.residual) / energy.dissipated
    assert residual[1e-4] < 1e-2
    assert residual[1e-7] < 1e-5


# steps


def test_colliding_legs_move_as_the_twins(core: ct.CDLL) -> None:
    robot = athena(friction={"mu": 0.8})
    body, command = clasped(robot, 1e-4, 1.5), free(robot)
    state, plant = start_state(robot, body), at(core, robot, body)
    for t in (4e-4, 8e-4):
        plant.step(t, command)
        state = integrate(robot, command, state, t)
    output = plant.output()
    assert output.solver.touchdowns == state.touchdowns >= 1
    assert output.solver.steps == state.steps
    assert np.abs(plant.bodies[:, :7] - state.body[:, :7]).max() < PLACES
    assert np.abs(plant.bodies[:, 7:] - state.body[:, 7:]).max() < SPEEDS


def test_every_kernel_gives_the_same_rates_with_legs_in_contact(core: ct.CDLL) -> None:
    robot = athena()
    plant = at(core, robot, clasped(robot, -1e-4, 0.5))
    seen = plant.rates_of_kernels(free(robot))
    assert np.abs(plant.output().body.neighbour_force).max() > 10.0
    assert all(np.array_equal(rate, seen["baseline"]) for rate in seen.values())


# refused


def test_forces_between_legs_without_a_radius_are_refused(core: ct.CDLL) -> None:
    lines = {"self_contact": "force", "knee_radius": 0.0, "shank_radius": 0.0, "contact": "off"}
    robot = athena(body=lines)
    with pytest.raises(PlantError, match=r"body\.knee_radius: got 0, expected a radius > 0"):
        Plant(core, robot)


def test_a_start_with_legs_deep_in_each_other_is_refused(core: ct.CDLL) -> None:
    robot = athena()
    angle = np.array(robot.stance)
    angle[0, 0], angle[1, 0] = 0.8, -0.8
    with pytest.raises(PlantError, match=r"initial\.LF: got its .* inside the .* of leg LM"):
        Plant(core, robot, angle=angle)
    Plant(core, athena(body={"self_contact": "warn"}), angle=angle)
