"""Compares the C controller with the Python controller where sensors lie, where the ground is
missing, met early or slides, where joints are too slow, and where legs are lost.
"""

from __future__ import annotations

import ctypes as ct
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from gains import make_gains
from native_walks import (
    ALL_PARTS,
    Ground,
    close,
    differences,
    follow_forces,
    program,
    setup_of,
    uneven,
)

from hexapod_cosim.controller import BodyCommand, Controller, Measurement, Parts, make_gait
from hexapod_cosim.models import load_robot

NO_FALLBACK = replace(ALL_PARTS, fallback=False)


def dead_and_stuck(force: np.ndarray, step: int) -> None:
    force[1] *= not 400 <= step < 900  # the sensor reads nothing
    if 700 <= step < 1100:
        force[3] = [1.0, -2.0, 15.0]  # another sensor reads the same all the time
    if 1150 <= step < 1300:
        force[[0, 2, 4]] = 0.0


def dragged(force: np.ndarray, step: int) -> None:
    if 500 <= step < 560 or 900 <= step < 1000:
        force[:, 0] += 0.8 * force[:, 2]  # the whole robot slides
    if 1200 <= step < 1300:
        force[:, 0] += 0.8 * force[:, 2]
        force *= 0.4  # and has hardly met the ground


def barely_met(force: np.ndarray, step: int) -> None:
    """Lets the whole robot slide on feet that carry 0.4, then 0.6 of its weight."""
    for begin, share in ((500, 0.4), (900, 0.6)):
        if begin <= step < begin + 40:
            force *= share
            force[:, 0] += 0.8 * force[:, 2]


def heavy(force: np.ndarray, step: int) -> None:
    if step >= 300:
        force *= (
            2.1 if step < 900 else 4.0 if step < 1250 else 1.0
        )  # more than the servos carry, then far more, then the planned load


@pytest.mark.parametrize(
    ("spoil", "name"),
    [
        (dead_and_stuck, "athena"),
        (dragged, "phantomx_mk4"),
        (barely_met, "athena"),
        (uneven, "phantomx_mk4"),
        (heavy, "phantomx_mk4"),
    ],
)
def test_sensors_that_lie_ground_that_is_missing_and_slides_are_answered_at_the_same_step(
    controller_core: ct.CDLL, name: str, spoil: Callable[[np.ndarray, int], None]
) -> None:
    ground, doubted = Ground(), np.zeros(6, dtype=np.bool_)

    def sense(controller: Controller, step: int, measurement: Measurement) -> None:
        ground(controller, step, measurement)
        spoil(measurement.foot_force, step)
        follow_forces(controller, measurement)
        assert controller.compliant is not None
        doubted[...] |= controller.compliant.laws.doubted

    # with a planned squeeze even four times the weight does not ask too much of the second robot
    setup = setup_of(name, parts=Parts(squeeze=0.0))
    worst, fallback = differences(
        controller_core, setup, sense=sense, command_at=program, steps=1350
    )
    assert close(worst)
    assert fallback.any() == (spoil not in (uneven, dead_and_stuck))
    assert doubted.any() or spoil is not dead_and_stuck


@pytest.mark.parametrize(
    ("gait", "bump", "parts"),
    [("tripod", 0.02, ALL_PARTS), ("wave", 0.02, ALL_PARTS), ("tripod", 0.039, NO_FALLBACK)],
)
def test_ground_that_is_met_early_is_answered_at_the_same_step(
    controller_core: ct.CDLL, gait: str, bump: float, parts: Parts
) -> None:
    """The ground is met by all feet at 12 mm, by one foot higher, then by none: soft ground with a
    bump, and a torso that has risen again.

    Without fallback the bump is as high as the largest offset of a foot.
    """
    ground = Ground()

    def sense(controller: Controller, step: int, measurement: Measurement) -> None:
        ground(controller, step, measurement)
        compliant, met = (
            controller.compliant,
            np.where(np.arange(6) == 2, bump, 0.012 if parts is ALL_PARTS else 0.0),
        )
        assert compliant is not None
        height = compliant.present.load.height
        if step < 800:
            measurement.foot_force[(height > 0.0) & (height < met), 2] = 4.0

    worst, _ = differences(controller_core, setup_of(gait=gait, parts=parts), sense=sense)
    assert close(worst)


class LowGround:
    """A sense() for which foot 2 finds the ground 12 mm lower than planned, foot 3 in some steps
    nowhere.

    Attributes:
        waiting: whether the gait clock waited, for each period.
    """

    def __init__(self) -> None:
        self.ground = Ground()
        self.waiting: list[bool] = []

    def __call__(self, controller: Controller, step: int, measurement: Measurement) -> None:
        self.ground(controller, step, measurement)
        compliant = controller.compliant
        assert compliant is not None
        lowered, awaited = compliant.laws.touchdown.offset, controller.plan.paths.clock.awaited
        measurement.foot_force[:, 2] += 12.0 * (awaited & (lowered < -0.012))
        swings = controller.plan.paths.clock.swinging[2]
        measurement.foot_force[2] *= not (swings and lowered[2] > -0.012)
        measurement.foot_force[3] *= step % 700 < 500
        self.waiting.append(controller.plan.paths.clock.waiting)


