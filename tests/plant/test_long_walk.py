"""Tests long walks: energy balance, drift of the joints, independence of stiff laws and of the
order of the legs.
"""

from __future__ import annotations

import ctypes as ct
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from plant import Plant
from states import changed

from hexapod_cosim.controller import BodyCommand, Controller, Measurement, make_gait
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.run.runner import Runner
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.dynamics import Command
from hexapod_cosim.models.statics import settled

H = 5e-3  # s
BALANCE = 1e-4  # of the motors' work: the energy residual after a minute
DRIFT = 1e-6  # m and 1, sum over all joints after ten minutes
PROJECTED = 1e-13  # the same with projection after every step: rounding
RENUMBERED = 1e-9  # m and rad: rounding after a second of walking


def walking(robot: Robot, duration: float) -> Iterator[tuple[float, Command]]:
    """Yields the end time and the joint commands of every step of a kinematic walk at 0.08 m/s."""
    controller = Controller(robot, period=H, gait=make_gait(robot, robot.gait.name))
    nothing, forward = Measurement(), BodyCommand(vx=0.08)
    for k in range(round(duration / H)):
        sent = controller.step(k * H, forward, nothing)
        yield (k + 1) * H, Command(angle_ref=sent.angle_ref.copy(), speed_ref=sent.speed_ref.copy())


def standing(core: ct.CDLL, robot: Robot) -> Plant:
    position, quaternion, angle = settled(robot)
    return Plant(core, robot, position=position, quaternion=quaternion, angle=angle)


def walk(core: ct.CDLL, robot: Robot, duration: float) -> Plant:
    plant = standing(core, robot)
    for t, command in walking(robot, duration):
        plant.step(t, command)
    return plant


def recorded(robot: str, duration: float) -> Recording:
    """Returns every output at each second of a kinematic walk on the loop in C."""
    overrides = ["control=kinematic", f"robot={robot}", "command.vx=0.08"]
    overrides += [f"duration={duration}", "outputs.interval=1"]
    scenario = load_scenario("walk_flat", overrides=overrides)
    with Runner(everything=True) as runner:
        result = runner.simulate(scenario)
    assert result.completed
    assert result.outcome.recording.time[-1] == pytest.approx(duration)
    return result.outcome.recording


@pytest.mark.usefixtures("plant_build")
@pytest.mark.parametrize("robot", ["athena", "phantomx_mk4"])
def test_the_energy_balance_of_a_minute_closes(robot: str) -> None:
    """The PhantomX's servos work at their limits."""
    walk = recorded(robot, 60.0)
    work, residual = (walk.column(f"energy.{name}")[-1] for name in ("actuator_work", "residual"))
    assert work > 10.0
    assert abs(residual) < BALANCE * work


@pytest.mark.usefixtures("plant_build")
def test_two_minutes_of_walking_leave_the_joints_together() -> None:
    walk = recorded("athena", 120.0)
    assert walk.column("constraint.position_error").max() < DRIFT
    assert walk.column("constraint.velocity_error").max() < 1e3 * DRIFT


def test_projection_puts_positions_and_velocities_back_on_the_joints(core: ct.CDLL) -> None:
    robot = changed(load_robot("athena"), solver={"tolerance": 1e-2})
    loose = walk(core, robot, 2.0).output()
    kept = walk(core, changed(robot, solver={"projection": "step"}), 2.0).output()
    assert loose.constraint.position_error > 1e3 * PROJECTED
    assert kept.constraint.position_error < PROJECTED
    assert kept.constraint.velocity_error < 1e2 * PROJECTED
    assert np.max(np.abs(kept.torso.position - loose.torso.position)) < 1e-3


def test_the_energy_balance_of_feet_that_stick_closes(core: ct.CDLL) -> None:
    """The residual is a tenth of the usual one at a tenth of the usual tolerance, because works are
    of order 2 in the step (eq. 27).
    """
    robot = changed(load_robot("athena"), friction={"law": "bristle"}, solver={"tolerance": 1e-5})
    energy = walk(core, robot, 5.0).output().energy
    assert abs(energy.residual) < 0.1 * BALANCE * energy.actuator_work


def test_legs_in_another_order_walk_the_same_way(core: ct.CDLL) -> None:
    robot = changed(load_robot("athena"), solver={"step": 1e-3})
    order = [3, 0, 5, 1, 4, 2]
    renumbered = replace(robot, legs=tuple(robot.legs[leg] for leg in order))
    position, quaternion, angle = settled(robot)
    plants = [Plant(core, robot, position=position, quaternion=quaternion, angle=angle)]
    plants += [
        Plant(core, renumbered, position=position, quaternion=quaternion, angle=angle[order])
    ]
    for t, command in walking(robot, 1.0):
        plants[0].step(t, command)
        plants[1].step(
            t, Command(angle_ref=command.angle_ref[order], speed_ref=command.speed_ref[order])
        )
    here, there = (plant.output() for plant in plants)
    assert there.torso.position == pytest.approx(here.torso.position, abs=RENUMBERED)
    assert here.angle[order] == pytest.approx(there.angle, abs=RENUMBERED)
    assert not np.array_equal(
        there.torso.position, here.torso.position
    )  # sums over the legs round differently, so the bits differ
