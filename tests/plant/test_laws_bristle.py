"""Tests the bristle law of friction by itself and with the whole plant: a block on an incline,
pushes, and a walk.
"""

from __future__ import annotations

import ctypes as ct
import math
from dataclasses import replace

import numpy as np
import pytest
from states import changed
from test_laws_standing import block, laid, marching, stood, tilted

from hexapod_cosim.models import load_robot
from hexapod_cosim.models.friction import SPRING_LIMIT, bristle_rate, friction_force

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
