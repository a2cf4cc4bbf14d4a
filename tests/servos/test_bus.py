"""Commands on a bus: servos hold what was transmitted last, rounded, whatever the communication
step.
"""

from __future__ import annotations

import ctypes as ct
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from plant import Plant
from states import changed, landing, random_command
from test_measured_servos import with_servo

from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.dynamics import Command
from hexapod_cosim.models.servos.motor import held_commands

STEP = 2.0 * np.pi / 4096.0  # rad  of an encoder


def robots(**bus: Any) -> tuple[Robot, Robot]:
    """Returns a robot with a bus and the same without."""
    robot = with_servo(load_robot("athena"), "mx64_m6", supply_resistance=0.1)
    return changed(robot, servo=bus), robot


def rounded(command: Command) -> Command:
    return replace(command, angle_ref=STEP * np.floor(command.angle_ref / STEP + 0.5))


@pytest.mark.parametrize("period", [0.01, 0.008])
def test_servos_hold_what_was_transmitted_last(core: ct.CDLL, period: float) -> None:
    """A plant without a bus that is told the held commands makes the same motion, bit for bit."""
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
            told = replace(held, push_force=command.push_force, push_torque=command.push_torque)
            next_one = sent * period
            theirs.step(next_one if next_one < end - 1e-9 else end, told)
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
