"""Tests servos with the whole plant: limits, rotor inertia, gear friction, kinematic drives.

Coxas and femurs are too heavy to move. Each tibia is therefore a link on a wall, for whose joint
closed forms exist.
"""

from __future__ import annotations

import ctypes as ct
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from plant import Plant
from states import changed, landing, random_command, with_links

from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.contact.geometry import standing_damping
from hexapod_cosim.models.dynamics import Command, accelerations

# relative, of closed forms: a tibia's inertia is 1e-7 of its wall's, and the error control allows
# 1e-10 a step
CLOSED = 1e-6
WEIGHTLESS = (0.0, 0.0, 0.0)
FLIGHT: dict[str, Any] = {"method": "dp54", "tolerance": 1e-10, "step_max": 1.0}
HEAVY: dict[str, Any] = {
    "mass": 1e5,
    "inertia": (1e4, 1e4, 1e4, 0.0, 0.0, 0.0),
    "com": (0.0, 0.0, 0.0),
}
STRETCHED = np.zeros((6, 3))


def walled(**servo: Any) -> Robot:
    """Returns a robot without gravity whose femurs are too heavy to move."""
    robot = changed(
        load_robot("athena"),
        servo={"coulomb_friction": 0.0} | servo,
        torso={"mass": 1e6},
        solver=FLIGHT,
    )
    robot = changed(robot, torso={"inertia": (1e6, 1e6, 1e6, 0.0, 0.0, 0.0)})
    return replace(with_links(with_links(robot, 0, **HEAVY), 1, **HEAVY), gravity=WEIGHTLESS)


def tibia_inertia(robot: Robot) -> float:
    """Returns the inertia of a tibia and its rotor about the knee [kg m2]."""
    tibia = robot.legs[0].links[2]
    return tibia.inertia[1] + tibia.mass * tibia.com[0] ** 2 + robot.servo.rotor_inertia


def tibias(value: float) -> Any:
    """Returns an array (6, 3) with this value at every knee and 0 elsewhere."""
    return np.array([0.0, 0.0, value]) * np.ones((6, 1))


def test_a_servo_without_damping_swings_a_tibia_at_its_natural_frequency(core: ct.CDLL) -> None:
    robot = walled(kd=0.0, torque_max=100.0, speed_max=1e6)
    plant = Plant(core, robot, angle=tibias(0.1))
    period = 2.0 * math.pi * math.sqrt(tibia_inertia(robot) / robot.servo.kp)
    for share, angle in ((0.25, 0.0), (0.5, -0.1), (1.0, 0.1), (3.25, 0.0)):
        plant.step(share * period, Command(angle_ref=STRETCHED))
        assert plant.output().angle[:, 2] == pytest.approx(np.full(6, angle), abs=0.1 * CLOSED)


def test_a_damped_servo_decays_as_a_linear_oscillator(core: ct.CDLL) -> None:
    robot = walled(kp=40.0, kd=0.3, torque_max=100.0, speed_max=1e6)
    plant, inertia, t = Plant(core, robot, angle=tibias(0.1)), tibia_inertia(robot), 0.08
    decay, stiffness = robot.servo.kd / (2.0 * inertia), robot.servo.kp / inertia
    w = math.sqrt(stiffness - decay**2)
    plant.step(t, Command(angle_ref=STRETCHED))
    exact = 0.1 * math.exp(-decay * t) * (math.cos(w * t) + decay / w * math.sin(w * t))
    assert plant.output().angle[:, 2] == pytest.approx(np.full(6, exact), abs=0.1 * CLOSED)


def test_a_torque_meets_the_link_and_its_rotor(core: ct.CDLL) -> None:
    robot = walled(mode="torque", torque_max=100.0, speed_max=1e6)
    plant, command = (
        Plant(core, robot, angle=STRETCHED),
        Command(angle_ref=STRETCHED, torque_ref=tibias(0.02)),
    )
    plant.step(0.3, command)
    rate = 0.02 / tibia_inertia(robot)
    assert plant.output(command).speed[:, 2] == pytest.approx(np.full(6, 0.3 * rate), rel=CLOSED)
    assert plant.output(command).energy.actuator_work == pytest.approx(
        6.0 * 0.02 * 0.5 * rate * 0.3**2, rel=CLOSED
    )
    assert plant.output(command).energy.kinetic == pytest.approx(
        plant.output(command).energy.actuator_work, rel=CLOSED
    )


