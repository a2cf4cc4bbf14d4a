"""The stances in which the design linearises a robot: six legs and tripods. They are tested for
robots of all sizes and distributions of mass. Also the search of the stance of least heat.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from random_robots import centre_of_mass
from scaled_robots import scaled_robot

from hexapod_cosim.controller import GainsError, LegSolver, make_gait
from hexapod_cosim.controller.design import StandingPlant, design_gains
from hexapod_cosim.controller.size import requirements_for
from hexapod_cosim.cosim.design.gains import STANCES, design_for, examine_stances, level_fmu
from hexapod_cosim.cosim.design.linearise import Bench
from hexapod_cosim.cosim.design.stance import StanceLoads, find_stance, stance_loads, with_stance
from hexapod_cosim.cosim.design.standing import lifted_stance, loads, rest
from hexapod_cosim.models import Robot, load_robot

PERIOD = 0.005  # s
STILL = 1e-3  # m or rad    that a robot at rest moves by in a second; feet creep by some 0.1 mm
ROUNDING = 1e-9
TRIPOD = STANCES["tripod LF LR RM"]
NEEDS_DESIGN_STANCES = pytest.mark.usefixtures("plant_build")


def off_centre(x: float, y: float, z: float) -> Robot:
    robot = load_robot("athena")
    return replace(robot, torso=replace(robot.torso, com=(x, y, z)))


def soft(kp: float) -> Robot:
    robot = load_robot("athena")
    return replace(robot, servo=replace(robot.servo, kp=kp))


def strong(torque_max: float) -> Robot:
    robot = load_robot("athena")
    return replace(robot, servo=replace(robot.servo, torque_max=torque_max))


@NEEDS_DESIGN_STANCES
@pytest.mark.parametrize(
    "robot",
    [soft(28.0), off_centre(0.05, 0.05, 0.1), scaled_robot(load_robot("athena"), 0.3)],
    ids=["soft", "off", "small"],
)
@pytest.mark.parametrize("load", [0.1, 2.0])
def test_a_robot_at_rest_stays_where_it_is(robot: Robot, load: float) -> None:
    with level_fmu(robot) as fmu:
        motion, inputs = rest(fmu, robot, standing=TRIPOD, load=load)
        bench = Bench(
            fmu, robot, coulomb_friction=0.0, slope=0.1 * robot.friction.slope, period=0.05
        )
        bench.start(motion, inputs)
        forces = bench.force()[2::3]
        for k in range(20):
            bench.step(k)
        moved = bench.motion().less(motion)[:24]
    assert (forces > 0.0).tolist() == [True, False, True, False, True, False]
    assert forces.sum() == pytest.approx(load * robot.weight, rel=1e-3)
    assert np.abs(moved).max() < STILL


@NEEDS_DESIGN_STANCES
@pytest.mark.parametrize("load", [0.1, 1.0, 2.0])
@pytest.mark.parametrize("stance", list(STANCES))
def test_a_push_that_makes_a_load_leaves_every_foot_at_least_half_its_share(
    stance: str, load: float
) -> None:
    """By statics, forces, weight and push are in balance about any point.

    The share of a foot is its load under the weight alone.
    """
    robot = off_centre(0.12, 0.03, 0.0)
    angle, standing = lifted_stance(robot, STANCES[stance]), STANCES[stance]
    feet, com = LegSolver(robot).forward(angle)[:, :2], np.array(robot.torso.com)[:2]
    share, push = loads(robot, angle, standing, load=load)
    # a mean of that many thirds is the weight
    alone = loads(robot, angle, standing, load=3.0 / len(standing))[0]
    whole = load * len(standing) / 3.0  # 1    of the weight
    assert share.sum() == pytest.approx(whole * robot.weight, rel=ROUNDING)
    assert push[[0, 1, 5]].tolist() == [0.0, 0.0, 0.0]
    np.testing.assert_array_less(0.5 * whole * alone - ROUNDING, share)
    # about the torso's origin: sum f x = W x_c - F x_t + tau_y, sum f y = W y_c - F y_t - tau_x
    moment = (
        robot.weight * lifted_centre(robot, angle) - push[2] * com + np.array([push[4], -push[3]])
    )
    np.testing.assert_allclose(share @ feet, moment, atol=1e-9)


def lifted_centre(robot: Robot, angle: np.ndarray) -> np.ndarray:
    posed = replace(
        robot,
        legs=tuple(
            replace(leg, stance=tuple(row))
            for leg, row in zip(robot.legs, angle.tolist(), strict=True)
        ),
    )
    return centre_of_mass(posed)


@NEEDS_DESIGN_STANCES
def test_tripods_that_do_not_stand_are_left_out_and_named() -> None:
    """With a torso so heavy in front, tripods have no foot ahead of the centre of mass; six legs
    have.
    """
    gains = design_for(off_centre(0.3, 0.0, 0.0), PERIOD)
    assert len(gains.caveats) == 2
    for text, stance, y, leg in zip(
        gains.caveats, ("LF LR RM", "LM RF RR"), ("1", "-1"), ("LR", "RR"), strict=False
    ):
        assert text == (
            f"the design leaves out tripod {stance}: the robot does not stay on its legs "
            f"(got the centre of mass at (139, {y}) mm, "
            f"under which foot {leg} carries nothing, expected between {stance})"
        )


@NEEDS_DESIGN_STANCES
def test_stances_that_the_servos_do_not_carry_are_left_out_and_a_robot_that_none_carries_is_refused(
    plants: dict[str, StandingPlant],
) -> None:
    """The static torque of the ATHENA-like robot is 3.14 N m on a tripod, 2.20 N m on six legs."""
    gains = design_gains(strong(3.0), PERIOD, plants=plants)
    limit = "expected at most 2.7 N m, torque_share x servo.torque_max)"
    assert gains.caveats == tuple(
        f"the design leaves out standing on {legs}: "
        f"the servos do not carry the robot (got 3.14 N m, {limit}"
        for legs in ("LF LR RM", "LM RF RR")
    )
    assert gains.margins.support_torque == pytest.approx(2.2, abs=0.01)
    assert design_gains(strong(3.6), PERIOD, plants=plants).caveats == ()
    with pytest.raises(
        GainsError,
        match=r"the servos do not carry the robot: got '2.2 N m', "
        r"expected at most 1.8 N m.*; stronger servos",
    ):
        design_gains(strong(2.0), PERIOD, plants=plants)


@pytest.fixture(scope="module")
def plants(plant_build: object) -> dict[str, StandingPlant]:
    return examine_stances(load_robot("athena"), PERIOD)[0]


@NEEDS_DESIGN_STANCES
def test_a_robot_that_stands_on_no_legs_is_refused() -> None:
    """The hips are so far back that the torso's weight lies ahead of all feet."""
    robot = load_robot("athena")
    legs = tuple(
        replace(leg, hip_position=(leg.hip_position[0] - 0.5, *leg.hip_position[1:]))
        for leg in robot.legs
    )
    with pytest.raises(GainsError, match="does not stand"):
        design_for(replace(robot, legs=legs), PERIOD)


