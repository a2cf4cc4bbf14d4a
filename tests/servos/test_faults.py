"""Tests weak, limp and locked servos: the twin's equations, the energy audit, states, scenarios."""

from __future__ import annotations

import ctypes as ct
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from plant import Plant, PlantError
from states import changed, landing, random_command
from test_measured_servos import with_servo

from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.cosim.scenario.schedule import make_schedule
from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.actuator import lock_joints
from hexapod_cosim.models.dynamics import Command
from hexapod_cosim.models.integrator import integrate
from hexapod_cosim.models.servos.motor import Power, stall_torque
from hexapod_cosim.models.step import start_state

RESIDUAL = 1e-4  # relative to what motors and pushes give and losses take
H = 1e-3  # s
LF_LOST = np.array([[1.0] * 3, *5 * [[0.0] * 3]])


def faulty(robot: Robot, seed: int) -> tuple[Command, Any]:
    """Returns a command to servos of three strengths, and locks of some joints."""
    rng = np.random.default_rng(seed)
    power = Power(1.0, 1.0, rng.choice((0.0, 0.3, 1.0), (6, 3)))
    return replace(random_command(robot, seed), power=power), rng.choice((0.0, 1.0), (6, 3))


@pytest.mark.parametrize("drive", ["line", "motor"])
@pytest.mark.parametrize("mode", ["position", "torque"])
def test_a_robot_with_faults_moves_as_the_twin(core: ct.CDLL, mode: str, drive: str) -> None:
    """Both take equal steps in the air with weak, limp and locked servos that meet their limits."""
    robot = load_robot("athena")
    if drive == "motor":
        robot = with_servo(robot, "mx64_m1")
    robot = changed(robot, servo={"mode": mode}, solver={"step": H}, body={"contact": "off"})
    command, lock = faulty(robot, 3)
    speed = np.random.default_rng(1).normal(0.0, 2.0, (6, 3))
    plant = Plant(core, robot, speed=speed)
    twin = lock_joints(robot, np.where(lock > 0.0, robot.stance, np.nan))
    state = integrate(twin, command, start_state(robot, plant.bodies), 4.0 * H)
    plant.step(4.0 * H, command, lock)
    assert plant.bodies == pytest.approx(state.body, rel=1e-7, abs=1e-9)
    healthy = Plant(core, robot, speed=speed)
    healthy.step(4.0 * H, replace(command, power=Power(1.0, 1.0)))
    assert np.max(np.abs(healthy.bodies - plant.bodies)) > 1e-2


def work_of(output: Any) -> float:
    works = output.positive_work + output.negative_work
    return float(np.sum(works)) + float(output.energy.dissipated)


@pytest.mark.parametrize("fault", ["weak", "limp", "locked"])
@pytest.mark.parametrize("stops", [0.0, 344.0])
def test_the_energy_audit_closes_over_a_fault_that_begins_and_ends(
    core: ct.CDLL, fault: str, stops: float
) -> None:
    robot = changed(load_robot("athena"), servo={"stop_stiffness": stops, "stop_damping": 2.0})
    plant = Plant(core, robot, **landing(robot))
    strength = {"weak": 0.2, "limp": 0.0, "locked": 1.0}[fault]
    dissipated = 0.0
    for k in range(120):
        begun = 20 <= k < 80
        power = Power(1.0, 1.0, 1.0 - begun * (1.0 - strength) * LF_LOST)
        command = replace(random_command(robot, k, size=0.3), power=power)
        lock = LF_LOST if begun and fault == "locked" else None
        plant.step(5e-3 * (k + 1), command, lock)
        output = plant.output(command)
        assert abs(output.energy.residual) < RESIDUAL * work_of(output)
        assert output.energy.dissipated >= dissipated  # no energy comes from a lock or a release
        dissipated = output.energy.dissipated


def test_a_locked_joint_stays_at_its_angle_and_yields_a_mrad_at_the_servos_torque(
    core: ct.CDLL,
) -> None:
    robot = load_robot("athena")
    plant = Plant(core, robot, speed=np.full((6, 3), 3.0))
    before = plant.output(plant.hold())
    plant.step(1e-9, lock=LF_LOST)
    begun = plant.output(plant.hold())
    assert begun.speed[0] == pytest.approx(before.speed[0], rel=1e-4)  # nothing jumps
    pulled = Command(angle_ref=robot.stance, torque_ref=np.full((6, 3), 100.0))
    for k in range(100):
        plant.step(0.01 * (k + 1), pulled, LF_LOST)
        moved = np.abs(plant.output(pulled).angle[0] - before.angle[0])
        assert np.max(moved) < 2e-2  # rad  what stops a joint of 3 rad/s
    assert np.max(moved) == pytest.approx(1e-3, rel=0.5)
    plant.step(1.2, pulled)
    assert np.max(np.abs(plant.output(pulled).angle[0] - before.angle[0])) > 0.1  # released


@pytest.mark.parametrize("share", [0.0, 0.25])
@pytest.mark.parametrize("drive", ["line", "motor"])
def test_a_weak_motor_gives_its_share_of_the_stall_torque(
    core: ct.CDLL, drive: str, share: float
) -> None:
    robot = load_robot("athena")
    robot = with_servo(robot, "mx64_m1") if drive == "motor" else robot
    command = replace(
        Command(angle_ref=robot.stance, torque_ref=np.full((6, 3), 100.0)),
        power=Power(1.0, 1.0, share),
    )
    stall = stall_torque(robot.servo) if drive == "motor" else robot.servo.torque_max
    output = Plant(core, robot).output(command)
    assert output.torque == pytest.approx(np.full((6, 3), share * stall), rel=1e-12)


def test_a_saved_state_continues_bit_for_bit_with_its_locks_and_a_failed_step_keeps_them(
    core: ct.CDLL,
) -> None:
    robot = load_robot("athena")
    command, lock = faulty(robot, 1)
    command = replace(command, power=Power(1.0, 1.0))
    plant, other = Plant(core, robot), Plant(core, robot)
    plant.step(0.01, command, lock)
    other.restore(plant.save())
    thrown = replace(command, push_force=np.full(3, 1e8), push_torque=np.full(3, 1e8))
    with pytest.raises(PlantError, match="limit of evaluations"):
        other.step(0.2, thrown, 1.0 - lock)
    for each in (plant, other):
        each.step(0.05, command, lock)
    assert plant.save() == other.save()


def test_events_set_weakness_and_lock_for_their_time() -> None:
    events = (
        "{time=0.01, leg='LM', joint='tibia', fault='weak', share=0.2, duration=0.01}, "
        "{time=0.02, leg='RR', joint='all', fault='limp'}, "
        "{time=0.03, leg='RR', joint='coxa', fault='locked', duration=0.01}"
    )
    scenario = load_scenario("walk_flat", overrides=["duration=0.05", f"events=[{events}]"])
    servos = make_schedule(scenario).servos
    assert servos is not None
    weakness, lock = np.moveaxis(servos.reshape(10, 2, 6, 3), 1, 0)
    assert weakness[:, 1, 2].tolist() == [0, 0, 0.8, 0.8, *6 * [0]]
    assert weakness[:, 5].T.tolist() == [[0] * 4 + [1, 1, 0, 0, 1, 1], *2 * [[0] * 4 + [1] * 6]]
    assert lock[:, 5, 0].tolist() == [*6 * [0], 1, 1, 0, 0]
    assert np.count_nonzero(lock) == 2
