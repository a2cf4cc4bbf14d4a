"""The controller as a whole: from body command and measurement to joint commands."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from hexapod_cosim.controller import BodyCommand, Controller, ControllerError, Gains, Gait, Measurement, make_gait
from hexapod_cosim.controller.design import design_gains
from hexapod_cosim.models import GAITS, foot_positions, load_robot

PERIOD = 0.005  # s
ROUND_OFF = 1e-12  # rad
MIRROR = np.array([3, 4, 5, 0, 1, 2])  # legs seen in a mirror
MIRRORED_JOINT = np.array([-1.0, 1.0, 1.0])
ROBOTS = ("athena", "phantomx_mk4")


@cache
def designed(name: str) -> Gains:
    return design_gains(load_robot(name), PERIOD)


def make(name: str = "athena", *, gait: Gait | None = None, compliant: bool = False) -> Controller:
    robot = load_robot(name)
    gains = designed(robot.name) if compliant else None
    return Controller(robot, period=PERIOD, gait=make_gait(robot) if gait is None else gait, gains=gains)


def run(controller: Controller, command: BodyCommand, steps: int, *, first: int = 0, measurement: Measurement | None = None) -> np.ndarray:
    """(steps, 2, 6, 3) angle_ref and speed_ref of consecutive steps."""
    found = []
    for k in range(first, first + steps):
        out = controller.step(k * PERIOD, command, measurement or Measurement())
        found.append(np.stack([out.angle_ref, out.speed_ref]))
    return np.array(found)


def squeezed(generator: np.random.Generator | None = None) -> Measurement:
    """A measurement with all feet on the ground and unequal forces."""
    measurement = Measurement(contact=np.ones(6, dtype=bool))
    measurement.foot_force[:] = (generator or np.random.default_rng(4)).normal(size=(6, 3)) * 2.0 + [0.0, 0.0, 9.0]
    return measurement


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("compliant", [False, True])
def test_the_first_command_is_the_stance(name: str, compliant: bool) -> None:
    controller = make(name, compliant=compliant)
    out = controller.step(0.0, BodyCommand(vx=0.08), Measurement())
    if not compliant:
        np.testing.assert_allclose(out.angle_ref, load_robot(name).stance, atol=ROUND_OFF)
        assert not out.speed_ref.any()
    assert not out.torque_ref.any()


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("gait", GAITS)
def test_a_walk_starts_and_ends_in_the_stance_without_jumps(name: str, gait: str) -> None:
    robot = load_robot(name)
    timing = make_gait(robot, gait, step_height=0.02)
    controller, cycle = make(name, gait=timing), round(timing.period / PERIOD)
    walk = run(controller, BodyCommand(vx=0.02, yaw_rate=0.03), 2 * cycle)
    stop = run(controller, BodyCommand(), 4 * cycle, first=2 * cycle)
    angle = np.concatenate([walk, stop])[:, 0]
    np.testing.assert_allclose(angle[-1], robot.stance, atol=ROUND_OFF)
    np.testing.assert_allclose(angle[-1], angle[-200], atol=0.0)
    assert not controller.paths.walking
    assert np.abs(np.diff(angle, axis=0)).max() < robot.servo.speed_max * PERIOD * 1.3
    assert np.abs(np.diff(angle, 2, axis=0)).max() < 200.0 * PERIOD**2  # rad/s2; a jump of speed would be of order 1 rad/s
    again = run(controller, BodyCommand(vx=0.02, yaw_rate=0.03), cycle, first=6 * cycle)
    np.testing.assert_allclose(again[:, 0], angle[1 : cycle + 1], atol=1e-6)  # the clock starts at the same phase


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("command", [BodyCommand(vx=0.05), BodyCommand(vy=0.04), BodyCommand(yaw_rate=0.2), BodyCommand(0.03, -0.02, -0.1)])
def test_the_contact_points_of_standing_feet_rest_on_the_ground(name: str, command: BodyCommand) -> None:
    """FK of the commanded angles: foot centres, plus what their spheres roll, move by minus the body's twist."""
    robot = load_robot(name)
    controller = make(name)
    run(controller, command, 600)
    worst, compared = 0.0, 0
    before, swinging = None, controller.diagnostics.swinging.copy()
    for k in range(600, 900):
        out = controller.step(k * PERIOD, command, Measurement())
        foot = foot_positions(robot, out.angle_ref)[:, :2] @ [1.0, 1.0j]
        heading = np.exp(1j * (np.array([leg.hip_yaw for leg in robot.legs]) + out.angle_ref[:, 0]))
        pitch = out.angle_ref[:, 1] - out.angle_ref[:, 2]
        if before is not None:
            rolled = robot.foot.radius * (pitch - before[1]) * heading
            middle = 0.5 * (foot + before[0])
            over_ground = (foot - before[0] + rolled) / PERIOD + complex(command.vx, command.vy) + 1j * command.yaw_rate * middle
            still = ~swinging & ~controller.diagnostics.swinging
            worst, compared = max(worst, float(np.abs(over_ground[still]).max(initial=0.0))), compared + int(still.sum())
        before, swinging = (foot, pitch), controller.diagnostics.swinging.copy()
    assert compared > 600
    # roll is followed one period late, and headings turn meanwhile: R dB dpsi/dt ~ 0.015 m x 0.4 x 0.5 /s; the body moves at 50 mm/s
    assert worst < 3e-3


