"""Tests heat of motors and their supply against closed forms, and commands on a bus."""

from __future__ import annotations

import ctypes as ct
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from plant import Plant
from scipy.linalg import expm
from states import changed, landing, random_bodies, random_command, with_links
from test_laws_servo import HEAVY, tibias, walled
from test_measured_servos import with_servo

from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.contact.geometry import standing_damping
from hexapod_cosim.models.dynamics import Command, accelerations
from hexapod_cosim.models.kinematics import joint_angles, joint_speeds
from hexapod_cosim.models.servos.motor import (
    Power,
    duty_share,
    held_commands,
    remaining_rating,
    supply_power,
    warm_servo,
)

WARM: dict[str, Any] = {
    "winding_capacity": 5.0,
    "housing_capacity": 80.0,
    "winding_to_housing": 8.0,
    "housing_to_air": 17.0,
}
AIR = 298.15  # K
VOLTS = 12.0 * 0.9625
EXACT = 1e-9  # relative: rounding
ROUNDING = 1e-12  # K  20 last bits of 300 K


def blocked(**servo: Any) -> Robot:
    """Returns a robot in torque mode whose joints are too heavy to move."""
    robot = with_servo(walled(), "mx64_m1", mode="torque", **servo)
    wall = HEAVY | {"inertia": (1e9, 1e9, 1e9, 0.0, 0.0, 0.0)}
    for joint in range(3):
        robot = with_links(robot, joint, **wall)
    return changed(robot, solver={"step_max": 0.05})


def pushed(torque: float) -> Command:
    """Returns the command of a torque at every knee [N m]."""
    return Command(angle_ref=np.zeros((6, 3)), torque_ref=tibias(torque))


def test_a_blocked_motor_warms_as_two_nodes_do(core: ct.CDLL) -> None:
    robot = blocked(**WARM)
    servo, torque, time = robot.servo, 1.0, 30.0
    heat = servo.resistance * (torque / servo.torque_constant) ** 2
    flow = np.array([[-1.0 / 8.0, 1.0 / 8.0], [1.0 / 8.0, -1.0 / 8.0 - 1.0 / 17.0]])
    rate = flow / np.array([[5.0], [80.0]])
    rest = -np.linalg.solve(flow, np.array([heat, 0.0]))  # over the air
    rise = rest - expm(rate * time) @ rest
    plant = Plant(core, robot, angle=tibias(0.0))
    plant.step(time, pushed(torque))
    after = plant.output(pushed(torque))
    got = [after.winding_temperature[2, 2] - AIR, after.housing_temperature[2, 2] - AIR]
    assert got == pytest.approx(rise, rel=1e-6)
    assert rise[0] > 6.0
    assert after.winding_temperature[2, 0] == pytest.approx(AIR, abs=1e-6)
    assert after.remaining_rating[2, 2] == pytest.approx(1.0 - rise[0] / 55.0, rel=1e-6)
    assert rest[0] == pytest.approx(heat * 25.0, rel=EXACT)


def test_friction_warms_the_housing_and_the_twin_agrees(core: ct.CDLL) -> None:
    robot = changed(with_servo(walled(), "mx64_m6", **WARM), solver={"step": 1e-3})
    plant = Plant(core, robot, angle=tibias(0.2), speed=tibias(2.0))
    before = plant.output()
    command = Command(angle_ref=tibias(0.4))
    plant.step(1e-3, command)
    after, servo = plant.output(command), robot.servo
    squared = after.torque_squared[0, 2] - before.torque_squared[0, 2]
    copper = servo.resistance * squared / servo.torque_constant**2
    gear = after.energy.gear_loss / 6.0
    start = np.array(AIR)
    winding, housing = warm_servo(servo, start, start, 1e-3, np.array(copper), np.array(gear))
    assert after.winding_temperature[0, 2] == pytest.approx(float(winding), abs=ROUNDING)
    assert after.housing_temperature[0, 2] == pytest.approx(float(housing), abs=ROUNDING)
    assert float(housing) > AIR + 1e6 * ROUNDING
    assert float(winding) > AIR + 1e6 * ROUNDING


