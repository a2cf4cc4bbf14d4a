"""Measured servos: the plant computes what the twin does, the motor obeys its closed forms, the
books of energy close, and files choose servos by name.
"""

from __future__ import annotations

import ctypes as ct
import math
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from plant import Plant, flat, inputs, probed
from states import changed, distance, landing, lopsided, random_bodies, random_command
from test_laws_servo import tibias, walled

from hexapod_cosim.cosim.design.gains import STANCES, level_fmu
from hexapod_cosim.cosim.design.linearise import ANGLES, linearise
from hexapod_cosim.cosim.design.standing import rest
from hexapod_cosim.cosim.scenario.reading import load_scenario, scenario_robot
from hexapod_cosim.models import Robot, RobotError, ScenarioError, load_robot, robot_from_table
from hexapod_cosim.models.actuator import servo_slopes, servo_torque
from hexapod_cosim.models.constraints import constraints
from hexapod_cosim.models.contact.geometry import standing_damping
from hexapod_cosim.models.dynamics import Command, accelerations, applied_forces, external_torques
from hexapod_cosim.models.files import parse_toml
from hexapod_cosim.models.kinematics import body_states, joint_models
from hexapod_cosim.models.mjcf import robot_to_mjcf
from hexapod_cosim.models.records import Servo
from hexapod_cosim.models.schema import require
from hexapod_cosim.models.servos.motor import (
    Power,
    electrical_power,
    measured_drag,
    measured_friction,
    motor_current,
    motor_torque,
)
from hexapod_cosim.models.servos.presets import measured_servo, servo_table
from hexapod_cosim.models.step import Start, start_state, try_step

# relative, and N m or N m s: the same formulas; powers and exponentials of different libraries, and
# 1 - tanh^2 of a saturated friction times a slope of 70 N m s
SAME = 1e-12
DENSE = 1e-9  # relative: dense solve against the sweeps
DIFFERENCE = 1e-6  # relative: central differences
LOADS = ("motor_load_friction", "stribeck_motor_load_friction", "stribeck_external_load_friction")
ROOT = Path(__file__).parents[2]


def with_servo(robot: Robot, name: str, **settings: Any) -> Robot:
    """Returns a robot with a measured servo."""
    servo = Servo(**require(Servo, dict(servo_table({"model": name} | settings, "")), ""))
    return replace(robot, servo=servo)


# the plant and the twin


@pytest.mark.parametrize("name", ["mx64_m1", "mx64_m2", "mx64_m4", "mx106_m6"])
@pytest.mark.parametrize(("mode", "most"), [("position", 0.0), ("position", 1.0), ("torque", 1.0)])
def test_the_plants_servos_are_the_twins(core: ct.CDLL, name: str, mode: str, most: float) -> None:
    robot = with_servo(load_robot("athena"), name, mode=mode, kd=0.3, current_max=most)
    plant, servo, rng = Plant(core, robot), robot.servo, np.random.default_rng(1)
    clipped = 0
    for _ in range(60):
        angle, speed, *refs = rng.normal(0.0, [0.3, 2.0, 0.3, 1.0, 3.0])
        motor, external = rng.normal(0.0, 3.0, 2)
        state = [np.array([value]) for value in (angle, speed, *refs)]
        supply = float(rng.choice((1.0, 0.7)))
        power = Power(supply, supply, float(rng.choice((1.0, 0.3, 0.0))))
        torque = servo_torque(servo, *state, power=power)
        slopes = servo_slopes(servo, *state, power=power)
        given = np.array([*refs, supply, power.strength])
        got = probed(core.hx_probe_servo, plant, angle, speed, given, size=4)
        drag = servo.coulomb_friction / servo.friction_speed
        drag *= 1.0 - math.tanh(speed / servo.friction_speed) ** 2
        assert got[[0, 2]] == pytest.approx([torque[0], slopes[0][0]], rel=SAME, abs=SAME)
        assert got[3] == pytest.approx(slopes[1][0] + drag, rel=SAME, abs=SAME)
        clipped += slopes[0][0] == 0.0
        at = [np.array([value]) for value in (speed, motor, external)]
        gear = [measured_friction(servo, *at)[0], measured_drag(servo, *at)[0]]
        theirs = probed(core.hx_probe_gear, plant, speed, motor, external, size=2)
        assert theirs == pytest.approx(gear, rel=SAME, abs=SAME)
    assert clipped > 0