def test_torque_is_limited_at_stall_and_by_the_torque_speed_line(core: ct.CDLL) -> None:
    """Under full command from rest the speed is w = w0 (1 - exp(-tau t/(I w0))) along the
    torque-speed line, and never exceeds the no-load speed.
    """
    robot = walled(mode="torque")
    plant, command = (
        Plant(core, robot, angle=STRETCHED),
        Command(angle_ref=STRETCHED, torque_ref=tibias(50.0)),
    )
    assert plant.output(command).torque[:, 2] == pytest.approx(
        np.full(6, robot.servo.torque_max), rel=1e-14
    )
    constant = tibia_inertia(robot) * robot.servo.speed_max / robot.servo.torque_max
    for t in (0.5 * constant, constant, 3.0 * constant):
        plant.step(t, command)
        speed = robot.servo.speed_max * (1.0 - math.exp(-t / constant))
        assert plant.output(command).speed[:, 2] == pytest.approx(np.full(6, speed), rel=CLOSED)
        line = robot.servo.torque_max * (1.0 - speed / robot.servo.speed_max)
        assert plant.output(command).torque[:, 2] == pytest.approx(
            np.full(6, line), rel=10.0 * CLOSED
        )


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_no_torque_is_left_beyond_the_no_load_speed_but_full_braking_is(
    core: ct.CDLL, sign: float
) -> None:
    robot = walled(mode="torque")
    plant = Plant(core, robot, angle=STRETCHED, speed=tibias(sign * 9.0))
    forward, back = (
        Command(angle_ref=STRETCHED, torque_ref=tibias(way * sign * 50.0)) for way in (1.0, -1.0)
    )
    assert plant.output(forward).torque[:, 2] == pytest.approx(np.zeros(6), abs=1e-14)
    assert plant.output(back).torque[:, 2] == pytest.approx(
        np.full(6, -sign * robot.servo.torque_max), rel=1e-14
    )


def test_gear_friction_stops_a_tibia_at_its_closed_rate(core: ct.CDLL) -> None:
    """The gear torque is -tau tanh(w/0.05), so sinh(w/0.05) decays exponentially; at high speed the
    deceleration is constant.
    """
    robot = walled(mode="torque", coulomb_friction=0.05)
    plant = Plant(core, robot, angle=STRETCHED, speed=tibias(1.0))
    rate = 0.05 / tibia_inertia(robot)
    for t in (0.1, 0.24):
        plant.step(t, Command(angle_ref=STRETCHED))
        exact = 0.05 * math.asinh(math.sinh(1.0 / 0.05) * math.exp(-rate * t / 0.05))
        assert plant.output().speed[:, 2] == pytest.approx(np.full(6, exact), rel=10.0 * CLOSED)
    energy = plant.output().energy
    lost = 6.0 * 0.5 * tibia_inertia(robot) * (1.0 - plant.output().speed[0, 2] ** 2)
    assert energy.dissipated == pytest.approx(lost, rel=10.0 * CLOSED)
    assert energy.actuator_work == 0.0


# kinematic drives


def driven(robot: Robot) -> Robot:
    return changed(robot, servo={"mode": "kinematic"})


@pytest.mark.parametrize("name", ["athena", "phantomx_mk4"])
def test_a_kinematic_drive_follows_its_reference_in_the_air_and_on_the_ground(
    core: ct.CDLL, name: str
) -> None:
    """The references q + qd h are consistent from step to step, so joints follow them exactly."""
    robot = driven(load_robot(name))
    start = landing(robot)
    angle, speed = start["angle"].copy(), start["speed"]
    plant, h = Plant(core, robot, **start), 4e-3
    for k in range(25):
        plant.step((k + 1) * h, Command(angle_ref=angle, speed_ref=speed))
        angle = angle + h * speed
        output = plant.output(Command(angle_ref=angle, speed_ref=speed))
        assert output.angle == pytest.approx(angle, abs=1e-5)
        assert output.speed == pytest.approx(speed, abs=1e-3)
    assert output.solver.touchdowns > 0


ACCELERATION = np.tile([30.0, -40.0, 25.0], (6, 1))  # rad/s2, of the references


def in_flight(**baumgarte: float) -> Robot:
    return changed(driven(load_robot("athena")), solver=FLIGHT, baumgarte=baumgarte)


