"""Tests the bristle law of friction by itself and with the whole plant: a block on an incline,
pushes, and a walk.
"""

from __future__ import annotations

import ctypes as ct
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from states import changed
from test_laws_standing import ACCURATE, block, laid, marching, stood, tilted

from hexapod_cosim.models import load_robot
from hexapod_cosim.models.dynamics import Command
from hexapod_cosim.models.friction import SPRING_LIMIT, bristle_rate, friction_force
from hexapod_cosim.models.records import Array

FRICTION = replace(load_robot("athena").friction, law="bristle")
EXACT = 1e-12  # relative: rounding
HELD = 1e-9  # m, motion in a minute; under the tanh law the block creeps 0.1 m at a share of 0.3
CLOSED = 1e-6  # relative, of the deflection: what is left of the first oscillation
UNEVEN = 1e-3  # relative, between the bristles of the six feet: the leaning block turns a little
# relative: the block leans because its downhill feet carry more of its weight, and its feet roll
LEANING = 0.03
# relative to the presliding: the error of some steps, 1e-3 each at the default tolerance; the
# friction force stays in its cone nevertheless
OVERSHOT = 5e-3
# m, displacement after each cycle of a push; a thousandth of the displacement within one cycle
RETURNED = 1e-8


# the law alone


def test_below_break_away_a_bristle_is_a_spring() -> None:
    rng = np.random.default_rng(0)
    for share in (0.0, 0.3, SPRING_LIMIT):
        slip, z = rng.normal(size=3), share * FRICTION.presliding * np.array([0.6, 0.8, 0.0])
        assert bristle_rate(FRICTION, slip, z) == pytest.approx(slip, rel=EXACT)
        still = friction_force(FRICTION, 10.0, np.zeros(3), z)
        assert still == pytest.approx(
            -FRICTION.mu * 10.0 * 0.5 * share * (3.0 - share**2) * np.array([0.6, 0.8, 0.0]),
            rel=EXACT,
        )


def test_a_full_bristle_follows_the_slip_and_comes_back_elastically() -> None:
    z = FRICTION.presliding * np.array([0.6, 0.8, 0.0])
    along, across = z / FRICTION.presliding, np.array([-0.8, 0.6, 0.0])
    assert bristle_rate(FRICTION, 0.3 * along, z) == pytest.approx(np.zeros(3), abs=EXACT)
    assert bristle_rate(FRICTION, 0.3 * across, z) == pytest.approx(0.3 * across, rel=EXACT)
    assert bristle_rate(FRICTION, -0.3 * along, z) == pytest.approx(-0.3 * along, rel=EXACT)


def test_no_motion_takes_a_bristle_past_its_presliding_or_friction_past_its_cone() -> None:
    rng = np.random.default_rng(1)
    for _ in range(300):
        direction, slip = rng.normal(size=3) * [1.0, 1.0, 0.0], rng.normal(size=3) * [1.0, 1.0, 0.0]
        direction /= np.linalg.norm(direction)
        z = rng.uniform(0.0, 1.0) * FRICTION.presliding * direction
        assert (
            float(bristle_rate(FRICTION, slip, FRICTION.presliding * direction) @ direction)
            <= EXACT
        )
        force = friction_force(FRICTION, 10.0, slip, z)
        assert float(np.linalg.norm(force)) <= FRICTION.mu * 10.0 * (1.0 + EXACT)


def test_turning_slip_and_bristle_turns_the_force() -> None:
    rng, (c, s) = np.random.default_rng(2), (math.cos(0.8), math.sin(0.8))
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    for _ in range(20):
        slip, z = rng.normal(0.0, 0.05, 3), rng.normal(0.0, 3e-4, 3)
        rate, force = bristle_rate(FRICTION, slip, z), friction_force(FRICTION, 10.0, slip, z)
        assert bristle_rate(FRICTION, turn @ slip, turn @ z) == pytest.approx(
            turn @ rate, rel=EXACT, abs=EXACT
        )
        assert friction_force(FRICTION, 10.0, turn @ slip, turn @ z) == pytest.approx(
            turn @ force, rel=EXACT, abs=EXACT
        )


