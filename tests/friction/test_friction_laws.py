"""Static and viscous friction, and the LuGre law: closed forms of the laws by themselves, in the
twin and in the C plant, and of a mass on a spring that sticks and slips.

A mass of 1 kg behind a spring of 100 N/m on a belt at 0.1 m/s under 9.81 N, with coefficients 0.6
and 0.4: Coulomb's law slips for (2 pi - 2 atan(x w/v))/w, x = 0.2 g/w^2, w = 10/s, which is
0.408432 s, and sticks for 0.392400 s.
"""

from __future__ import annotations

import ctypes as ct
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from plant import Plant, probed
from scipy.integrate import solve_ivp

from hexapod_cosim.models import load_robot
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.friction import (
    Friction,
    bristle_rate,
    friction_drag,
    friction_force,
    friction_grip,
)

SAME = 1e-13  # relative: the same formula, its operations in another order
EXACT = 1e-12  # relative: rounding
# relative: the slip counts from 1 mm/s of 0.1 m/s on, which shortens it by 0.25 %; the law's own
# lengths, 1 um and 0.1 mm/s, are 1e-3 of the mass's
STICK_SLIP = 3e-3
STEEP = 5e-3  # relative: the same, and as much for what is left of the law's own lengths
ALONG = np.array([0.6, 0.8, 0.0])
OWN = load_robot("athena").friction
BOTH = replace(OWN, mu=0.4, mu_static=0.6, stribeck_speed=0.01, presliding=1e-4)
LAWS = ("tanh", "none", "bristle", "lugre")


def rig(core: ct.CDLL, friction: Friction) -> Plant:
    """Returns a plant with this friction, whose functions are probed."""
    return Plant(core, replace(load_robot("athena"), friction=friction))


def native(core: ct.CDLL, plant: Plant, slip: Array, bristle: Array) -> Array:
    """Returns the plant's -f_t/f_n (3,), db/dt (3,), stiffness, damping and release rate."""
    return probed(core.hx_probe_sliding, plant, slip, bristle, size=9)


# the laws are the same in C and in the twin


@pytest.mark.parametrize("viscous", [0.0, 0.7])
@pytest.mark.parametrize("mu_static", [0.0, 0.6])
@pytest.mark.parametrize("law", LAWS)
def test_the_plants_laws_are_the_twins(
    core: ct.CDLL, law: str, mu_static: float, viscous: float
) -> None:
    static = 0.0 if law == "none" else mu_static
    friction = replace(BOTH, law=law, mu_static=static, viscous=viscous)
    plant, rng = rig(core, friction), np.random.default_rng(1)
    for speed in (0.0, 1e-9, 1e-3, 0.01, 0.3):
        for size in (0.0, 0.5, 0.9, 1.0, 1.2):
            slip = speed * rng.normal(size=3)
            bristle = size * friction.presliding * ALONG
            got = native(core, plant, slip, bristle)
            slopes = friction_grip(friction, 1.0, slip, bristle)
            force = -friction_force(friction, 1.0, slip, bristle)
            twin = [*force, *bristle_rate(friction, slip, bristle)]
            assert got[:6] == pytest.approx(twin, rel=SAME, abs=SAME)
            expected = (slopes.stiffness, slopes.damping, slopes.relaxation)
            assert got[6:] == pytest.approx(expected, rel=SAME)


# the tanh law with static and viscous friction


@pytest.mark.parametrize(
    ("speed", "coefficient"),
    [
        (0.01, 0.5 * math.tanh(10.0)),
        (0.03, 0.42 * math.tanh(30.0)),
        (0.005, 0.56 * math.tanh(5.0)),
        (1e-4, 0.6 * math.tanh(0.1)),
    ],
)
def test_the_tanh_law_falls_along_the_stribeck_curve(speed: float, coefficient: float) -> None:
    """mu(v) tanh(k_t v) with k_t = 1000 s/m; 1e-4 of mu_s is what mu falls by at 0.1 mm/s."""
    friction = replace(BOTH, law="tanh", slope=1000.0)
    assert speed * friction_drag(friction, speed) == pytest.approx(coefficient, rel=1e-4)


def test_the_viscous_part_adds_its_coefficient_to_every_law() -> None:
    for law in ("tanh", "bristle", "lugre"):
        without = replace(BOTH, law=law)
        slip, bristle = 0.3 * ALONG, 0.4e-4 * ALONG
        more = friction_force(replace(without, viscous=0.5), 20.0, slip, bristle)
        less = friction_force(without, 20.0, slip, bristle)
        assert more - less == pytest.approx(-20.0 * 0.5 * 0.3 * ALONG, rel=EXACT)


# LuGre by itself


def steady(friction: Friction, speed: float) -> Array:
    """Returns the deflection (3,) of bristles that have slid long at a speed [m/s]."""
    static = max(friction.mu, friction.mu_static)
    above = (static - friction.mu) / (1.0 + (speed / friction.stribeck_speed) ** 2)
    share = (friction.mu + above) / static
    return share * friction.presliding * ALONG


