"""Tests servos that give less than is commanded: weak, limp and locked ones by the twin's
equations, the energy audit, states and scenarios; limits of the motor and its firmware, of which
the plant and the twin have the same numbers to the last bit.
"""

from __future__ import annotations

import ctypes as ct
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from plant import Plant, PlantError, probed
from states import changed, landing, random_command
from test_laws_servo import tibias
from test_measured_servos import SAME, with_servo

from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.cosim.scenario.schedule import make_schedule
from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.actuator import feedback_gains, lock_joints
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.dynamics import Command
from hexapod_cosim.models.integrator import integrate
from hexapod_cosim.models.servos.motor import (
    FULL,
    Power,
    count_overload,
    duty_share,
    held_commands,
    motor_current,
    motor_torque,
    no_load_speed,
    overload_share,
    setpoint_rate,
    stall_torque,
)
from hexapod_cosim.models.servos.presets import measured_servo
from hexapod_cosim.models.step import start_state

RESIDUAL = 1e-4  # relative to what motors and pushes give and losses take
H = 1e-3  # s
LF_LOST = np.array([[1.0] * 3, *5 * [[0.0] * 3]])
SERVO = measured_servo("xl330_m4").servo


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


# the motor's limits


def test_the_current_stays_within_its_limit_where_the_duty_can_do_it() -> None:
    servo = replace(SERVO, current_max=0.4)
    most, wanted = no_load_speed(servo), np.linspace(-9.0, 9.0, 37) * stall_torque(servo)
    for speed in (0.0, 0.5 * most, -most):
        torque = motor_torque(servo, np.full(37, speed), wanted)
        assert np.abs(motor_current(servo, torque)).max() == pytest.approx(0.4, rel=1e-12)
    # turned faster than without a load, the motor brakes at full duty
    fast = motor_torque(servo, np.array([3.0 * most]), np.array([9.0]) * stall_torque(servo))
    assert fast == pytest.approx(-2.0 * stall_torque(servo), rel=1e-12)
    free = motor_torque(SERVO, np.array([1.0]), wanted[20:21])
    loose = replace(SERVO, current_max=1e3)
    assert motor_torque(loose, np.array([1.0]), wanted[20:21]).tobytes() == free.tobytes()


def test_a_motor_that_is_off_has_no_torque_and_a_driven_one_brakes() -> None:
    speed = np.array([2.0])
    assert motor_torque(SERVO, speed, np.zeros(1), Power(1.0, 1.0, 0.0)) == 0.0
    damping = SERVO.torque_constant**2 / SERVO.resistance
    assert motor_torque(SERVO, speed, np.zeros(1), FULL) == pytest.approx(-2.0 * damping)


# the firmware (eq. 57, 58)


def remembered(plant: Plant) -> Array:
    """Returns setpoints [rad], their rates [rad/s], times of overload [s], shares of duty limits
    [1] and angles held from the bus [rad], shape (5, 6, 3).
    """
    read = probed(plant.core.hx_probe_firmware, plant, size=5 * 3 * 8)
    return np.asarray(np.swapaxes(read.reshape(5, 3, 8)[..., :6], 1, 2))


def ends_of_calls(count: int, seed: int) -> list[float]:
    """Returns ends [s] of calls of different lengths, the first after 0 s."""
    lengths = np.random.default_rng(seed).uniform(1e-3, 2e-2, count)
    return [float(end) for end in np.cumsum(lengths)]


def test_a_setpoint_reaches_its_goal_after_the_way_over_the_speed(core: ct.CDLL) -> None:
    robot = changed(load_robot("athena"), servo={"goal_speed_max": 2.0})
    plant, goal = Plant(core, robot, angle=tibias(0.0)), Command(angle_ref=tibias(0.5))
    found = []
    for k in range(5):
        plant.step(0.1 * (k + 1), goal)
        found.append(remembered(plant)[:2, 3, 2])
    begun, rate = np.transpose(found)
    assert begun == pytest.approx([0.0, 0.2, 0.4, 0.5, 0.5], abs=1e-15)
    assert rate == pytest.approx([2.0, 2.0, 1.0, 0.0, 0.0], abs=1e-14)
    twin = setpoint_rate(robot.servo, np.array([0.4, 0.0, 0.6]), np.array([0.5, 0.5, -0.5]), 0.1)
    assert twin == pytest.approx([1.0, 2.0, -2.0], abs=1e-15)