@pytest.mark.parametrize("gait", ["ripple", "amble"])
def test_feet_that_find_no_ground_are_awaited_at_the_same_step(
    controller_core: ct.CDLL, gait: str
) -> None:
    sense = LowGround()
    worst, _ = differences(controller_core, setup_of(gait=gait), sense=sense)
    assert close(worst)
    assert 0.02 < np.mean(sense.waiting) < 0.8


@pytest.mark.parametrize(("lost", "awaited"), [([1], True), ([1, 4], False)])
def test_feet_are_awaited_without_one_leg_but_not_without_two(
    controller_core: ct.CDLL, lost: list[int], awaited: bool
) -> None:
    """The joints of the lost legs rest from 1.5 s on."""
    low, absent = LowGround(), []

    def sense(controller: Controller, step: int, measurement: Measurement) -> None:
        resting = measurement.angle[lost].copy()
        low(controller, step, measurement)
        if step >= 300:
            measurement.angle[lost] = resting
        absent.append(np.flatnonzero(controller.diagnostics.absent).tolist())

    straight = BodyCommand(vx=0.04)
    worst, _ = differences(
        controller_core, setup_of(), sense=sense, steps=1000, command_at=lambda _: straight
    )
    assert close(worst)
    waited = [waits for waits, legs in zip(low.waiting, absent, strict=True) if legs == lost]
    assert len(waited) > 500
    assert any(waited) is awaited


@pytest.mark.parametrize("speed_max", [3.0, 2.6])
def test_feet_of_joints_that_are_too_slow_are_awaited_as_others_are(
    controller_core: ct.CDLL, speed_max: float
) -> None:
    """Steps on the spot need 2.9 rad/s. The sensor of foot 3 is doubted."""
    sense, setup = LowGround(), setup_of()
    slow = replace(setup.robot, servo=replace(setup.robot.servo, speed_max=speed_max))
    robot = replace(setup, robot=slow, gains=make_gains(slow))
    worst, _ = differences(controller_core, robot, sense=sense, steps=1400)
    assert close(worst)
    assert 0.14 < np.mean(sense.waiting) < 0.16


@pytest.mark.parametrize("name", ["athena", "phantomx_mk4"])
def test_a_walk_that_outruns_its_joints_is_the_same(controller_core: ct.CDLL, name: str) -> None:
    """The gait changes while the command is too fast, and the posture is not level."""
    shown: set[bool] = set()
    ground = Ground()

    def command_at(t: float) -> BodyCommand:
        if t < 2.0:
            return BodyCommand(0.5, 0.2, 0.4, -0.01, 0.03, 0.02)
        return BodyCommand(vx=0.01) if t < 3.0 else BodyCommand(yaw_rate=-2.5)

    def sense(controller: Controller, step: int, measurement: Measurement) -> None:
        shown.add(bool(controller.diagnostics.outrun.any()))
        ground(controller, step, measurement)

    changes = {130: make_gait(load_robot(name), "wave")}
    worst, _ = differences(
        controller_core,
        setup_of(name),
        sense=sense,
        command_at=command_at,
        changes=changes,
        steps=800,
    )
    assert close(worst)
    assert shown == {False, True}


@pytest.mark.parametrize("law", ["compliant", "paper"])
def test_a_walk_that_loses_two_legs_and_takes_them_back_is_the_same(
    controller_core: ct.CDLL, law: str
) -> None:
    """The joints of LF and RR rest for a time; the others follow their commands."""
    rests = {0: range(300, 500), 5: range(420, 560)}
    absent: set[tuple[bool, ...]] = set()

    def sense(controller: Controller, step: int, measurement: Measurement) -> None:
        resting = measurement.angle.copy()
        measurement.angle[:] = controller._out.angle_ref
        for leg, steps in rests.items():
            if step in steps:
                measurement.angle[leg] = resting[leg]
        measurement.foot_force[:, 2] = 9.0 * ~controller.diagnostics.swinging
        absent.add(tuple(controller.diagnostics.absent.tolist()))

    setup = replace(setup_of(), law=law)
    straight = BodyCommand(vx=0.06)
    worst, _ = differences(
        controller_core, setup, sense=sense, steps=900, command_at=lambda _: straight
    )
    assert close(worst)
    alone, both, none = (True, *5 * (False,)), (True, *4 * (False,), True), 6 * (False,)
    assert {none, alone, both} <= absent


def test_joints_that_are_outrun_hand_nothing_over_to_kinematic_control(
    controller_core: ct.CDLL,
) -> None:
    setup = setup_of()
    slow = replace(setup.robot, servo=replace(setup.robot.servo, speed_max=1.2))
    worst, fallback = differences(
        controller_core,
        replace(setup, robot=slow, gains=make_gains(slow)),
        sense=Ground(),
        steps=1400,
    )
    assert close(worst)
    assert not fallback.any()