@pytest.mark.parametrize(
    "baumgarte", [{}, {"alpha": 0.0, "beta": 0.0}, {"alpha": 5.0, "beta": 80.0}], ids=str
)
def test_a_drive_told_its_acceleration_stays_on_its_parabola(
    core: ct.CDLL, baumgarte: dict[str, float]
) -> None:
    """With 30 rad/s2 from rest a drive is at 6 mrad with 0.6 rad/s after 20 ms, and at 24 mrad
    after 40 ms.
    """
    robot = in_flight(**baumgarte)
    plant, way = Plant(core, robot), ACCELERATION / 30.0
    plant.step(0.02, Command(angle_ref=robot.stance, acceleration_ref=ACCELERATION))
    output = plant.output()
    assert output.angle - robot.stance == pytest.approx(0.006 * way, abs=1e-9)
    assert output.speed == pytest.approx(0.6 * way, abs=1e-7)
    plant.step(
        0.04, Command(angle_ref=output.angle, speed_ref=output.speed, acceleration_ref=ACCELERATION)
    )
    assert plant.output().angle - robot.stance == pytest.approx(0.024 * way, abs=1e-9)


def test_a_drive_whose_acceleration_grows_is_on_its_cubic(core: ct.CDLL) -> None:
    """With 1500 rad/s3 from rest a drive is at 2 mrad with 0.3 rad/s after 20 ms, also if its
    reference follows the cubic at 100/s.
    """
    way = ACCELERATION / 30.0
    robot = in_flight(alpha=100.0, beta=100.0)
    plant, nothing = Plant(core, robot), np.zeros((6, 3))
    growth = Command(angle_ref=nothing, acceleration_ref=50.0 * ACCELERATION)
    plant.step_ramp(0.02, Command(angle_ref=robot.stance), growth)
    output = plant.output()
    assert output.angle - robot.stance == pytest.approx(0.002 * way, abs=1e-8)
    assert output.speed == pytest.approx(0.3 * way, abs=1e-6)


def test_a_drive_told_no_acceleration_lags_by_the_acceleration_over_beta_squared(
    core: ct.CDLL,
) -> None:
    """Importers may leave acceleration_ref at 0. The steady lag is then 30 rad/s2 over (100/s)^2, 3
    mrad.
    """
    robot, h = in_flight(alpha=100.0, beta=100.0), 1e-4
    plant, lag = Plant(core, robot), {}
    for k in range(1500):
        t = k * h
        angle, speed = robot.stance + 0.5 * ACCELERATION * t**2, ACCELERATION * t
        plant.step(t + h, Command(angle_ref=angle, speed_ref=speed))
        lag[k] = angle + speed * h - plant.output().angle
    # the lag differs by h, which is 1 % of the drive's time constant
    assert lag[1499] == pytest.approx(ACCELERATION / 1e4, rel=0.02)


def test_a_drive_off_its_reference_returns_at_the_rate_of_its_stabilisation(core: ct.CDLL) -> None:
    """With alpha = beta the error decays critically damped: (1 + alpha t) exp(-alpha t)."""
    robot = changed(driven(load_robot("athena")), solver=FLIGHT)
    plant, alpha = Plant(core, robot, angle=robot.stance + 0.1), robot.baumgarte.alpha
    assert robot.baumgarte.beta == alpha
    for t in (0.01, 0.03, 0.1):
        plant.step(t)
        assert plant.output().angle - robot.stance == pytest.approx(
            np.full((6, 3), 0.1 * (1.0 + alpha * t) * math.exp(-alpha * t)), abs=1e-8
        )


def test_drive_torque_is_that_of_inverse_dynamics(core: ct.CDLL) -> None:
    """The drive torques equal those of the twin's dense system, and torque servos with these
    torques move in the same way.
    """
    robot = driven(load_robot("athena"))
    plant = Plant(core, robot, **landing(robot))
    command = replace(random_command(robot, 2, size=0.3), torque_ref=np.zeros((6, 3)))
    plant.step(0.03, command)
    body = plant.bodies
    plant.bodies = body  # the contacts have no impact speed, as the twin takes them
    solved = plant.accelerations(command)
    dense = accelerations(robot, body, command, standing_damping(robot, body))
    assert solved.drive_torque == pytest.approx(dense.drive_torque, rel=1e-9, abs=1e-9)
    assert np.array_equal(plant.output(command).torque, solved.drive_torque)

    strong = Plant(
        core, changed(robot, servo={"mode": "torque", "torque_max": 1e5, "speed_max": 1e9})
    )
    strong.bodies = body
    by_torque = strong.accelerations(replace(command, torque_ref=solved.drive_torque)).dv
    assert float(np.max(np.abs(by_torque - solved.dv))) < 1e-8 * float(np.max(np.abs(solved.dv)))