@pytest.mark.parametrize(
    ("name", "mode", "stops"),
    [
        ("mx64_m1", "torque", 0.0),
        ("mx64_m4", "position", 0.0),
        ("mx106_m6", "position", 50.0),
        ("mx106_m6", "kinematic", 0.0),
    ],
)
def test_accelerations_with_measured_servos_are_those_of_the_dense_system(
    core: ct.CDLL, name: str, mode: str, stops: float
) -> None:
    stopped = {"stop_stiffness": stops, "stop_damping": 0.1 * stops}
    robot = with_servo(lopsided(2), name, mode=mode, **stopped)
    for seed, drift in ((0, 0.0), (1, 0.02)):
        body, command = random_bodies(robot, seed, drift=drift), random_command(robot, seed)
        plant = Plant(core, robot)
        plant.bodies = body
        ours = plant.accelerations(command)
        dense = accelerations(robot, body, command, standing_damping(robot, body))
        assert distance(ours.dv, dense.dv) < DENSE
        assert distance(ours.drive_torque, dense.drive_torque) < DENSE
        free = changed(robot, servo=dict.fromkeys(LOADS, 0.0))
        other = accelerations(free, body, command, standing_damping(free, body))
        rubs = distance(other.gear_torque, dense.gear_torque)
        assert rubs > 1e3 * DENSE or name == "mx64_m1"


@pytest.mark.parametrize("h", [1e-4, 2e-3])
def test_a_step_with_measured_servos_is_the_twins(core: ct.CDLL, h: float) -> None:
    robot = changed(with_servo(lopsided(3), "mx64_m6"), solver={"step": h, "method": "rosw3"})
    body, command = random_bodies(robot, 5), random_command(robot, 5)
    plant = Plant(core, robot)
    plant.bodies = body
    trial = try_step(Start(robot, command, start_state(robot, body)), h)
    plant.step(h, command)
    assert distance(plant.bodies, trial.body) < 1e-9


def test_external_torques_balance_the_torques_of_joints_at_rest() -> None:
    """M dv = 0 with torque -external on every joint and a torso that is held."""
    robot = with_servo(lopsided(4), "mx64_m6")
    still = np.zeros(3)
    upright = np.array([1.0, 0.0, 0.0, 0.0])
    high = np.array([0.0, 0.0, 1.0])
    body = body_states(robot, high, upright, still, still, robot.stance, np.zeros((6, 3)))
    joints, command = constraints(robot, body), Command(angle_ref=robot.stance)
    g = applied_forces(robot, body, command, np.full(6, np.nan)).ravel()
    load = external_torques(robot, body, command, g, joints)
    needed = g - joints.G.T @ load.ravel()
    needed[:6] = 0.0  # the torso is held
    left = np.linalg.lstsq(joints.D.T[6:], needed[6:], rcond=None)[0]
    assert joints.D.T[6:] @ left == pytest.approx(needed[6:], abs=1e-9)
    tibia = joint_models(robot)[2]
    assert abs(load[0, tibia.child - 1]) > 1e-3


def test_derivatives_with_measured_servos_are_those_of_differences(core: ct.CDLL) -> None:
    robot = with_servo(load_robot("athena"), "mx64_m6")
    plant, command = Plant(core, robot, **landing(robot)), random_command(robot, 1, size=0.3)
    x, rng = plant.coordinates, np.random.default_rng(2)
    dx = rng.normal(0.0, 1.0, x.size)
    dx[-18:], dx[-21:-18] = 0.0, 0.0
    exact, shown = plant.tangent(command, flat(inputs(replace(command))) * 0.0, dx)
    step, ends = 1e-7, []
    for sign in (1.0, -1.0):
        plant.coordinates = x + sign * step * dx
        output = plant.output(command)
        ends.append((plant.rates(command), output.current, output.electrical_power))
    rates, current, power = ((a - b) / (2.0 * step) for a, b in zip(*ends, strict=True))
    assert distance(exact, rates) < 1e-5
    assert distance(np.array(shown.current), current) < DIFFERENCE
    assert distance(np.array(shown.electrical_power), power) < DIFFERENCE