@pytest.mark.parametrize(
    ("start", "share", "left"),
    [(343.0, 1.0, 10.15 / 55.0), (348.15, 0.5, 5.0 / 55.0), (353.15, 0.0, 0.0), (400.0, 0.0, 0.0)],
)
def test_a_hot_motor_gets_less(core: ct.CDLL, start: float, share: float, left: float) -> None:
    robot = blocked(start_temperature=start, **WARM)
    output = Plant(core, robot).output(pushed(100.0))
    servo = robot.servo
    assert output.current[3, 2] == pytest.approx(share * VOLTS / servo.resistance, rel=EXACT)
    assert output.remaining_rating[3, 2] == pytest.approx(left, rel=EXACT)
    assert float(remaining_rating(servo, np.array(start))) == pytest.approx(left, rel=EXACT)
    assert float(duty_share(servo, np.array(start))) == pytest.approx(share, rel=EXACT)


def test_the_current_read_after_a_step_is_the_one_that_the_next_step_begins_with(
    core: ct.CDLL,
) -> None:
    """The limit is held over a communication step at that of the temperature at its start."""
    robot = blocked(start_temperature=345.0, **WARM)
    servo, plant, command = robot.servo, Plant(core, robot), pushed(100.0)
    read, held = [plant.output(command)], []
    for k in range(3):
        plant.step(0.02 * (k + 1), command)
        read.append(plant.output(command))
        squared = read[-1].torque_squared[2, 2] - read[-2].torque_squared[2, 2]
        held.append(np.sqrt(squared / 0.02) / servo.torque_constant)
    got = [one.current[2, 2] for one in read]
    assert held == pytest.approx(got[:3], rel=1e-6)
    shares = duty_share(servo, np.array([one.winding_temperature[2, 2] for one in read]))
    assert got == pytest.approx((shares * VOLTS / servo.resistance).tolist(), rel=EXACT)
    assert 0.01 < got[0] - got[1] < 0.1  # A  a step and the reading at its end differ by this


# the supply


def test_a_battery_sags_under_the_currents_of_all_motors(core: ct.CDLL) -> None:
    """V = V_0 - R_b I, with the current I = sum d (d V)/R of 18 motors at their duty limits."""
    robot = blocked(supply_resistance=0.1)
    command = Command(angle_ref=np.zeros((6, 3)), torque_ref=np.full((6, 3), 100.0))
    output, servo = Plant(core, robot).output(command), robot.servo
    duty, volts = servo.duty_max, output.supply_voltage
    taken = 18.0 * duty * duty * volts / servo.resistance
    assert volts == pytest.approx(12.0 - 0.1 * taken, rel=EXACT)
    assert volts < 9.0
    assert output.current == pytest.approx(np.full((6, 3), duty * volts / servo.resistance))
    assert float(np.sum(output.electrical_power)) == pytest.approx(volts * taken, rel=EXACT)


@pytest.mark.parametrize(("mode", "most"), [("position", 0.0), ("position", 1.0), ("torque", 1.0)])
def test_accelerations_under_a_sagging_supply_are_the_twins(
    core: ct.CDLL, mode: str, most: float
) -> None:
    """Of hot motors, some of which are weak or off, without a limit of the current or with one."""
    limits = WARM | {"start_temperature": 347.0, "current_max": most}
    robot = with_servo(load_robot("athena"), "mx64_m6", mode=mode, supply_resistance=0.5, **limits)
    robot = changed(robot, body={"contact": "off"})
    for seed in range(3):
        strength = np.random.default_rng(seed).choice((0.0, 0.4, 1.0), (6, 3))
        body, command = random_bodies(robot, seed), random_command(robot, seed)
        command = replace(command, power=Power(1.0, 1.0, strength))
        plant = Plant(core, robot)
        plant.bodies = body
        servo, angle, speed = robot.servo, joint_angles(robot, body), joint_speeds(robot, body)
        wanted = command.torque_ref
        if mode == "position":
            wanted = wanted + servo.kp * (command.angle_ref - angle)
        power = supply_power(servo, speed, wanted, np.full((6, 3), 347.0), strength)
        shown = plant.output(command).supply_voltage
        assert shown == pytest.approx(12.0 * power.supply, rel=1e-10)
        assert power.supply < 0.99
        dense = accelerations(
            robot, body, replace(command, power=power), standing_damping(robot, body)
        )
        ours = plant.accelerations(command)
        assert ours.drive_torque == pytest.approx(dense.drive_torque, rel=1e-8, abs=1e-9)
        assert ours.dv == pytest.approx(dense.dv, rel=1e-6, abs=1e-6)