def test_overload_leaves_its_share_after_its_time_until_the_duty_falls_or_turns(
    core: ct.CDLL,
) -> None:
    """The count of a call limits the next one; torque mode wants the torque that is commanded."""
    limits = {"overload_time": 0.09, "overload_duty": 0.8, "overload_left": 0.2, "duty_max": 1.0}
    robot = with_servo(load_robot("athena"), "mx64_m1", mode="torque", **limits)
    plant, full = Plant(core, robot), stall_torque(robot.servo)
    loaded, share = [], []
    for k, wanted in enumerate([0.9] * 6 + [-0.9, -0.8, 0.7, 0.81]):
        torque = tibias(wanted * full)
        plant.step(0.02 * (k + 1), Command(angle_ref=np.zeros((6, 3)), torque_ref=torque))
        loaded.append(remembered(plant)[2, 4, 2])
        share.append(remembered(plant)[3, 4, 2])
    times = [0.02, 0.04, 0.06, 0.08, 0.1, 0.12, -0.02, -0.04, 0.0, 0.02]
    assert loaded == pytest.approx(times, abs=1e-15)
    assert share == pytest.approx([1.0] * 5 + [0.2] * 2 + [1.0] * 3, abs=1e-15)


@pytest.mark.parametrize("mode", ["position", "torque"])
def test_the_firmware_remembers_what_the_twin_does_to_the_last_bit(
    core: ct.CDLL, mode: str
) -> None:
    """Over calls of different lengths that find hot, loaded and moving servos."""
    limits = {"overload_time": 0.02, "overload_duty": 0.02, "overload_left": 0.4}
    heat = {"winding_capacity": 5.0, "housing_capacity": 80.0, "winding_to_housing": 8.0}
    heat |= {"housing_to_air": 17.0, "start_temperature": 345.0}
    robot = with_servo(
        load_robot("athena"), "mx64_m6", mode=mode, goal_speed_max=1.5, **limits, **heat
    )
    plant, servo, start, h = Plant(core, robot, **landing(robot)), robot.servo, 0.0, 0.0
    setpoint, loaded = remembered(plant)[0], np.zeros((6, 3))
    rate, (kp, kd) = np.zeros((6, 3)), feedback_gains(servo)
    assert setpoint == pytest.approx(plant.output().angle, abs=1e-14)
    limited = []
    for k, end in enumerate(ends_of_calls(60, 2)):
        winding = plant.output().winding_temperature
        share = duty_share(servo, winding) * overload_share(servo, loaded)
        command = random_command(robot, k // 4, size=0.5)
        setpoint, h = setpoint + h * rate, end - start
        rate = setpoint_rate(servo, setpoint, command.angle_ref, h)
        plant.step(end, command)
        output = plant.output()
        lag = setpoint + h * rate - output.angle
        wanted = kp * lag + kd * (command.speed_ref - output.speed)
        loaded = np.asarray(count_overload(servo, wanted + command.torque_ref, loaded, h))
        start = end
        found = remembered(plant)
        assert np.array_equal(found[:3], [setpoint, rate, loaded])
        assert found[3] == pytest.approx(share, rel=SAME)
        limited.append(np.mean(np.abs(loaded) > 0.02))
    assert 0.05 < np.mean(limited) < 0.95


def test_servos_on_a_bus_hold_the_rounded_commands_that_the_twin_does(core: ct.CDLL) -> None:
    robot = changed(load_robot("athena"), servo={"bus_period": 0.01, "command_step": 0.0015})
    plant, time, held = Plant(core, robot), 0.0025 * np.arange(40.0), []
    angle = np.array([random_command(robot, k, size=0.2).angle_ref for k in range(len(time))])
    for k, command in enumerate(angle):
        plant.step(0.0025 * (k + 1), Command(angle_ref=command))
        held.append(remembered(plant)[4])
    assert np.array_equal(held, held_commands(robot.servo, time, angle))
    steps = np.array(held) / 0.0015
    assert steps == pytest.approx(np.round(steps), abs=1e-9)
    assert np.ptp(np.array(held)[:4], axis=0).max() == 0.0
