"""Compares the C controller with the Python controller over whole walks: the same commands under
the same measurements, to round-off.
"""

from __future__ import annotations

import ctypes as ct
from dataclasses import replace

import numpy as np
import pytest
from gains import PERIOD, make_gains
from native_walks import (
    ALL_PARTS,
    STEPS,
    Ground,
    close,
    differences,
    follow_forces,
    setup_of,
    uneven,
)

from hexapod_cosim.controller import SWITCHES, Controller, Gait, Measurement, Parts, make_gait
from hexapod_cosim.cosim.interface.controller import ControllerSetup
from hexapod_cosim.models import load_robot

WALKS = [
    ("athena", "tripod", True),
    ("phantomx_mk4", "ripple", True),
    ("athena", "wave", True),
    ("phantomx_mk4", "amble", True),
    ("phantomx_mk4", "wave", False),
    ("sts3215_hexapod", "tripod", True),
]


@pytest.mark.parametrize(("name", "gait", "compliant"), WALKS)
def test_a_walk_is_the_same(
    controller_core: ct.CDLL, name: str, gait: str, compliant: bool
) -> None:
    worst, fallback = differences(
        controller_core, setup_of(name, gait, compliant=compliant), sense=Ground()
    )
    assert close(worst)
    assert not fallback.any()


@pytest.mark.parametrize("compliant", [True, False])
def test_a_walk_that_changes_its_gait_is_the_same(
    controller_core: ct.CDLL, compliant: bool
) -> None:
    """The second change is asked for again before it is made, the last one at the end of a stop."""
    robot = load_robot("athena")
    names = {200: "wave", 300: "ripple", 700: "wave", 740: "amble", 1140: "tripod"}
    worst, fallback = differences(
        controller_core,
        setup_of(compliant=compliant),
        sense=Ground(),
        changes={step: make_gait(robot, name) for step, name in names.items()},
        steps=1500,
    )
    assert close(worst)
    assert not fallback.any()


PAPER_PARTS = ("paper_share", "paper_pid", "paper_suspension")


@pytest.mark.parametrize("off", [None, *PAPER_PARTS])
@pytest.mark.parametrize(("name", "gait"), [("athena", "tripod"), ("phantomx_mk4", "amble")])
def test_a_walk_under_the_papers_control_is_the_same(
    controller_core: ct.CDLL, name: str, gait: str, off: str | None
) -> None:
    """Forces and joint angles are drawn at random, up to the limits of the corrections."""
    generator, stance = np.random.default_rng(5), load_robot(name).stance

    def sense(_: Controller, step: int, measurement: Measurement) -> None:
        size = 1.0 + 9.0 * (step % 200 > 150)
        measurement.foot_force[:] = size * (
            generator.normal(size=(6, 3)) * 5.0 + [8.0 * (step % 400 > 200), 0.0, 10.0]
        )
        measurement.angle[:] = stance + 0.05 * generator.normal(size=(6, 3))
        turn = np.array([1.0, *(0.02 * generator.normal(size=3))])
        measurement.quaternion[:] = turn / np.linalg.norm(turn)

    parts = replace(ALL_PARTS, **({} if off is None else {off: False}))
    setup = replace(setup_of(name, gait, parts=parts), law="paper")
    worst, fallback = differences(controller_core, setup, sense=sense, steps=400)
    assert close(worst)
    assert not fallback.any()


@pytest.mark.parametrize("part", [name for name in SWITCHES if "paper" not in name])
def test_each_part_can_be_switched_off(controller_core: ct.CDLL, part: str) -> None:
    ground = Ground()

    def sense(controller: Controller, step: int, measurement: Measurement) -> None:
        ground(controller, step, measurement)
        uneven(measurement.foot_force, step + 300)
        follow_forces(controller, measurement)

    setup = setup_of(parts=replace(ALL_PARTS, **{part: False}))
    worst, _ = differences(controller_core, setup, sense=sense, steps=450)
    assert close(worst)


@pytest.mark.parametrize(
    ("weight", "gait"), [(0.0, "tripod"), (0.1, "amble"), (0.5, "tripod"), (0.99, "amble")]
)
def test_walks_with_a_planned_squeeze_are_the_same(
    controller_core: ct.CDLL, weight: float, gait: str
) -> None:
    setup = setup_of(gait=gait, parts=Parts(squeeze=weight))
    worst, _ = differences(controller_core, setup, sense=Ground(), steps=500)
    assert close(worst)


@pytest.mark.parametrize(("narrow", "part", "steps"), [(0.03, 1.0, STEPS), (0.0, 0.0, 500)])
def test_steps_of_a_robot_that_is_heavier_than_told_are_the_same(
    controller_core: ct.CDLL, narrow: float, part: float, steps: int
) -> None:
    """Without a narrow stance neither the steps nor the squeeze change, nor does the torso sway."""
    gait = replace(make_gait(load_robot("athena"), "amble"), narrowing=narrow)
    ground, narrowing, sway = Ground(), [0.0], [0.0]

    def heavy(controller: Controller, step: int, measurement: Measurement) -> None:
        ground(controller, step, measurement)
        measurement.foot_force[:] *= 1.4
        narrowing.append(controller.plan.paths.narrowing)
        sway.append(abs(controller.plan.now.torso))

    setup = setup_of(gait=gait)
    assert close(differences(controller_core, setup, sense=heavy, steps=steps)[0])
    assert max(narrowing) == part
    assert (max(sway) > 1e-3) == bool(part)  # m


def test_another_period_gait_and_touch_down_speed_are_the_same_too(
    controller_core: ct.CDLL,
) -> None:
    robot = load_robot("athena")
    gait = Gait(
        name="ripple",
        period=1.3,
        duty=0.62,
        offsets=make_gait(robot, "ripple").offsets,
        step_height=0.03,
        touchdown_speed=0.05,
    )
    setup = ControllerSetup(
        robot=robot, gait=gait, period=0.008, gains=make_gains(robot, period=0.008)
    )
    worst, _ = differences(controller_core, setup, sense=Ground(), steps=800)
    assert close(worst)


def test_legs_may_differ(controller_core: ct.CDLL) -> None:
    robot = load_robot("athena")
    legs = []
    for k, leg in enumerate(robot.legs):
        links = [
            replace(
                link,
                length=link.length * (1.0 + 0.01 * k),
                offset_y=0.002 * k,
                offset_z=-0.003 * k,
                com=(link.com[0], 0.001 * k, 0.002 * k),
            )
            for link in leg.links
        ]
        legs.append(
            replace(leg, hip_yaw=leg.hip_yaw + 0.05 * k, links=(links[0], links[1], links[2]))
        )
    crooked = replace(robot, legs=tuple(legs), torso=replace(robot.torso, com=(0.01, -0.02, 0.015)))
    setup = ControllerSetup(
        robot=crooked, gait=make_gait(crooked), period=PERIOD, gains=make_gains(crooked)
    )
    assert close(differences(controller_core, setup, sense=Ground())[0])