def test_the_figures_of_a_run_contain_the_energy_from_the_supply(core: ct.CDLL) -> None:
    """Works of the motors and their squared torques over k_m^2, from which metrics take the
    electrical cost, are the integral of the electrical power.
    """
    robot = with_servo(load_robot("athena"), "mx64_m6")
    plant, command = Plant(core, robot, **landing(robot)), random_command(robot, 3, size=0.3)
    powers = [float(np.sum(plant.output(command).electrical_power))]
    for k in range(400):
        plant.step(2.5e-4 * (k + 1), command)
        powers.append(float(np.sum(plant.output(command).electrical_power)))
    after = plant.output(command)
    copper = float(np.sum(after.torque_squared)) / robot.servo.motor_constant**2
    work = float(np.sum(after.positive_work - after.negative_work))
    assert work + copper == pytest.approx(float(np.trapezoid(powers, dx=2.5e-4)), rel=2e-3)
    assert copper > abs(work) > 0.0


# Commands on a bus: servos hold what was transmitted last, rounded, whatever the communication
# step.

STEP = 2.0 * np.pi / 4096.0  # rad  of an encoder


def robots(**bus: Any) -> tuple[Robot, Robot]:
    """Returns a robot with a bus and the same without."""
    robot = with_servo(load_robot("athena"), "mx64_m6", supply_resistance=0.1)
    return changed(robot, servo=bus), robot


def rounded(command: Command) -> Command:
    return replace(command, angle_ref=STEP * np.floor(command.angle_ref / STEP + 0.5))


@pytest.mark.parametrize("period", [0.01, 0.008])
def test_servos_hold_what_was_transmitted_last(core: ct.CDLL, period: float) -> None:
    """A plant without a bus whose inputs are held moves the same, bit for bit."""
    on_bus, alone = robots(bus_period=period, command_step=STEP)
    ours, theirs = (Plant(core, robot, **landing(robot)) for robot in (on_bus, alone))
    held, sent = random_command(on_bus, 0, size=0.2), 0
    for k in range(12):
        command = replace(random_command(on_bus, k, size=0.2), push_force=np.zeros(3))
        end = 0.005 * (k + 1)
        ours.step(end, command)
        while theirs.time < end:
            if theirs.time >= sent * period - 1e-9:
                held, sent = rounded(command), sent + 1
            pushed = replace(held, push_force=command.push_force, push_torque=command.push_torque)
            next_one = sent * period
            theirs.step(next_one if next_one < end - 1e-9 else end, pushed)
        assert np.array_equal(ours.bodies, theirs.bodies)
    assert sent == 1 + int((0.06 - 1e-9) / period)


def test_a_long_call_is_divided_at_transmissions(core: ct.CDLL) -> None:
    """Of inputs that change at a rate, each transmission takes those of its time."""
    on_bus, alone = robots(bus_period=0.01)
    command, rate = random_command(on_bus, 0, size=0.2), random_command(on_bus, 1, size=0.5)
    rate = replace(rate, push_force=np.zeros(3), push_torque=np.zeros(3))
    rate = replace(rate, acceleration_ref=np.zeros((6, 3)))
    ours, theirs = (Plant(core, robot, **landing(robot)) for robot in (on_bus, alone))
    ours.step_ramp(0.03, command, rate)
    for k in range(3):
        now = replace(
            command,
            angle_ref=command.angle_ref + 0.01 * k * rate.angle_ref,
            speed_ref=command.speed_ref + 0.01 * k * rate.speed_ref,
            torque_ref=command.torque_ref + 0.01 * k * rate.torque_ref,
        )
        theirs.step(0.01 * (k + 1), now)
    assert ours.bodies == pytest.approx(theirs.bodies, abs=1e-9)
    assert ours.output(command).solver.steps == theirs.output(command).solver.steps


def test_outputs_are_those_of_the_held_command(core: ct.CDLL) -> None:
    on_bus, _ = robots(bus_period=0.01)
    plant, first = Plant(core, on_bus, **landing(on_bus)), random_command(on_bus, 0, size=0.2)
    plant.step(0.004, first)
    other = random_command(on_bus, 7, size=0.2)
    held = replace(other, push_force=first.push_force, push_torque=first.push_torque)
    assert np.array_equal(plant.output(held).torque, plant.output(first).torque)
    plant.step(0.01, held)
    assert not np.array_equal(plant.output(held).torque, plant.output(first).torque)


def test_the_twin_rounds_and_holds() -> None:
    servo = robots(bus_period=0.01, command_step=0.1)[0].servo
    time = np.array([0.0, 0.005, 0.01, 0.015])
    angle = np.array([0.26, 0.31, -0.26, 9.0])
    assert held_commands(servo, time, angle) == pytest.approx([0.3, 0.3, -0.3, -0.3])