@pytest.mark.parametrize("compliant", [False, True])
def test_speed_ref_is_the_slope_of_angle_ref(compliant: bool) -> None:
    controller = make(compliant=compliant)
    walk = run(controller, BodyCommand(vx=0.08, roll=0.05, pitch=-0.03, height=0.01), 800)
    slope = np.diff(walk[:, 0], axis=0) / PERIOD
    mean = 0.5 * (walk[1:, 1] + walk[:-1, 1])
    assert np.abs(slope - mean)[20:].max() < 0.05  # rad/s    of speeds up to 3: trapezoid's error and the roll's delay


@pytest.mark.parametrize("compliant", [False, True])
def test_a_mirrored_command_gives_mirrored_joints(compliant: bool) -> None:
    robot = load_robot("athena")
    gait = make_gait(robot, "ripple")
    mirrored_gait = replace(gait, offsets=tuple(np.array(gait.offsets)[MIRROR]))
    measurement = squeezed()
    mirrored = Measurement(contact=measurement.contact)
    mirrored.foot_force[:] = measurement.foot_force[MIRROR] * [1.0, -1.0, 1.0]
    command, other = BodyCommand(0.05, 0.02, 0.1, 0.01, 0.05, 0.03), BodyCommand(0.05, -0.02, -0.1, 0.01, -0.05, 0.03)
    left = run(make(gait=gait, compliant=compliant), command, 500, measurement=measurement)
    right = run(make(gait=mirrored_gait, compliant=compliant), other, 500, measurement=mirrored)
    np.testing.assert_allclose(right, left[:, :, MIRROR] * MIRRORED_JOINT, atol=1e-9)


@pytest.mark.parametrize("compliant", [False, True])
def test_the_same_inputs_give_the_same_bits_and_reset_starts_afresh(compliant: bool) -> None:
    controller = make(compliant=compliant)
    first = run(controller, BodyCommand(vx=0.08), 300, measurement=squeezed())
    controller.reset()
    np.testing.assert_array_equal(run(controller, BodyCommand(vx=0.08), 300, measurement=squeezed()), first)
    np.testing.assert_array_equal(run(make(compliant=compliant), BodyCommand(vx=0.08), 300, measurement=squeezed()), first)


@pytest.mark.parametrize("compliant", [False, True])
def test_a_restored_controller_goes_on_bit_for_bit(compliant: bool) -> None:
    controller, command = make(compliant=compliant), BodyCommand(0.05, 0.02, 0.2, 0.01, 0.05)
    fresh = controller.save()
    start = run(controller, BodyCommand(vx=0.08), 130, measurement=squeezed())
    run(controller, command, 67, first=130, measurement=squeezed())  # the ramp and a planned swing are under way
    state = controller.save()
    first = run(controller, command, 300, first=197, measurement=squeezed())
    run(controller, BodyCommand(vy=-0.03), 100, first=497, measurement=squeezed())
    controller.restore(state)
    np.testing.assert_array_equal(run(controller, command, 300, first=197, measurement=squeezed()), first)
    controller.restore(fresh)
    np.testing.assert_array_equal(run(controller, BodyCommand(vx=0.08), 130, measurement=squeezed()), start)
    other = make(compliant=compliant)
    other.restore(state)
    np.testing.assert_array_equal(run(other, command, 300, first=197, measurement=squeezed()), first)


