"""Tests that torque references do not jump when feet touch down or lift off, nor when a walk begins
or ends, and that the feet do not jump when the gait changes.
"""

from __future__ import annotations

import ctypes as ct
from functools import cache
from itertools import permutations

import numpy as np
import pytest
from gains import make_gains
from native_controller import NativeController

from hexapod_cosim.controller import (
    PATTERNS,
    BodyCommand,
    Controller,
    ControllerError,
    Gait,
    Measurement,
    make_gait,
)
from hexapod_cosim.cosim.interface.controller import ControllerSetup
from hexapod_cosim.models import load_robot

PERIODS = {"tripod": (0.002, 0.001), "ripple": (0.004,)}  # s
LARGEST = {
    "athena": 3.2,
    "phantomx_mk4": 1.7,
}  # N m; of 5.4 and 2.7 allowed: load of the middle leg of a tripod, and gear friction
STANDING, WALKING = 0.2, 2.4  # s
STOPPING = 2.5  # cycles


@cache
def torques(name: str, gait: str, period: float) -> np.ndarray:
    """Returns torque_ref (steps, 6, 3) [N m] of a robot that stands, walks and stops exactly as
    planned.

    Its weight is known from the start.
    """
    robot = load_robot(name)
    timing = make_gait(robot, gait)
    controller = Controller(
        robot, period=period, gait=timing, gains=make_gains(robot, period=period)
    )
    compliant, measurement, found = (
        controller.compliant,
        Measurement(angle=controller.stance.copy()),
        [],
    )
    assert compliant is not None
    compliant.laws.scale = 1.0
    for k in range(round((STANDING + WALKING + STOPPING * timing.period) / period)):
        walks = STANDING <= k * period < STANDING + WALKING
        out = controller.step(
            k * period, BodyCommand(vx=0.04, yaw_rate=0.05) if walks else BodyCommand(), measurement
        )
        found.append(out.torque_ref.copy())
        measurement.foot_force[:] = compliant.present.load.shares.forces()
        measurement.angle[:] = out.angle_ref
    assert not controller.plan.paths.clock.walking
    return np.array(found)


def steepest(name: str, gait: str, period: float) -> float:
    """Returns the largest change of a torque in a period [N m], once the walk is under way."""
    under_way = slice(round((STANDING + 1.2) / period), round((STANDING + WALKING) / period))
    return float(np.abs(np.diff(torques(name, gait, period)[under_way], axis=0)).max())


@pytest.mark.parametrize(("gait", "name"), [("tripod", "athena"), ("ripple", "phantomx_mk4")])
def test_the_largest_torque_is_what_the_load_needs_whatever_the_period(
    gait: str, name: str
) -> None:
    for period in PERIODS[gait]:
        assert np.abs(torques(name, gait, period)).max() < LARGEST[name]


def test_torques_are_continuous_over_touch_downs_and_lift_offs() -> None:
    """A hand-over changes 3 N m by at most 1.9/0.05 s, which is 0.11 N m in 1 ms.

    Gear friction that reverses, and feet that begin to press into the ground, add to it.
    """
    coarse, fine = (steepest("athena", "tripod", period) for period in PERIODS["tripod"])
    assert coarse < 0.6
    assert fine < min(0.3, 0.75 * coarse)


# ------------------------------------------------------------------------------ changes of gait

STEP = 0.005  # s
CURVE = BodyCommand(vx=0.015, yaw_rate=0.02)  # 0.28 of the largest commands of the wave
MOMENTS = (0.1, 0.45, 0.8)  # of the gait period
STANDS = Measurement(angle=load_robot("athena").stance.copy())