@NEEDS_DESIGN_STANCES
def test_similar_robots_beyond_the_usual_sizes_get_similar_gains() -> None:
    """By Froude scaling, all times of a robot twice as large are sqrt(2) times as long.

    Its period and delays are scaled likewise.
    """
    period, found = 0.007, []
    for by in (2.0, 4.0):
        time, robot = (by / 2.0) ** 0.5, scaled_robot(load_robot("athena"), by)
        needs = requirements_for(robot, force_delay=0.014 * time, filter_time=0.014 * time)
        found.append(design_for(robot, period * time, needs))
    small, large = found
    length, time, force = 2.0, 2.0**0.5, 8.0
    for name, by in (
        ("share", 1.0),
        ("height_share", 1.0),
        ("share_limit", 1.0),
        ("yield_share", 1.0),
        ("return_rate", 1.0 / time),
        ("filter_time", time),
        ("damping", force / (length / time)),
        ("return_time", time),
        ("sag_limit", length),
        ("limit", length),
    ):
        assert getattr(large.paper, name) == pytest.approx(by * getattr(small.paper, name)), name
    assert large.margins.paper_gain_margin == pytest.approx(
        small.margins.paper_gain_margin, rel=1e-4
    )
    for name, by in (
        ("attitude_rate", 1.0 / time),
        ("height_rate", 1.0 / time),
        ("ground_time", time),
        ("angle_limit", 1.0),
        ("height_limit", length),
        ("path_rate", 1.0 / time),
        ("speed_limit", length / time),
        ("turn_limit", 1.0 / time),
    ):
        assert getattr(large.hold, name) == pytest.approx(by * getattr(small.hold, name)), name
    assert large.support.handover_time == pytest.approx(small.support.handover_time * time)
    assert large.support.weight_time == pytest.approx(small.support.weight_time * time)
    assert large.support.load_time == pytest.approx(small.support.load_time * time)


# Tests the search of the stance of least heat.

ATHENA = load_robot("athena")


@cache
def found() -> StanceLoads:
    """The loads in the stance of least heat."""
    change = find_stance(ATHENA, make_gait(ATHENA))
    assert change.outward == pytest.approx(-0.05265)
    assert change.deeper == pytest.approx(0.0189)
    return stance_loads(with_stance(ATHENA, *change), make_gait(ATHENA))


def test_the_stance_of_least_heat_brings_the_feet_nearer_to_the_hips() -> None:
    before = stance_loads(ATHENA, make_gait(ATHENA))
    assert found().heat < 0.8 * before.heat
    assert found().hottest < ATHENA.servo.torque_continuous < before.hottest


def test_the_found_stance_is_as_firm_and_as_slow_as_required() -> None:
    assert found().firmness >= 0.25
    assert found().lifts
    assert found().speed <= 0.8 * ATHENA.servo.speed_max


def test_a_stance_without_reach_is_refused() -> None:
    far = replace(ATHENA, gait=replace(ATHENA.gait, stride=0.6))
    with pytest.raises(GainsError, match="do not reach the steps"):
        find_stance(far, make_gait(far))