@pytest.mark.parametrize(
    ("speed", "mu"), [(1e-9, 0.6), (0.01, 0.5), (0.03, 0.42), (0.07, 0.404), (1e6, 0.4)]
)
def test_lugre_slides_steadily_on_the_stribeck_curve(speed: float, mu: float) -> None:
    friction = replace(BOTH, law="lugre")
    bristle = steady(friction, speed)
    rate = bristle_rate(friction, speed * ALONG, bristle)
    assert rate == pytest.approx(np.zeros(3), abs=EXACT * speed)
    force = friction_force(friction, 10.0, speed * ALONG, bristle)
    assert force == pytest.approx(-10.0 * mu * ALONG, rel=1e-9)


def test_lugre_at_rest_has_the_damping_of_its_bristles() -> None:
    """sigma_1 = tau mu_0/b_max = 0.005 s 0.6/1e-4 m = 30 s/m."""
    friction = replace(BOTH, law="lugre", bristle_damping=0.005)
    slopes = friction_grip(friction, 1.0, np.zeros(3), np.zeros(3))
    assert slopes.damping == pytest.approx(30.0, rel=EXACT)
    assert slopes.stiffness == pytest.approx(6000.0, rel=EXACT)


def test_lugre_dissipates_in_every_motion_and_keeps_its_cone() -> None:
    """Power taken less growth of the bristles' energy mu_0 f_n b^2/(2 b_max) is not below 0."""
    friction, rng = replace(BOTH, law="lugre", bristle_damping=0.5), np.random.default_rng(2)
    for _ in range(2000):
        direction = rng.normal(size=3)
        slip = 10.0 ** rng.uniform(-6.0, 1.0) * direction / np.linalg.norm(direction)
        bristle = rng.normal(size=3)
        bristle *= rng.uniform(0.0, 1e-4) / np.linalg.norm(bristle)
        force = friction_force(friction, 1.0, slip, bristle)
        rate = bristle_rate(friction, slip, bristle)
        stored = 0.6 / 1e-4 * float(bristle @ rate)
        power = -float(force @ slip)
        assert power - stored >= -EXACT * (abs(power) + abs(stored))
        assert float(np.linalg.norm(force)) <= 0.6 * (1.0 + EXACT)


# a mass on a spring on a belt

Law = Callable[[Array, Array], tuple[float, float]]


def twin_law(friction: Friction) -> Law:
    """Returns the twin's law: f_t over f_n and db/dt, along x."""

    def law(slip: Array, bristle: Array) -> tuple[float, float]:
        force = friction_force(friction, 1.0, slip, bristle)
        return float(force[0]), float(bristle_rate(friction, slip, bristle)[0])

    return law


def native_law(core: ct.CDLL, friction: Friction) -> Law:
    """Returns the plant's law in the form of `twin_law`."""
    plant = rig(core, friction)

    def law(slip: Array, bristle: Array) -> tuple[float, float]:
        got = native(core, plant, slip, bristle)
        return -float(got[0]), float(got[3])

    return law


def phases(law: Law, *, size: float = 1.0) -> Array:
    """Returns the lengths [s] of the first slip and of the stick that follows.

    size: factor of speeds, lengths and forces, which changes no time.
    """
    x_axis = np.array([1.0, 0.0, 0.0])
    load, belt = 9.81 * size, 0.1 * size

    def rate(_: float, y: Array) -> list[float]:
        friction, bristle = law((y[1] - belt) * x_axis, y[2] * x_axis)
        return [y[1], load * friction - 100.0 * y[0], bristle]

    def behind(_: float, y: Array) -> float:
        return float(belt - y[1] - 0.01 * belt)

    found = solve_ivp(
        rate, (0.0, 1.9), [0.0, belt, 0.0], method="Radau", rtol=1e-7, atol=1e-12, events=behind
    )
    times = found.t_events[0]
    return np.asarray(np.diff(times[times > 0.3])[:2])


@pytest.mark.parametrize("where", ["twin", "plant"])
def test_a_mass_on_a_belt_sticks_and_slips_by_coulombs_closed_form(
    core: ct.CDLL, where: str
) -> None:
    friction = replace(
        BOTH, law="bristle", presliding=1e-6, stribeck_speed=1e-4, bristle_damping=0.005
    )
    tried = twin_law(friction) if where == "twin" else native_law(core, friction)
    assert phases(tried) == pytest.approx([0.408432, 0.392400], rel=STICK_SLIP)


@pytest.mark.parametrize("where", ["twin", "plant"])
def test_lugre_sticks_and_slips_by_the_closed_form_in_its_steep_limit(
    core: ct.CDLL, where: str
) -> None:
    """LuGre breaks away earlier the faster it is loaded, until bristles are short against v_s over
    the rate of loading: 1 nm and 30 um/s, here a thousandfold with a mass-spring of that size.
    """
    friction = replace(
        BOTH, law="lugre", presliding=1e-6, stribeck_speed=0.03, bristle_damping=0.005
    )
    tried = twin_law(friction) if where == "twin" else native_law(core, friction)
    assert phases(tried, size=1e3) == pytest.approx([0.408432, 0.392400], rel=STEEP)