# the motor


def test_a_motor_at_its_voltage_limit_reaches_its_no_load_speed(core: ct.CDLL) -> None:
    """dw/dt = (k_t V/R - k_t^2 w/R)/I: an exponential with the time I R/k_t^2."""
    robot = with_servo(walled(), "mx64_m1", coulomb_friction=0.0, viscous_friction=0.0)
    servo = replace(robot.servo, mode="torque")
    robot = replace(robot, servo=servo)
    tibia = robot.legs[0].links[2]
    inertia = tibia.inertia[1] + tibia.mass * tibia.com[0] ** 2 + servo.rotor_inertia
    time = inertia * servo.resistance / servo.torque_constant**2
    command = Command(angle_ref=np.zeros((6, 3)), torque_ref=tibias(100.0))
    plant = Plant(core, robot, angle=tibias(0.0))
    start = plant.output(command)
    volts = 12.0 * 0.9625
    assert start.current[0, 2] == pytest.approx(volts / servo.resistance, rel=1e-12)
    assert start.electrical_power[0, 2] == pytest.approx(volts**2 / servo.resistance, rel=1e-12)
    plant.step(2.0 * time, command)
    speed = volts / servo.torque_constant * (1.0 - math.exp(-2.0))
    after = plant.output(command)
    assert after.speed[0, 2] == pytest.approx(speed, rel=1e-6)
    current = (volts - servo.torque_constant * speed) / servo.resistance
    assert after.current[0, 2] == pytest.approx(current, rel=1e-5)
    assert after.electrical_power[0, 2] == pytest.approx(volts * current, rel=1e-5)


def test_published_constants_give_the_published_stiffness_and_stall_torque() -> None:
    """kp [N m/rad], back-EMF damping [N m s/rad], stall torque [N m], no-load speed [rad/s]."""
    for name, figures in {
        "mx64_m1": (24.9, 0.667, 4.74, 7.12),
        "mx64_m6": (42.0, 1.107, 7.99, 7.21),
    }.items():
        servo = measured_servo(name).servo
        damping = servo.torque_constant**2 / servo.resistance
        got = (servo.kp, damping, servo.torque_max, servo.speed_max)
        assert got == pytest.approx(figures, rel=2e-3)


def test_a_driven_motor_takes_its_work_and_its_heat_from_the_supply() -> None:
    servo = measured_servo("mx106_m6").servo
    speed, wanted = np.linspace(-8.0, 8.0, 33), np.linspace(9.0, -9.0, 33)
    torque = motor_torque(servo, speed, wanted)
    current = motor_current(servo, torque)
    volts = servo.resistance * current + servo.torque_constant * speed
    assert np.max(np.abs(volts)) <= servo.duty_max * servo.voltage * (1.0 + 1e-12)
    assert electrical_power(servo, torque, speed) == pytest.approx(volts * current, rel=1e-12)
    heat = (torque / servo.motor_constant) ** 2
    assert electrical_power(servo, torque, speed) == pytest.approx(torque * speed + heat, rel=1e-9)


# the whole robot


