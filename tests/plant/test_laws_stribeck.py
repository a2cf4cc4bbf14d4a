"""Tests static friction above kinetic friction: the law alone, pushes, and a mass on a spring that
alternately sticks and slips.

The mass is the robot with locked joints. A spring of 100 N/m for each kilogram pulls it; the far
end of the spring moves at 0.1 m/s. With coefficients 0.6 and 0.4, under Coulomb's law the mass
sticks until the spring pulls with 0.6 m g, and slips for (2 pi - 2 atan(x w/v))/w with x = 0.2
g/w^2 and w = 10/s. A slip takes 0.408432 s and a stick 0.392400 s.
"""

from __future__ import annotations

import ctypes as ct
from dataclasses import replace

import numpy as np
import pytest
from plant import Plant
from states import changed
from test_laws_standing import block, laid

from hexapod_cosim.models import load_robot
from hexapod_cosim.models.dynamics import Command
from hexapod_cosim.models.friction import friction_force, sliding_friction

FRICTION = replace(
    load_robot("athena").friction,
    law="bristle",
    mu=0.4,
    mu_static=0.6,
    stribeck_speed=0.01,
    bristle_damping=0.0,
    presliding=1e-4,
)
ALONG = np.array([0.6, 0.8, 0.0])
EXACT = 1e-12  # relative: rounding


@pytest.mark.parametrize(
    ("speed", "mu"), [(0.0, 0.6), (0.01, 0.5), (0.03, 0.42), (0.07, 0.404), (1e9, 0.4)]
)
def test_friction_falls_from_static_to_kinetic_half_way_at_the_stribeck_speed(
    speed: float, mu: float
) -> None:
    assert sliding_friction(FRICTION, speed) == pytest.approx(mu, rel=EXACT)
    full = friction_force(FRICTION, 10.0, speed * ALONG, 1e-4 * ALONG)
    assert full == pytest.approx(-10.0 * mu * ALONG, rel=EXACT)


@pytest.mark.parametrize("slip", [0.0, 0.3, -0.3])
def test_a_foot_that_sticks_has_static_friction_however_it_swings(slip: float) -> None:
    """Half-way up a bristle, u = 0.5, the force is 0.6 times u (3 - u^2)/2 = 0.6875 of the load. A
    sliding foot that reverses sticks again.
    """
    assert friction_force(FRICTION, 10.0, slip * ALONG, 0.5e-4 * ALONG) == pytest.approx(
        -10.0 * 0.6 * 0.6875 * ALONG, rel=EXACT
    )
    if slip <= 0.0:
        assert friction_force(FRICTION, 10.0, slip * ALONG, 1e-4 * ALONG) == pytest.approx(
            -6.0 * ALONG, rel=EXACT
        )


@pytest.mark.parametrize("mu_static", [0.0, 0.4])
def test_without_static_friction_the_law_has_one_coefficient(mu_static: float) -> None:
    plain = replace(FRICTION, mu_static=mu_static)
    for speed in (0.0, 0.01, 0.3):
        assert sliding_friction(plain, speed) == 0.4


def sticky(core: ct.CDLL, **friction: float) -> Plant:
    robot = block("athena", gravity=np.array([0.0, 0.0, -9.81]), law="bristle")
    return laid(
        core, changed(robot, friction={"mu": 0.4, "mu_static": 0.6} | friction), np.eye(4)[0]
    )


def pushed(plant: Plant, begin: float, end: float, *, until: float) -> None:
    """Pushes the plant along x with a force that changes linearly from one share of the weight to
    another.
    """
    now, weight = plant.output().time, plant.robot.total_mass * 9.81
    along, none = np.array([weight, 0.0, 0.0]), np.zeros((6, 3))
    rate = Command(angle_ref=none, push_force=(end - begin) / (until - now) * along)
    plant.step_ramp(until, replace(plant.hold(), push_force=begin * along), rate)


@pytest.mark.parametrize(("share", "holds"), [(0.45, True), (0.59, True), (0.61, False)])
def test_a_push_that_grows_is_held_up_to_the_static_coefficient(
    core: ct.CDLL, share: float, holds: bool
) -> None:
    """The bristles are short, because bristles that deflect quickly near the limit slide and lose
    static friction.
    """
    plant = sticky(core, presliding=1e-5)
    pushed(plant, 0.0, share, until=1.0)
    pushed(plant, share, share, until=2.0)
    assert bool(plant.output().torso.velocity[0] < 1e-6) == holds


def test_a_block_that_was_set_off_slides_on_with_kinetic_friction(core: ct.CDLL) -> None:
    """A push of half the weight does not move the block and a larger one does. Under half the
    weight again the block accelerates by (0.5 - 0.4) g.
    """
    plant = sticky(core)
    pushed(plant, 0.0, 0.5, until=1.0)
    assert abs(float(plant.output().torso.velocity[0])) < 1e-3
    pushed(plant, 0.8, 0.8, until=1.1)
    pushed(plant, 0.5, 0.5, until=1.2)
    before = float(plant.output().torso.velocity[0])
    pushed(plant, 0.5, 0.5, until=1.4)
    assert before > 0.1
    assert (float(plant.output().torso.velocity[0]) - before) / 0.2 == pytest.approx(
        0.981, rel=2e-3
    )


def phases(plant: Plant, *, until: float, h: float = 2e-3) -> tuple[list[float], list[float]]:
    """Returns the durations [s] of the slips of the block behind its spring and of the sticks
    between them.
    """
    mass, place = plant.robot.total_mass, plant.output().torso.position[0]
    moving, changes, last = False, [], 0.0
    for k in range(round(until / h)):
        torso = plant.output().torso
        pull = 100.0 * mass * (0.1 * k * h - (torso.position[0] - place))
        command = replace(plant.hold(), push_force=np.array([pull, 0.0, 0.0]))
        rate = 100.0 * mass * (0.1 - torso.velocity[0])
        none = np.zeros((6, 3))
        plant.step_ramp(
            (k + 1) * h, command, Command(angle_ref=none, push_force=np.array([rate, 0.0, 0.0]))
        )
        speed = float(plant.output().torso.velocity[0])
        if (speed > 1e-3) != moving:
            moving = not moving
            changes.append((k + (1e-3 - last) / (speed - last)) * h)
        last = speed
    lengths = np.diff(changes)
    return lengths[0::2].tolist(), lengths[1::2].tolist()


def test_a_mass_on_a_spring_sticks_and_slips_by_its_closed_form(core: ct.CDLL) -> None:
    """The durations agree to 0.3 %, of which 0.25 % come from the 1 mm/s above which the block
    counts as moving.
    """
    slips, sticks = phases(sticky(core, presliding=2e-6, stribeck_speed=2e-4), until=2.4)
    assert len(slips) >= 2
    assert slips == pytest.approx([0.408432] * len(slips), rel=3e-3)
    assert sticks == pytest.approx([0.392400] * len(sticks), rel=3e-3)