def test_a_bristle_lets_go_without_a_step_in_its_rate() -> None:
    """Checks that the rate is continuously differentiable in the deflection.

    The slopes on both sides of the spring limit and of the presliding agree to first order in the
    distance.
    """
    x_axis = np.array([1.0, 0.0, 0.0])
    for share in (SPRING_LIMIT, 1.0):
        slopes = [
            (
                bristle_rate(
                    FRICTION, x_axis, (share + side + 1e-6) * FRICTION.presliding * x_axis
                )[0]
                - bristle_rate(
                    FRICTION, x_axis, (share + side - 1e-6) * FRICTION.presliding * x_axis
                )[0]
            )
            / 2e-6
            for side in (-1e-4, 1e-4)
        ]
        assert slopes[0] == pytest.approx(slopes[1], abs=0.05)


# the block on the incline


def given(share: float) -> float:
    """Returns the solution u of u (3 - u^2)/2 = share: the deflection divided by the presliding
    under a share of the friction limit.
    """
    return 2.0 * math.sin(math.asin(share) / 3.0)


@pytest.mark.parametrize("by", ["gravity", "slope"])
@pytest.mark.parametrize(("angle", "heading"), [(0.1, 0.0), (0.2, 2.0), (0.35, math.pi)])
def test_below_the_friction_angle_a_block_holds_still_where_it_has_given_way(
    core: ct.CDLL, by: str, angle: float, heading: float
) -> None:
    plant, downhill, _ = tilted(core, angle, heading, by=by, law="bristle")
    friction, start = plant.robot.friction, plant.output().foot.position
    plant.step(2.0)
    settled = plant.output()
    plant.step(62.0)
    held = plant.output()
    way = friction.presliding * given(math.tan(angle) / friction.mu)
    assert way < SPRING_LIMIT * friction.presliding
    u = held.foot.bristle @ downhill / friction.presliding
    share = held.foot.normal_force @ (u * (3.0 - u**2) / 2.0) / held.foot.normal_force.sum()
    assert share == pytest.approx(math.tan(angle) / friction.mu, rel=CLOSED)
    assert u == pytest.approx(np.full(6, way / friction.presliding), rel=UNEVEN)
    assert (held.foot.position - start) @ downhill == pytest.approx(np.full(6, way), rel=LEANING)
    assert float(np.max(np.abs(held.torso.position - settled.torso.position))) < HELD
    creep = math.atanh(math.tan(angle) / friction.mu) / friction.slope
    assert 60.0 * creep > 1e6 * HELD


def test_a_constant_force_between_break_away_and_the_limit_is_held_too(core: ct.CDLL) -> None:
    plant, downhill, _ = tilted(core, 0.58, 0.0, by="gravity", law="bristle")
    assert given(math.tan(0.58) / plant.robot.friction.mu) > SPRING_LIMIT
    plant.step(5.0)
    settled = plant.output()
    plant.step(25.0)
    held = plant.output()
    assert float(np.max(np.abs(held.torso.position - settled.torso.position))) < HELD
    assert held.foot.force.sum(axis=0) @ downhill == pytest.approx(
        -plant.robot.total_mass * 9.81 * math.sin(0.58), rel=CLOSED
    )