@pytest.mark.parametrize("compliant", [False, True])
def test_commands_do_not_depend_on_how_many_steps_are_planned_at_once(compliant: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    walks = []
    for planned in (1, 11, 1000):
        monkeypatch.setattr("hexapod_cosim.controller.controller.PLANNED", planned)
        controller, parts, first = make(compliant=compliant), [], 0
        for command, steps in ((BodyCommand(vx=0.08), 333), (BodyCommand(0.03, 0.01, 0.2, roll=0.1), 250), (BodyCommand(), 600)):
            parts.append(run(controller, command, steps, first=first, measurement=squeezed()))
            first += steps
        walks.append(np.concatenate(parts))
    np.testing.assert_array_equal(walks[1], walks[0])
    np.testing.assert_array_equal(walks[2], walks[0])


def test_kinematic_control_does_not_look_at_the_forces() -> None:
    np.testing.assert_array_equal(
        run(make(), BodyCommand(vx=0.08), 200, measurement=squeezed()), run(make(), BodyCommand(vx=0.08), 200, measurement=Measurement())
    )


def test_the_corrections_are_added_to_the_feet_before_the_inverse_kinematics() -> None:
    robot = load_robot("athena")
    controller = make(compliant=True)
    for k in range(30):
        out = controller.step(k * PERIOD, BodyCommand(), squeezed())
    shown = controller.diagnostics
    feet = foot_positions(robot, out.angle_ref)
    home = foot_positions(robot, robot.stance)
    assert np.abs(shown.shift).max() > 1e-4
    np.testing.assert_allclose(feet[:, :2] @ [1.0, 1.0j], home[:, :2] @ [1.0, 1.0j] + shown.shift + controller.rolled, atol=1e-9)
    np.testing.assert_allclose(feet[:, 2], home[:, 2] + shown.lift, atol=1e-9)


def test_forces_are_judged_in_the_torsos_axes() -> None:
    """Turning robot and forces together in the world changes nothing."""
    yaw, straight = 0.7, squeezed()
    turned = squeezed()
    c, s = np.cos(yaw), np.sin(yaw)
    turned.foot_force[:] = straight.foot_force @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    turned.quaternion[:] = [np.cos(yaw / 2.0), 0.0, 0.0, np.sin(yaw / 2.0)]
    plain, rotated = (run(make(compliant=True), BodyCommand(vx=0.05), 200, measurement=m) for m in (straight, turned))
    np.testing.assert_allclose(rotated, plain, atol=1e-9)


def test_posture_and_height_turn_and_lift_the_torso_over_its_feet() -> None:
    robot, controller = load_robot("athena"), make()
    command = BodyCommand(height=0.02, roll=0.1, pitch=-0.15)
    angle = run(controller, command, 1200)[-1, 0]
    cr, sr, cp, sp = np.cos(0.1), np.sin(0.1), np.cos(-0.15), np.sin(-0.15)
    turn = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]]) @ np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
    on_ground = foot_positions(robot, angle) @ turn.T + [0.0, 0.0, 0.02]
    home = foot_positions(robot, robot.stance)
    np.testing.assert_allclose(on_ground[:, 2], home[:, 2], atol=1e-9)
    np.testing.assert_allclose(on_ground[:, :2], home[:, :2], atol=0.015)  # the feet roll: R times the tibias' change of pitch


def test_a_leg_that_cannot_follow_is_flagged_and_stays_within_its_limits() -> None:
    robot, controller = load_robot("athena"), make()
    angle = run(controller, BodyCommand(height=0.25), 400)[-1, 0]
    assert controller.diagnostics.unreachable.all()
    assert (angle >= robot.angle_min).all()
    assert (angle <= robot.angle_max).all()


def test_the_buffers_are_reused() -> None:
    controller = make()
    first = controller.step(0.0, BodyCommand(), Measurement())
    assert controller.step(PERIOD, BodyCommand(), Measurement()) is first


@pytest.mark.parametrize("t", [PERIOD, 2.5 * PERIOD, float("nan")])
def test_a_step_out_of_time_is_refused(t: float) -> None:
    controller = make()
    controller.step(0.0, BodyCommand(), Measurement())
    controller.step(PERIOD, BodyCommand(), Measurement())
    with pytest.raises(ControllerError, match="step out of time"):
        controller.step(t, BodyCommand(), Measurement())


@pytest.mark.parametrize("period", [0.0, -0.01, 0.5, float("nan")])
def test_an_impossible_period_is_refused(period: float) -> None:
    robot = load_robot("athena")
    with pytest.raises(ControllerError, match="impossible controller period"):
        Controller(robot, period=period, gait=make_gait(robot))


def test_gains_of_another_robot_or_period_warn() -> None:
    athena, phantom = load_robot("athena"), load_robot("phantomx_mk4")
    gains = designed("athena")
    assert Controller(athena, period=PERIOD, gait=make_gait(athena), gains=gains).warnings == ()
    assert "athena" in Controller(phantom, period=PERIOD, gait=make_gait(phantom), gains=gains).warnings[0]
    assert "0.004" in Controller(athena, period=0.004, gait=make_gait(athena), gains=gains).warnings[0]
