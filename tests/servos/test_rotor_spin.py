"""Angular momentum of spinning rotors: a free robot keeps its momentum and energy, and the links
obey the Newton-Euler equations with rotors as bodies of their own.
"""

from __future__ import annotations

import ctypes as ct
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from plant import Plant
from states import changed, distance, lopsided, random_bodies, random_command
from test_laws_servo import WEIGHTLESS
from test_measured_servos import with_servo

from hexapod_cosim.models import Robot
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.contact.geometry import standing_damping
from hexapod_cosim.models.dynamics import Command, accelerations, joint_torques, world_inertias
from hexapod_cosim.models.energy import kinetic_energy, momentum
from hexapod_cosim.models.integrator import end_step
from hexapod_cosim.models.kinematics import joint_models, joint_speeds, rotation_matrix
from hexapod_cosim.models.step import Start, start_state, try_step

RATIO = -40.0  # few turns, so that the effect is large
SAME = 1e-9  # relative, of sums over bodies, and of the sweeps and the dense system
TWIN = 1e-11  # relative, of steps
HIGH = 10.0  # m


def floating(**servo: Any) -> Robot:
    """Returns a robot far from the ground and without gravity whose rotors spin."""
    robot = changed(
        lopsided(7),
        servo={"gear_ratio": RATIO, "rotor_inertia": 0.004} | servo,
        solver={"method": "dp54", "tolerance": 1e-11, "step_max": 1.0},
        terrain={"height": -HIGH},
    )
    return replace(robot, gravity=WEIGHTLESS)


def thrown(core: ct.CDLL, robot: Robot) -> Plant:
    """Returns a plant that tumbles."""
    return Plant(core, robot, position=(0.0, 0.0, HIGH), angular_velocity=(1.0, -2.0, 1.5))


@pytest.mark.parametrize("mode", ["position", "kinematic"])
def test_a_free_robot_keeps_its_momentum_with_that_of_its_rotors(core: ct.CDLL, mode: str) -> None:
    robot = floating(mode=mode)
    plant, command = thrown(core, robot), Command(angle_ref=robot.stance + 0.4)
    links = changed(robot, servo={"gear_ratio": 0.0})
    before = momentum(robot, plant.bodies)[1]
    alone = momentum(links, plant.bodies)[1]
    for k in range(1, 6):
        plant.step(0.02 * k, command)
    after = momentum(robot, plant.bodies)[1]
    assert after == pytest.approx(before, rel=1e-6, abs=1e-7 * float(np.linalg.norm(before)))
    exchanged = momentum(links, plant.bodies)[1] - alone
    assert float(np.linalg.norm(exchanged)) > 1e-4 * float(np.linalg.norm(before))


def rotor_rates(robot: Robot, body: Array, dv: Array) -> tuple[Array, Array, Array]:
    """Returns of each joint the axis (3,), the rate of the rotor's angular momentum (3,), and the
    torque that accelerates the rotor, from its speed and acceleration in space.
    """
    servo = robot.servo
    own = servo.rotor_inertia / servo.gear_ratio**2  # about its own axis
    speed = joint_speeds(robot, body).ravel()
    axes, rates, torques = [], [], []
    for k, joint in enumerate(joint_models(robot)):
        s = rotation_matrix(body[joint.parent, 3:7]) @ joint.s_i
        w, dw = body[joint.parent, 10:13], dv[joint.parent, 3:6]
        qdd = float(s @ (dv[joint.child, 3:6] - dw))
        # the rotor turns at n qd on its carrier, which contains it as a part at rest
        spin, dspin = own * servo.gear_ratio * speed[k], own * servo.gear_ratio * qdd
        axes.append(s)
        rates.append(dspin * s + spin * np.cross(w, s))
        torques.append(servo.gear_ratio * own * (servo.gear_ratio * qdd + float(s @ dw)))
    return np.array(axes), np.array(rates), np.array(torques)


@pytest.mark.parametrize("seed", [1, 2])
def test_joints_obey_newton_and_euler_with_rotors_as_bodies_of_their_own(
    core: ct.CDLL, seed: int
) -> None:
    robot = floating()
    body, command = random_bodies(robot, seed), random_command(robot, seed)
    body[:, 2] += HIGH
    plant = Plant(core, robot)
    plant.bodies = body
    dv = plant.accelerations(command).dv
    motor, friction = joint_torques(robot, body, command)
    axes, rates, torques = rotor_rates(robot, body, dv)
    masses = np.array([robot.torso.mass, *(x.mass for leg in robot.legs for x in leg.links)])
    J, w = world_inertias(robot, body), body[:, 10:13]
    force = masses[:, None] * dv[:, :3]
    turn = np.einsum("kij,kj->ki", J, dv[:, 3:6])
    turn += np.cross(w, np.einsum("kij,kj->ki", J, w))
    models = joint_models(robot)
    for k, joint in enumerate(models):  # the rotor of a joint is carried by the joint's parent
        turn[joint.parent] += rates[k]
    for k, joint in enumerate(models):
        point = body[joint.parent, :3] + rotation_matrix(body[joint.parent, 3:7]) @ joint.point_i
        outer = range(joint.child, 3 * ((joint.child - 1) // 3) + 4)
        moment = sum(np.cross(body[b, :3] - point, force[b]) + turn[b] for b in outer)
        needed = float(axes[k] @ moment) + torques[k]
        given = float(motor.ravel()[k] + friction.ravel()[k])
        assert needed == pytest.approx(given, rel=SAME, abs=SAME * float(np.max(np.abs(turn))))
    whole = sum(np.cross(body[b, :3], force[b]) + turn[b] for b in range(len(body)))
    pushed = np.cross(body[0, :3], command.push_force) + command.push_torque
    assert whole == pytest.approx(pushed, rel=1e-7, abs=1e-7 * float(np.max(np.abs(turn))))
    assert float(np.max(np.abs(rates))) > 1e-3


@pytest.mark.parametrize(
    ("name", "mode", "ratio"),
    [("mx64_m6", "position", -60.0), ("mx64_m1", "torque", 60.0), ("mx64_m1", "kinematic", 60.0)],
)
def test_steps_with_spinning_rotors_are_the_twins(
    core: ct.CDLL, name: str, mode: str, ratio: float
) -> None:
    robot, h = with_servo(lopsided(3), name, mode=mode, gear_ratio=ratio, stop_stiffness=50.0), 1e-4
    robot = changed(robot, solver={"step": h, "method": "rosw3"})
    body, command = random_bodies(robot, 5), random_command(robot, 5)
    plant, state = Plant(core, robot), start_state(robot, body)
    plant.bodies = body
    ours = plant.accelerations(command)
    dense = accelerations(robot, body, command, standing_damping(robot, body))
    assert distance(ours.dv, dense.dv) < SAME
    assert distance(ours.multipliers, dense.multipliers) < SAME
    assert distance(ours.drive_torque, dense.drive_torque) < SAME
    for k in (1, 2):
        start = Start(robot, command, state)
        state = end_step(start, h, try_step(start, h))
        plant.step(k * h, command)
        assert distance(plant.bodies, state.body) < TWIN
        kinetic = plant.output(command).energy.kinetic
        assert kinetic == pytest.approx(kinetic_energy(robot, state.body), rel=TWIN)
