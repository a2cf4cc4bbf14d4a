"""A command that is too fast for the joints slows the body (C59)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from controllers import make
from gains import PERIOD

from hexapod_cosim.controller import BodyCommand, Controller, Measurement, make_gait
from hexapod_cosim.controller.walk.pace import FASTEST
from hexapod_cosim.models import load_robot

POINTED = 1e-6  # m    radius of feet that hardly roll, as the law has them
UNSEEN = 0.03  # 1    by which the largest of 16 samples of a swing is below its peak, at most
RESOLUTION = 2e-3  # 1    of the joint speed: steps of the share of 6e-5, next to a straight leg


def needed(controller: Controller, command: BodyCommand) -> np.ndarray:
    """Returns the joint speeds (6,) that a command needs [1]."""
    value = np.array([command.vx, command.vy, command.yaw_rate, command.height, 0.0, 0.0])
    plan = controller.plan
    return plan.pace.needed(value, plan.paths.home, 0j)


def walked(controller: Controller, command: BodyCommand) -> BodyCommand:
    """Returns the command that the body is led to."""
    controller.plan.aim(command)
    return controller.plan.ramp.target


@pytest.mark.parametrize("gait", ["tripod", "amble", "wave"])
@pytest.mark.parametrize(
    "command",
    [
        BodyCommand(vx=0.06),
        BodyCommand(vx=-0.03, vy=0.02, yaw_rate=0.05, height=-0.01),
        BodyCommand(yaw_rate=0.2),
    ],
)
def test_the_speeds_are_those_of_the_settled_walk(gait: str, command: BodyCommand) -> None:
    robot = load_robot("athena")
    robot = replace(robot, foot=replace(robot.foot, radius=POINTED))
    timing = make_gait(robot, gait)
    count = round(timing.period / PERIOD)
    controller, most = Controller(robot, period=PERIOD, gait=timing), np.zeros(6)
    for step in range(3 * count):
        out = controller.step(step * PERIOD, command, Measurement())
        if step >= 2 * count:
            most = np.maximum(most, np.abs(out.speed_ref).max(axis=1))
    share = needed(controller, command) / (most / robot.servo.speed_max)
    assert (share > 1.0 - UNSEEN).all()
    assert (share < 1.0 + 1e-3).all()


def test_a_body_on_the_spot_needs_what_lifts_its_feet() -> None:
    """All legs of Athena stand in the same pose. A step in half the time is twice as fast."""
    controller = make(gait=make_gait(load_robot("athena"), "tripod"))
    slow = needed(controller, BodyCommand())
    fast = needed(make(gait=make_gait(load_robot("athena"), "tripod", period=0.5)), BodyCommand())
    np.testing.assert_allclose(slow, 0.433, atol=1e-3)
    np.testing.assert_allclose(fast, 2.0 * slow, rtol=1e-12)


@pytest.mark.parametrize("gait", ["tripod", "amble", "wave"])
@pytest.mark.parametrize(
    "command", [BodyCommand(vx=0.7), BodyCommand(0.2, -0.5, 0.9), BodyCommand(yaw_rate=-2.0)]
)
def test_a_command_that_is_too_fast_is_walked_at_the_share_that_the_joints_can_follow(
    gait: str, command: BodyCommand
) -> None:
    controller = make(gait=make_gait(load_robot("athena"), gait))
    target = walked(controller, replace(command, height=0.01))
    share = np.hypot(np.hypot(target.vx, target.vy), target.yaw_rate) / np.hypot(
        np.hypot(command.vx, command.vy), command.yaw_rate
    )
    scaled = [share * command.vx, share * command.vy, share * command.yaw_rate]
    np.testing.assert_allclose([target.vx, target.vy, target.yaw_rate], scaled, rtol=1e-12)
    assert target.height == 0.01
    assert FASTEST - RESOLUTION < needed(controller, target).max() <= FASTEST
    assert controller.plan.pace.outrun.any()


def test_a_command_within_the_limits_is_not_changed() -> None:
    controller = make()
    for command in (BodyCommand(vx=0.3), BodyCommand(0.05, 0.02, 0.2, 0.01, 0.05, 0.05)):
        assert walked(controller, command) == command
        assert not controller.plan.pace.outrun.any()


def test_the_speed_has_no_step_at_the_limit() -> None:
    limit = walked(make(), BodyCommand(vx=1.0)).vx
    assert limit == pytest.approx(0.331, abs=1e-3)
    for wanted in np.linspace(0.9, 1.3, 9) * limit:
        assert walked(make(), BodyCommand(vx=wanted)).vx == pytest.approx(
            min(wanted, limit), abs=1e-4
        )


def test_a_gait_whose_steps_on_the_spot_are_too_fast_still_gets_ahead() -> None:
    robot = load_robot("athena")
    quick = make(gait=make_gait(robot, "tripod", period=0.3))
    assert needed(quick, BodyCommand()).max() > FASTEST
    assert walked(quick, BodyCommand(vx=0.1)) == BodyCommand(vx=0.1)


def test_a_change_of_gait_slows_a_body_that_is_too_fast_for_the_next_one() -> None:
    robot, controller = load_robot("athena"), make()
    command, shown = BodyCommand(vx=0.2), controller.diagnostics
    step = 0

    def go(count: int) -> None:
        nonlocal step
        for _ in range(count):
            controller.step(step * PERIOD, command, Measurement())
            step += 1

    go(300)
    assert controller.plan.ramp.target == command
    assert not shown.outrun.any()
    controller.change_gait(make_gait(robot, "wave"))
    go(600)
    assert 0.06 < controller.plan.ramp.target.vx < 0.1
    assert shown.outrun.all()
    controller.change_gait(make_gait(robot, "tripod"))
    go(1200)
    assert controller.plan.ramp.target == command
    assert not shown.outrun.any()


def test_a_leg_that_does_not_walk_limits_nothing() -> None:
    plan = make().plan
    away = plan.paths.home.copy()
    away[0] += 0.2  # farther than the leg reaches
    command, out = BodyCommand(vx=0.1), np.arange(6) == 0
    assert plan.pace.follow(command, away, 0j, out) == command
    assert plan.pace.follow(command, away, 0j, ~out).vx < 0.1
    assert plan.pace.outrun.tolist() == [True, False, False, False, False, False]
