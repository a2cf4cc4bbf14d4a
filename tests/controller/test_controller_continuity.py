"""Tests that torque references do not jump when feet touch down or lift off, nor when a walk begins
or ends.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from gains import make_gains

from hexapod_cosim.controller import BodyCommand, Controller, Measurement, make_gait
from hexapod_cosim.models import load_robot

PERIODS = {"tripod": (0.002, 0.001), "ripple": (0.004, 0.002)}  # s
LARGEST = {
    "athena": 3.2,
    "phantomx_mk4": 1.7,
}  # N m; of 5.4 and 2.7 allowed: load of the middle leg of a tripod, and gear friction
STANDING, WALKING = 0.2, 3.3  # s
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
        measurement.foot_force[:] = compliant.stance.plan.shares.forces()
        measurement.angle[:] = out.angle_ref - compliant.laws.bend
    assert not controller.paths.walking
    return np.array(found)


def steepest(name: str, gait: str, period: float) -> float:
    """Returns the largest change of a torque in a period [N m], once the walk is under way."""
    under_way = slice(round((STANDING + 1.2) / period), round((STANDING + WALKING) / period))
    return float(np.abs(np.diff(torques(name, gait, period)[under_way], axis=0)).max())


@pytest.mark.parametrize("name", LARGEST)
@pytest.mark.parametrize("gait", PERIODS)
def test_the_largest_torque_is_what_the_load_needs_whatever_the_period(
    name: str, gait: str
) -> None:
    for period in PERIODS[gait]:
        assert np.abs(torques(name, gait, period)).max() < LARGEST[name]


@pytest.mark.parametrize("name", LARGEST)
def test_torques_are_continuous_over_touch_downs_and_lift_offs(name: str) -> None:
    """A hand-over changes 3 N m by at most 1.9/0.05 s, which is 0.11 N m in 1 ms.

    Gear friction that reverses, and feet that begin to press into the ground, add to it.
    """
    coarse, fine = (steepest(name, "tripod", period) for period in PERIODS["tripod"])
    assert coarse < 0.6
    assert fine < min(0.3, 0.75 * coarse)


@pytest.mark.parametrize("gait", ["tripod", "ripple", "wave"])
def test_no_torque_jumps_when_a_walk_begins_or_ends(gait: str) -> None:
    """Legs that begin during their swing, or stay at home, have no hand-over. The remaining change
    is how the other legs begin and end theirs.
    """
    assert np.abs(np.diff(torques("athena", gait, 0.002), axis=0)).max() < 0.8
