"""Spin and rolling friction of the feet (eq. 38): discs and spheres that come to rest by closed
forms, the whole robot, and its energy balance.
"""

from __future__ import annotations

import ctypes as ct
from collections.abc import Callable

import numpy as np
import pytest
from plant import Plant, probed
from scipy.integrate import solve_ivp
from states import changed
from test_laws_standing import block, laid

from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.friction import turning_moment, turning_slopes
from hexapod_cosim.models.records import Array

SAME = 1e-13  # relative: the same formula, its operations in another order
REGULARISED = 1e-3  # relative: tanh(1e4 s/m v) is 1 to that from 0.4 mm/s on, of 0.1 m/s and more
UP = np.array([0.0, 0.0, 1.0])
TURNING = {"slope": 1e4, "mu": 0.5, "spin_radius": 2e-3, "rolling_radius": 1e-3}
ROBOT = changed(load_robot("athena"), friction=TURNING)
RADIUS = 0.015  # m  of a foot

Law = Callable[[Array], Array]  # moment over load of an angular velocity


def law_of(core: ct.CDLL, where: str) -> Law:
    """Returns the moment over load on level ground, of the twin or of the plant."""
    if where == "twin":
        return lambda w: turning_moment(ROBOT.friction, RADIUS, 1.0, UP, w)
    plant = Plant(core, ROBOT)
    return lambda w: probed(core.hx_probe_turning, plant, UP, w, size=5)[:3]


@pytest.mark.parametrize("law", ["tanh", "bristle", "lugre", "none"])
@pytest.mark.parametrize("mu_static", [0.0, 0.8])
def test_the_plants_moments_are_the_twins(core: ct.CDLL, law: str, mu_static: float) -> None:
    static = 0.0 if law == "none" else mu_static
    robot = changed(ROBOT, friction={"law": law, "mu_static": static, "slope": 100.0})
    plant, rng = Plant(core, robot), np.random.default_rng(1)
    for size in (0.0, 1e-6, 0.1, 1.0, 30.0):
        w, normal = size * rng.normal(size=3), rng.normal(size=3)
        normal /= np.linalg.norm(normal)
        got = probed(core.hx_probe_turning, plant, normal, w, size=5)
        twin = turning_moment(robot.friction, RADIUS, 1.0, normal, w)
        slopes = turning_slopes(robot.friction, RADIUS, normal, w)
        assert got == pytest.approx([*twin, *slopes], rel=SAME, abs=1e-18)


@pytest.mark.parametrize("where", ["twin", "plant"])
def test_a_spinning_disc_stops_when_the_moment_has_taken_its_spin(
    core: ct.CDLL, where: str
) -> None:
    """t = J w_0/(mu m g r_s): 1 kg, J = 1e-3 kg m2, 20 rad/s, 0.5, 2 mm: 2.0387 s."""
    law, inertia = law_of(core, where), 1e-3

    def rate(_: float, y: Array) -> list[float]:
        return [9.81 * float(law(y[0] * UP)[2]) / inertia]

    def slow(_: float, y: Array) -> float:
        return float(y[0] - 0.02)

    found = solve_ivp(rate, (0.0, 3.0), [20.0], "Radau", rtol=1e-8, atol=1e-10, events=slow)
    stopped = float(found.t_events[0][0])
    assert stopped == pytest.approx(2.0387 * (1.0 - 0.001), rel=REGULARISED)


@pytest.mark.parametrize("where", ["twin", "plant"])
def test_a_rolling_sphere_slows_down_by_its_rolling_radius(core: ct.CDLL, where: str) -> None:
    """Without slip, m a R (1 + 2/5) = m g r_r: a = 9.81 m/s2 (1/15)/(7/5) = 0.46714 m/s2."""
    law = law_of(core, where)

    def rate(_: float, y: Array) -> list[float]:
        moment = 9.81 * float(law(np.array([0.0, y[0] / RADIUS, 0.0]))[1])
        return [moment / (RADIUS * 1.4)]

    end = solve_ivp(rate, (0.0, 1.0), [0.6], "Radau", rtol=1e-8, atol=1e-10).y[0, -1]
    assert 0.6 - float(end) == pytest.approx(0.46714, rel=REGULARISED)


# the robot


def spinning(core: ct.CDLL, spin_radius: float) -> tuple[float, Robot]:
    """Returns the angular acceleration [rad/s2] of a robot with locked joints that spins on its
    feet.
    """
    robot = block("athena", gravity=-9.81 * UP)
    friction = {"slope": 1e4, "spin_radius": spin_radius, "mu": 0.1}
    robot = changed(robot, friction=friction)
    plant = laid(core, robot, np.eye(4)[0])
    body = plant.bodies
    body[:, 10:13] = 5.0 * UP
    body[:, 7:10] = 5.0 * np.cross(UP, body[:, 0:3] - body[0, 0:3])
    plant.bodies = body
    before = plant.output().torso.angular_velocity[2]
    plant.step(0.1)
    return (float(plant.output().torso.angular_velocity[2]) - float(before)) / 0.1, robot


def test_a_robot_that_spins_on_its_feet_slows_down_by_the_moments_of_all_feet(
    core: ct.CDLL,
) -> None:
    """mu N r of sliding feet and mu N r_s of their spin: with r_s = r the deceleration is twice
    that without. Feet at two radii give the mean, weighted by their loads; the robot's are all
    within 1 % of their mean's effect.
    """
    without, robot = spinning(core, 0.0)
    pose = np.array([foot[:2] for foot in laid(core, robot, np.eye(4)[0]).output().foot.position])
    arm = float(np.mean(np.linalg.norm(pose, axis=1)))
    more, _ = spinning(core, arm)
    assert without < 0.0
    assert more / without == pytest.approx(2.0, rel=1e-2)