@pytest.mark.parametrize("heading", [0.0, 1.0])
def test_a_push_to_and_fro_below_break_away_does_not_walk_the_block_downhill(
    core: ct.CDLL, heading: float
) -> None:
    plant, downhill, _ = tilted(core, 0.15, 0.0, by="gravity", law="bristle")
    weight, mu = plant.robot.total_mass * 9.81, plant.robot.friction.mu
    size = 0.35 * mu * weight
    assert given(math.tan(0.15) / mu + 0.35 / math.cos(0.15)) < 0.9 * SPRING_LIMIT
    way = np.array([math.cos(heading), math.sin(heading), 0.0])
    places, swing = [], 0.0
    for k in range(1200):  # 60 cycles of 0.1 s; the ends of cycles are compared from the 11th on
        t = 5e-3 * k
        plant.step(
            t + 5e-3, replace(plant.hold(), push_force=size * math.sin(20.0 * math.pi * t) * way)
        )
        place = plant.output().torso.position @ downhill
        places.append(place)
        swing = max(swing, abs(place - places[0]))
    ends = np.array(places[219::20])
    assert swing > 1e3 * RETURNED
    assert float(np.max(np.abs(ends - ends[-1]))) < RETURNED


def test_what_bristles_hold_they_give_back(core: ct.CDLL) -> None:
    """A slow push below the spring limit stores energy and returns it (energy audit)."""
    robot = block("athena", gravity=np.array([0.0, 0.0, -9.81]), law="bristle")
    plant = laid(core, robot, np.eye(4)[0])
    plant.step(1.0)
    force, start, taken = (
        0.3 * robot.friction.mu * robot.total_mass * 9.81,
        plant.output().energy.dissipated,
        [],
    )
    for k in range(400):
        share = math.sin(math.pi * (k + 1) / 400.0) ** 2
        plant.step(
            1.0 + 0.01 * (k + 1),
            replace(plant.hold(), push_force=np.array([0.0, share * force, 0.0])),
        )
        taken.append(plant.output().energy.dissipated - start)
    u = given(0.3)
    held = force / 0.3 * robot.friction.presliding * (0.75 * u**2 - 0.125 * u**4)
    # 5 %, because the push is constant over 10 ms
    assert max(taken) == pytest.approx(held, rel=0.05)
    assert taken[-1] < 0.05 * held


# walking


@pytest.mark.parametrize("name", ["athena", "phantomx_mk4"])
def test_bristles_are_slack_in_the_air_and_never_past_their_presliding(
    core: ct.CDLL, name: str
) -> None:
    robot = changed(load_robot(name), friction={"law": "bristle"})
    plant, stretched = stood(core, robot), 0.0
    for k in range(200):
        plant.step(5e-3 * (k + 1), marching(robot, 5e-3 * k))
        foot = plant.output().foot
        share = np.linalg.norm(foot.bristle, axis=1) / robot.friction.presliding
        assert not foot.bristle[foot.contact == 0].any()
        assert np.all(share < 1.0 + OVERSHOT)
        stretched = max(stretched, float(np.max(share)))
    assert stretched > 0.9


def test_a_walk_converges_in_proportion_to_the_tolerance(core: ct.CDLL) -> None:
    def end(**solver: Any) -> Array:
        robot = changed(load_robot("athena"), friction={"law": "bristle"}, solver=solver)
        plant = stood(core, robot)
        for k in range(100):
            plant.step(5e-3 * (k + 1), marching(robot, 5e-3 * k))
        return np.asarray(plant.output().torso.position)

    exact = end(**ACCURATE)
    for tolerance in (1e-4, 1e-6):
        assert end(tolerance=tolerance) == pytest.approx(
            exact, abs=tolerance
        )  # m, after half a second


def test_a_stuck_leg_does_not_ring(core: ct.CDLL) -> None:
    """Checks that the standing robot is at rest within 0.2 s of a push.

    The bristles damp the motion that the servos leave.
    """
    robot = changed(load_robot("athena"), friction={"law": "bristle"}, solver=ACCURATE)
    plant, speeds = stood(core, robot), []
    pushed = Command(angle_ref=robot.stance, push_force=np.array([0.0, 5.0, 0.0]))
    plant.step(0.5, pushed)
    for k in range(60):
        plant.step(0.5 + 0.01 * (k + 1))
        speeds.append(float(np.max(plant.output().foot.slip_speed)))
    assert max(speeds) > 1e-5
    assert max(speeds[20:]) < 0.05 * max(speeds)
