"""Tests the whole controller, from body command and measurement to joint commands."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from controllers import make, obey, run, squeezed
from gains import PERIOD, make_gains

from hexapod_cosim.controller import (
    BodyCommand,
    Controller,
    ControllerError,
    Measurement,
    make_gait,
)
from hexapod_cosim.models import GAITS, foot_positions, load_robot
from hexapod_cosim.models.kinematics import quaternion_product

ROUND_OFF = 1e-12  # rad
LOWERED = 5e-5  # rad; some hundredths of a millimetre over 0.1 m
MIRROR = np.array([3, 4, 5, 0, 1, 2])  # legs exchanged by mirroring
MIRRORED_JOINT = np.array([-1.0, 1.0, 1.0])
ROBOTS = ("athena", "phantomx_mk4")


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("compliant", [False, True])
def test_the_first_command_is_the_stance(name: str, compliant: bool) -> None:
    """Under compliant control the first command also contains the deflection of the ground and
    torques for the weight of the legs.

    The support grows with the measured weight.
    """
    robot, controller = load_robot(name), make(name, compliant=compliant)
    out = controller.step(0.0, BodyCommand(vx=0.08), Measurement(angle=robot.stance))
    np.testing.assert_allclose(
        out.angle_ref, robot.stance, atol=LOWERED if compliant else ROUND_OFF
    )
    assert not out.speed_ref.any()
    assert out.torque_ref.any() == compliant
    assert (
        np.abs(out.torque_ref).max() < 9.81 * sum(link.mass for link in robot.legs[0].links) * 0.1
    )  # N m; lever of 0.1 m for the centres of mass of the legs


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
    assert not controller.plan.paths.clock.walking
    assert np.abs(np.diff(angle, axis=0)).max() < robot.servo.speed_max * PERIOD * 1.3
    assert (
        np.abs(np.diff(angle, 2, axis=0)).max() < 200.0 * PERIOD**2
    )  # rad/s2; a jump of the speed would be of order 1 rad/s
    again = run(controller, BodyCommand(vx=0.02, yaw_rate=0.03), cycle, first=6 * cycle)
    np.testing.assert_allclose(
        again[:, 0], angle[1 : cycle + 1], atol=1e-6
    )  # the gait's clock starts at the same phase


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize(
    "command",
    [
        BodyCommand(vx=0.05),
        BodyCommand(vy=0.04),
        BodyCommand(yaw_rate=0.2),
        BodyCommand(0.03, -0.02, -0.1),
    ],
)
def test_the_contact_points_of_standing_feet_rest_on_the_ground(
    name: str, command: BodyCommand
) -> None:
    """The forward kinematics of the commanded angles give the feet's centres. With the rolling of
    their spheres they move by minus the body's twist.
    """
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
            over_ground = (
                (foot - before[0] + rolled) / PERIOD
                + complex(command.vx, command.vy)
                + 1j * command.yaw_rate * middle
            )
            still = ~swinging & ~controller.diagnostics.swinging
            worst, compared = (
                max(worst, float(np.abs(over_ground[still]).max(initial=0.0))),
                compared + int(still.sum()),
            )
        before, swinging = (foot, pitch), controller.diagnostics.swinging.copy()
    assert compared > 600
    # rolling is solved by one Newton step, a chord lacks h^2/24 of its arc, and the heading turns
    # during a step; the body moves at 50 mm/s
    assert worst < 3e-4


@pytest.mark.parametrize("gait", GAITS)
def test_speed_and_acceleration_lead_from_each_angle_to_the_next(gait: str) -> None:
    """q + qd h + qdd h^2/2 is the next q, except where a leg lifts off or touches down in the next
    step.

    There qdd is that of the period before. The error is its change, h^3/3 times up to 4e4 rad/s3 in
    the quick swings of the wave gait.
    """
    controller, missed, accelerations = make(gait=make_gait(load_robot("athena"), gait)), [], []
    before = None
    for k in range(1200):
        out = controller.step(k * PERIOD, BodyCommand(vx=0.05, yaw_rate=0.1), Measurement())
        if before is not None:
            missed.append(np.abs(out.angle_ref - before).max())
        before = out.angle_ref + PERIOD * out.speed_ref + 0.5 * PERIOD**2 * out.acceleration_ref
        accelerations.append(np.abs(out.acceleration_ref).max())
    exact = np.array(missed) < 1e-12
    assert exact.mean() > 0.95
    assert max(missed) < 2e-3  # rad
    assert 5.0 < max(accelerations) < 200.0  # rad/s2


@pytest.mark.parametrize("compliant", [False, True])
def test_speed_ref_is_the_slope_of_angle_ref(compliant: bool) -> None:
    controller = make(compliant=compliant)
    walk = obey(controller, BodyCommand(vx=0.08, height=0.01), 800)
    slope = np.diff(walk[:, 0], axis=0) / PERIOD
    mean = 0.5 * (walk[1:, 1] + walk[:-1, 1])
    assert np.abs(slope - mean)[20:].max() < (
        0.1 if compliant else 0.05
    )  # rad/s, of speeds up to 3; the error of the trapezoidal rule; slow loops run every 40 ms


def test_a_robot_that_does_what_is_planned_is_hardly_corrected() -> None:
    controller, kinematic = make(compliant=True), make()
    corrected, plain = (
        obey(controller, BodyCommand(vx=0.08), 800),
        obey(kinematic, BodyCommand(vx=0.08), 800),
    )
    assert (
        np.abs(corrected[:, 0] - plain[:, 0])[600:].max() < 8e-3
    )  # rad; 0.8 mm, half of which is the deflection of the ground
    shown = controller.diagnostics
    assert not shown.fallback.any()
    assert controller.compliant is not None
    assert controller.compliant.laws.scale == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("compliant", [False, True])
def test_a_mirrored_command_gives_mirrored_joints(compliant: bool) -> None:
    robot = load_robot("athena")
    gait = make_gait(robot, "ripple")
    mirrored_gait = replace(gait, offsets=tuple(np.array(gait.offsets)[MIRROR]))
    measurement = squeezed()
    mirrored = Measurement(contact=measurement.contact)
    mirrored.foot_force[:] = measurement.foot_force[MIRROR] * [1.0, -1.0, 1.0]
    mirrored.angle[:] = measurement.angle[MIRROR] * MIRRORED_JOINT
    mirrored.quaternion[:] = measurement.quaternion * [1.0, -1.0, 1.0, -1.0]
    command, other = (
        BodyCommand(0.05, 0.02, 0.1, 0.01, 0.05, 0.03),
        BodyCommand(0.05, -0.02, -0.1, 0.01, -0.05, 0.03),
    )
    left = run(make(gait=gait, compliant=compliant), command, 500, measurement=measurement)
    right = run(make(gait=mirrored_gait, compliant=compliant), other, 500, measurement=mirrored)
    np.testing.assert_allclose(right, left[:, :, MIRROR] * MIRRORED_JOINT, atol=1e-9)


@pytest.mark.parametrize("compliant", [False, True])
def test_the_same_inputs_give_the_same_bits_and_reset_starts_afresh(compliant: bool) -> None:
    controller = make(compliant=compliant)
    first = run(controller, BodyCommand(vx=0.08), 300, measurement=squeezed())
    controller.reset()
    np.testing.assert_array_equal(
        run(controller, BodyCommand(vx=0.08), 300, measurement=squeezed()), first
    )
    np.testing.assert_array_equal(
        run(make(compliant=compliant), BodyCommand(vx=0.08), 300, measurement=squeezed()), first
    )


@pytest.mark.parametrize("compliant", [False, True])
def test_a_restored_controller_goes_on_bit_for_bit(compliant: bool) -> None:
    controller, command = make(compliant=compliant), BodyCommand(0.05, 0.02, 0.2, 0.01, 0.05)
    fresh = controller.save()
    start = run(controller, BodyCommand(vx=0.08), 130, measurement=squeezed())
    run(
        controller, command, 67, first=130, measurement=squeezed()
    )  # the ramp and a planned swing are in progress
    state = controller.save()
    first = run(controller, command, 300, first=197, measurement=squeezed())
    run(controller, BodyCommand(vy=-0.03), 100, first=497, measurement=squeezed())
    controller.restore(state)
    np.testing.assert_array_equal(
        run(controller, command, 300, first=197, measurement=squeezed()), first
    )
    controller.restore(fresh)
    np.testing.assert_array_equal(
        run(controller, BodyCommand(vx=0.08), 130, measurement=squeezed()), start
    )
    other = make(compliant=compliant)
    other.restore(state)
    np.testing.assert_array_equal(
        run(other, command, 300, first=197, measurement=squeezed()), first
    )


def test_kinematic_control_does_not_look_at_the_forces() -> None:
    np.testing.assert_array_equal(
        run(make(), BodyCommand(vx=0.08), 200, measurement=squeezed()),
        run(make(), BodyCommand(vx=0.08), 200, measurement=Measurement()),
    )


def test_the_planned_feet_are_where_kinematic_control_sends_them() -> None:
    """While walking, turning and leaning the commanded angles put each foot's centre on the plan.
    The corrections of compliance are not part of the plan.
    """
    controller, robot = make(), load_robot("athena")
    stance = foot_positions(robot, robot.stance)
    farthest = 0.0
    for k in range(600):
        out = controller.step(
            k * PERIOD,
            BodyCommand(vx=0.06, yaw_rate=0.1, height=0.01, roll=0.04, pitch=-0.03),
            Measurement(),
        )
        np.testing.assert_allclose(
            foot_positions(robot, out.angle_ref), controller.diagnostics.planned, atol=1e-9
        )
        farthest = max(farthest, float(np.abs(controller.diagnostics.planned - stance).max()))
    assert farthest > 0.03


def test_forces_are_judged_in_the_torsos_axes() -> None:
    """Turning the robot and the forces together in the world changes nothing."""
    yaw, straight = 0.7, squeezed()
    turned = squeezed()
    c, s = np.cos(yaw), np.sin(yaw)
    turned.foot_force[:] = straight.foot_force @ np.array(
        [[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]
    )
    turned.quaternion[:] = quaternion_product(
        np.array([np.cos(yaw / 2.0), 0.0, 0.0, np.sin(yaw / 2.0)]), straight.quaternion
    )
    command = BodyCommand(vx=0.05, roll=0.05, pitch=-0.03)
    plain, rotated = (
        run(make(compliant=True), command, 200, measurement=m) for m in (straight, turned)
    )
    np.testing.assert_allclose(rotated, plain, atol=1e-9)


def test_a_leg_that_cannot_follow_is_flagged_and_stays_within_its_limits() -> None:
    robot, controller = load_robot("athena"), make()
    angle = run(controller, BodyCommand(height=0.25), 400)[-1, 0]
    assert controller.diagnostics.unreachable.all()
    assert (angle >= robot.angle_min).all()
    assert (angle <= robot.angle_max).all()


def test_feet_that_give_up_an_offset_at_once_keep_to_the_speed_of_the_joints() -> None:
    controller = make(compliant=True)
    run(controller, BodyCommand(vx=0.05), 150)
    assert controller.compliant is not None
    controller.compliant.offset, controller.compliant.moving = np.full(6, 0.03), True
    out = controller.step(150 * PERIOD, BodyCommand(vx=0.05), Measurement())
    assert np.abs(out.speed_ref).max() == controller.robot.servo.speed_max


@pytest.mark.parametrize("t", [PERIOD, 2.5 * PERIOD, float("nan")])
def test_a_step_out_of_time_is_refused(t: float) -> None:
    controller = make()
    controller.step(0.0, BodyCommand(), Measurement())
    controller.step(PERIOD, BodyCommand(), Measurement())
    with pytest.raises(ControllerError, match="step out of time"):
        controller.step(t, BodyCommand(), Measurement())


def test_a_first_step_at_no_time_and_a_state_of_nothing_are_refused() -> None:
    controller = make()
    with pytest.raises(ControllerError, match=r"got nan, expected a finite time \[s\]"):
        controller.step(float("nan"), BodyCommand(), Measurement())
    with pytest.raises(ControllerError, match=r"not a controller's state: got 'no .*gait"):
        controller.restore({})


@pytest.mark.parametrize("period", [0.0, -0.01, 0.5, float("nan")])
def test_an_impossible_period_is_refused(period: float) -> None:
    robot = load_robot("athena")
    with pytest.raises(ControllerError, match="impossible controller period"):
        Controller(robot, period=period, gait=make_gait(robot))


def test_gains_of_another_robot_or_period_warn() -> None:
    athena, phantom = load_robot("athena"), load_robot("phantomx_mk4")
    gains = make_gains(athena)
    assert Controller(athena, period=PERIOD, gait=make_gait(athena), gains=gains).warnings == ()
    assert (
        "athena"
        in Controller(phantom, period=PERIOD, gait=make_gait(phantom), gains=gains).warnings[0]
    )
    assert (
        "0.004" in Controller(athena, period=0.004, gait=make_gait(athena), gains=gains).warnings[0]
    )