def test_the_books_of_energy_close_with_measured_servos(core: ct.CDLL) -> None:
    robot = changed(with_servo(load_robot("athena"), "mx64_m6"), solver={"tolerance": 1e-6})
    plant = Plant(core, robot, **landing(robot))
    for k in range(40):
        plant.step(0.01 * (k + 1), random_command(robot, k // 10, size=0.3))
    energy = plant.output().energy
    assert energy.gear_loss > 0.01
    scale = energy.gear_loss + energy.contact_loss + energy.friction_loss
    assert abs(energy.residual) < 1e-3 * scale


# files


def test_a_robot_file_chooses_a_servo_by_name_and_may_change_its_numbers() -> None:
    table = parse_toml((ROOT / "models/athena.toml").read_text(encoding="utf-8"))
    table["servo"] = {"model": "mx64_m6", "resistance": 2.5, "stop_stiffness": 100.0}
    servo = robot_from_table(table, where="mine").servo
    assert (servo.drive, servo.mode, servo.kd) == ("motor", "position", 0.0)
    assert servo.resistance == 2.5
    assert servo.stop_stiffness == 100.0
    assert servo.torque_max == pytest.approx(1.6016832750318712 / 2.5 * 0.9625 * 12.0)
    assert servo.kp == pytest.approx(1.6016832750318712 / 2.5 * 12.0 * 0.158 * 32.0)
    table["servo"] |= {"kp": 30.0}
    assert robot_from_table(table, where="mine").servo.kp == 30.0


def test_a_scenario_chooses_a_servo_and_a_lower_voltage_softens_it() -> None:
    full = scenario_robot(load_scenario("amble", overrides=["servo.model=mx64_m1"])).servo
    settings = ["servo.model=mx64_m1", "servo.voltage=9 V"]
    low = scenario_robot(load_scenario("amble", overrides=settings)).servo
    assert low.kp == pytest.approx(0.75 * full.kp)
    assert low.torque_max == pytest.approx(0.75 * full.torque_max)
    assert low.speed_max == pytest.approx(0.75 * full.speed_max)


@pytest.mark.parametrize(
    ("section", "message"),
    [
        ({"model": "mx46_m1"}, "unknown servo"),
        ({"model": 3}, "a name of `hexapod list servos`"),
        ({"model": "mx64_m1", "torque_max": 3.0}, "follows from the motor's constants"),
        ({"model": "mx64_m1", "duty_gain": -1.0}, "servo.duty_gain: value not allowed"),
        ({"model": "mx64_m1", "resistance": 0.0}, "servo.resistance: a motor without"),
        ({"drive": "motor", "voltage": 12.0}, "servo.torque_constant: a motor without"),
    ],
)
def test_servos_that_cannot_be_are_refused_by_name(section: dict[str, Any], message: str) -> None:
    table = parse_toml((ROOT / "models/athena.toml").read_text(encoding="utf-8"))
    table["servo"] = section
    with pytest.raises(RobotError, match=message):
        robot_from_table(table, where="mine")
    overrides = [f"servo.{key}={value}" for key, value in section.items()]
    with pytest.raises((ScenarioError, RobotError), match=message):
        scenario_robot(load_scenario("amble", overrides=overrides))


# Design of gains for measured servos: the robot at rest with dry friction, and without any.


def test_gears_that_slip_leave_out_all_dry_friction() -> None:
    """What is left of a joint's speed after 5 ms: next to nothing where friction holds it."""
    robot, left = with_servo(load_robot("athena"), "mx64_m6"), []
    with level_fmu(robot) as fmu:
        motion, inputs = rest(fmu, robot, standing=STANCES["six legs"], load=1.0)
        for friction in (robot.servo.coulomb_friction, 0.0):
            plant = linearise(fmu, robot, motion, inputs, period=0.005, coulomb_friction=friction)
            left.append(np.abs(np.diag(plant.system.A)[-ANGLES:]))
    assert np.all(left[0] < 0.02)
    assert np.all(left[1] > 0.05)


def test_mjcf_has_viscous_friction_and_the_damping_of_the_back_emf() -> None:
    robot = with_servo(load_robot("athena"), "mx64_m1")
    root = ET.fromstring(robot_to_mjcf(robot))
    joints = root.findall(".//joint[@type='hinge']")
    damping = [float(joint.get("damping", "")) for joint in joints]
    assert damping == pytest.approx([0.01169] * 18, abs=1e-5)
    assert {float(joint.get("frictionloss", "")) for joint in joints} == {
        robot.servo.coulomb_friction
    }
    motors = root.findall("actuator/position")
    back_emf = 0.66656  # k_t^2/R
    assert [float(motor.get("kv", "")) for motor in motors] == pytest.approx(
        [back_emf] * 18, rel=1e-3
    )