def feet_over_a_change(core: ct.CDLL, first: Gait, then: Gait, moment: float) -> tuple[float, ...]:
    """Returns the largest way of a foot in a period before and after a change of gait, and the
    largest change of such ways [m].

    Asserts that no leg reaches its limits.
    """
    robot = load_robot("athena")
    controller = NativeController(core, ControllerSetup(robot=robot, gait=first, period=STEP))
    change = round((1.5 + moment) * first.period / STEP)
    feet = []
    for k in range(change + round(2.5 * then.period / STEP)):
        if k == change:
            controller.change_gait(then)
        out = controller.step(k * STEP, CURVE, STANDS)
        assert not any(out.unreachable)
        feet.append(np.array(np.ctypeslib.as_array(out.planned)))
    ways = np.diff(feet, axis=0)
    length = np.linalg.norm(ways, axis=2).max(axis=1)
    jump = np.linalg.norm(np.diff(ways, axis=0), axis=2).max(axis=1)
    here = change - 1
    return tuple(
        float(part.max()) for part in (length[:here], length[here:], jump, jump[: here - 1])
    )


@pytest.mark.parametrize("pair", list(permutations(PATTERNS, 2)), ids="-".join)
def test_feet_do_not_jump_when_the_gait_changes(
    controller_core: ct.CDLL, pair: tuple[str, str]
) -> None:
    first, then = (make_gait(load_robot("athena"), name) for name in pair)
    found = [feet_over_a_change(controller_core, first, then, moment) for moment in MOMENTS]
    before, after, jump, undisturbed = np.array(found).max(axis=0)
    # m    the feet of all gaits move by 1.39 to 1.68 mm in a period, before and after
    assert 1.3e-3 < before < 1.7e-3
    assert 1.3e-3 < after < 1.7e-3
    # m    no change of these ways is larger than those of a walk in one gait
    assert undisturbed < 0.1e-3
    assert jump < 0.1e-3


def walk(controller: Controller, steps: range) -> list[np.ndarray]:
    return [controller.step(k * STEP, CURVE, STANDS).angle_ref.copy() for k in steps]


def test_a_change_of_gait_takes_a_swing_and_the_feet_then_step_in_the_new_gait() -> None:
    robot = load_robot("athena")
    tripod, wave = make_gait(robot, "tripod"), make_gait(robot, "wave")
    controller = Controller(robot, period=STEP, gait=tripod)
    walk(controller, range(420))
    controller.change_gait(wave)
    count = 420
    while controller.gait is tripod:
        walk(controller, range(count, count + 1))
        count += 1
    # the legs that lifted off at step 400 or 401 land half a second later
    assert 500 <= count <= 503
    assert controller.plan.paths.clock.walking
    swinging = []
    for k in range(count, count + 600):
        walk(controller, range(k, k + 1))
        swinging.append(tuple(controller.diagnostics.swinging.tolist()))
    assert {sum(legs) for legs in swinging[1:]} == {1}  # one leg of the wave at a time
    assert len(set(swinging[1:])) == 6


def test_a_state_saved_during_a_change_of_gait_continues_with_the_same_bits() -> None:
    robot = load_robot("athena")
    controller = Controller(robot, period=STEP, gait=make_gait(robot), gains=make_gains(robot))
    walk(controller, range(420))
    controller.change_gait(make_gait(robot, "amble"))
    walk(controller, range(420, 450))
    changing = controller.save()
    first = walk(controller, range(450, 700))
    changed = controller.save()
    second = walk(controller, range(700, 800))
    for state, steps, expected in (
        (changing, range(450, 700), first),
        (changed, range(700, 800), second),
    ):
        controller.restore(state)
        np.testing.assert_array_equal(walk(controller, steps), expected)


def test_a_gait_that_is_too_fast_is_refused_and_the_walk_goes_on() -> None:
    robot = load_robot("athena")
    controller, other = (Controller(robot, period=STEP, gait=make_gait(robot)) for _ in range(2))
    walk(controller, range(300))
    with pytest.raises(ControllerError, match="gait's shorter phase"):
        controller.change_gait(make_gait(robot, "wave", period=0.02))
    np.testing.assert_array_equal(walk(controller, range(300, 400)), walk(other, range(400))[300:])
