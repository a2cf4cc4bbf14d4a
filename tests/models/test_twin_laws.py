"""Tests the force laws of the twin: servo and gear, normal force, friction, ground."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from hexapod_cosim.models import load_robot
from hexapod_cosim.models.actuator import servo_torque
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.contact.law import (
    CHI,
    achieved_restitution,
    contact_damping,
    exact_restitution_chi,
    normal_force,
)
from hexapod_cosim.models.friction import friction_force
from hexapod_cosim.models.ground.faces import ground

EXACT = 1e-12  # relative: about 1e3 roundings
FIGURES = 1e-4  # of figures that are printed with four to six digits


def test_the_servo_follows_its_law_inside_the_torque_speed_line() -> None:
    servo = load_robot("athena").servo
    zero = np.zeros(1)
    assert servo_torque(servo, zero, zero, zero + 0.05, zero + 0.5, zero + 0.1)[0] == pytest.approx(
        40.0 * 0.05 + 0.8 * 0.5 + 0.1
    )
    assert servo_torque(servo, zero, zero, zero + 1.0, zero, zero)[0] == servo.torque_max
    assert servo_torque(servo, zero, zero + servo.speed_max / 2.0, zero + 1.0, zero, zero)[
        0
    ] == pytest.approx(servo.torque_max / 2.0)
    assert servo_torque(servo, zero, zero + 2.0 * servo.speed_max, zero + 9.0, zero, zero)[0] == 0.0
    assert servo_torque(servo, zero, zero - servo.speed_max / 4.0, zero - 1.0, zero, zero)[
        0
    ] == pytest.approx(-0.75 * servo.torque_max)
    assert servo_torque(servo, zero, zero + 99.0, zero - 9.0, zero, zero)[0] == -servo.torque_max


@pytest.mark.parametrize(
    ("e", "chi"), [(0.3, 3.0871), (0.5, 1.43275), (0.7, 0.634828), (0.9, 0.166482)]
)
def test_exact_restitution_has_the_reference_figures(e: float, chi: float) -> None:
    assert exact_restitution_chi(e) == pytest.approx(chi, rel=FIGURES)


@pytest.mark.parametrize("e", [1e-3, 0.05, 0.3, 0.5, 0.9, 0.999, 1.0 - 1e-9, 1.0])
def test_exact_restitution_is_exact_over_the_whole_range(e: float) -> None:
    assert achieved_restitution(exact_restitution_chi(e)) == pytest.approx(e, rel=EXACT)


@pytest.mark.parametrize(
    ("law", "achieved"),
    [
        ("hunt_crossley", 0.6630),
        ("lankarani_nikravesh", 0.7252),
        ("flores", 0.4704),
        ("exact_restitution", 0.5),
    ],
)
def test_each_law_gives_back_its_reference_figure_when_asked_for_a_half(
    law: str, achieved: float
) -> None:
    assert achieved_restitution(CHI[law](0.5)) == pytest.approx(achieved, rel=FIGURES)


@pytest.mark.parametrize("law", [*CHI, "hertz"])
def test_a_bouncing_foot_returns_with_the_achieved_restitution_and_the_predicted_penetration(
    law: str,
) -> None:
    contact, mass, v0 = replace(load_robot("athena").contact, law=law), 0.5, 0.4
    d, h, state, deepest = contact_damping(contact, v0), 2e-6, np.array([0.0, v0]), 0.0

    def rate(y: Array) -> Array:
        return np.array([y[1], -normal_force(contact, d, y[0], y[1]) / mass])

    while state[0] >= 0.0:
        k1 = rate(state)
        k2 = rate(state + 0.5 * h * k1)
        state = state + h * k2
        deepest = max(deepest, state[0])
    assert -state[1] / v0 == pytest.approx(achieved_restitution(d * v0), abs=1e-3)
    chi = d * v0
    share = 1.0 / chi - math.log1p(chi) / chi**2 if chi > 0.0 else 0.5
    assert deepest == pytest.approx(
        (2.5 * mass * v0**2 / contact.stiffness * share) ** 0.4, rel=1e-4
    )


def test_the_ground_never_pulls_and_a_slow_touch_down_counts_as_the_floor() -> None:
    contact = load_robot("athena").contact
    assert normal_force(contact, 100.0, 1e-3, -1.0) == 0.0
    assert normal_force(contact, 1.0, -1e-3, 1.0) == 0.0
    assert normal_force(contact, math.nan, 1e-3, 0.0) == 0.0
    assert (
        contact_damping(contact, 0.0)
        == contact_damping(contact, 0.01)
        > contact_damping(contact, 0.02)
    )


def test_friction_opposes_slip_within_the_cone_and_has_the_linear_limit() -> None:
    friction = load_robot("athena").friction
    for speed in (0.0, 1e-9, 0.99e-7, 1.01e-7, 1e-3, 1.0):
        force = friction_force(friction, 10.0, speed * np.array([0.6, -0.8, 0.0]))
        assert force == pytest.approx(
            -0.7 * 10.0 * math.tanh(100.0 * speed) * np.array([0.6, -0.8, 0.0]), rel=EXACT, abs=0.0
        )
        assert float(np.linalg.norm(force)) <= 7.0 * (1.0 + EXACT)
    assert not friction_force(replace(friction, law="none"), 10.0, np.ones(3)).any()


def test_a_slope_rises_by_its_incline_along_its_heading() -> None:
    terrain = replace(
        load_robot("athena").terrain, kind="slope", incline=0.2, heading=0.5, height=0.3
    )
    way = 2.0 * np.array([math.cos(0.5), math.sin(0.5), math.tan(0.2)])
    assert ground(terrain, np.array([0.0, 0.0, 0.3]) + way)[0] == pytest.approx(0.0, abs=EXACT)
    assert ground(terrain, np.array([0.0, 0.0, 1.3]))[0] == pytest.approx(math.cos(0.2))
    assert ground(replace(terrain, kind="flat"), np.array([5.0, 6.0, 0.7]))[0] == pytest.approx(0.4)
