"""Tests closed forms of joint stops (eq. 39) and of spin and rolling friction
of the feet (eq. 38).
"""

from __future__ import annotations

import ctypes as ct
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from plant import Plant, probed
from scipy.integrate import solve_ivp
from states import changed, with_links
from test_laws_servo import CLOSED, tibia_inertia, tibias, walled
from test_laws_standing import block, laid

from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.actuator import overrun, stop_energy, stop_slopes, stop_torque
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.contact.geometry import turning_moment, turning_slopes
from hexapod_cosim.models.dynamics import Command

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


# Joint stops (eq. 39): a link that strikes its stop has closed forms; stops and books.

SPEED = 2.0  # rad/s  of a tibia that strikes its stop


def struck(**servo: Any) -> Robot:
    """Returns a walled robot without motors whose tibias have stops at -0.5 and 0.1 rad."""
    robot = walled(mode="torque", **({"stop_stiffness": 200.0} | servo))
    return with_links(robot, 2, angle_min=-0.5, angle_max=0.1)


def free() -> Command:
    return Command(angle_ref=np.zeros((6, 3)))


def knee(plant: Plant) -> tuple[Array, Array]:
    """Returns angles and speeds (6,) of the knees."""
    output = plant.output(free())
    return np.array(output.angle)[:, 2], np.array(output.speed)[:, 2]


# the law


@pytest.mark.parametrize("damping", [0.0, 0.5, 50.0])
def test_the_plants_stops_are_the_twins(core: ct.CDLL, damping: float) -> None:
    robot = struck(stop_damping=damping)
    plant, rng = Plant(core, robot), np.random.default_rng(1)
    seen = set()
    for angle, speed in zip(rng.uniform(-0.9, 0.5, 100), rng.normal(0.0, 5.0, 100), strict=True):
        past = overrun(np.array([angle]), np.array([-0.5]), np.array([0.1]))
        got = probed(core.hx_probe_stop, plant, 4, 2, float(angle), float(speed), size=4)
        torque = float(stop_torque(robot.servo, past, np.array([speed]))[0])
        slopes = [float(part[0]) for part in stop_slopes(robot.servo, past, np.array([speed]))]
        assert [got[0], *got[2:]] == pytest.approx([torque, *slopes], rel=SAME, abs=SAME)
        assert got[1] == pytest.approx(-torque - 200.0 * float(past[0]), abs=1e-12)
        seen.add((bool(past[0] != 0.0), slopes[1] != 0.0))
    assert (False, False) in seen


def test_a_stop_neither_pulls_nor_jumps() -> None:
    servo = struck(stop_damping=3.0).servo
    for speed in (-10.0, -1.0, 0.0, 1.0, 10.0):
        for past in (1e-9, 1e-3, 0.2):
            torque = float(stop_torque(servo, np.array(past), np.array(speed)))
            assert -2.0 * 200.0 * past <= torque <= 0.0
            mirrored = float(stop_torque(servo, np.array(-past), np.array(-speed)))
            assert mirrored == -torque


def test_a_stop_is_found_on_the_near_side_past_a_half_turn() -> None:
    """3.2 rad is 0.1 rad past a stop at 3.1 rad, not half a turn short of one at -1 rad."""
    low, high = np.array(-1.0), np.array(3.1)
    wrapped = np.array(3.2 - 2.0 * math.pi)
    assert float(overrun(wrapped, low, high)) == pytest.approx(0.1, abs=1e-12)
    assert float(overrun(np.array(3.0), low, high)) == 0.0


# a tibia that strikes its stop


def test_a_link_strikes_an_undamped_stop_and_returns_as_fast(core: ct.CDLL) -> None:
    """Half a period pi sqrt(I/k) in it, to w sqrt(I/k) deep; all its energy is the stop's there."""
    robot = struck()
    plant = Plant(core, robot, angle=tibias(0.1 - 0.2), speed=tibias(SPEED))
    time = math.sqrt(tibia_inertia(robot) / 200.0)
    plant.step(0.1 + 0.5 * math.pi * time, free())
    angle, speed = knee(plant)
    assert angle == pytest.approx(np.full(6, 0.1 + SPEED * time), rel=CLOSED)
    assert float(np.max(np.abs(speed))) < CLOSED * SPEED
    stored = 6.0 * 0.5 * tibia_inertia(robot) * SPEED**2
    past = np.full(6, SPEED * time)
    assert float(np.sum(stop_energy(robot.servo, past))) == pytest.approx(stored, rel=CLOSED)
    assert plant.output(free()).energy.potential == pytest.approx(stored, rel=CLOSED)
    plant.step(0.1 + math.pi * time + 0.05, free())
    angle, speed = knee(plant)
    assert speed == pytest.approx(np.full(6, -SPEED), rel=CLOSED)
    assert angle == pytest.approx(np.full(6, 0.1 - 0.05 * SPEED), abs=CLOSED)


@pytest.mark.parametrize("method", ["rosw3", "dp54"])
def test_what_a_damped_stop_takes_is_the_gear_loss_and_no_work_of_motors(
    core: ct.CDLL, method: str
) -> None:
    robot = changed(struck(stop_damping=0.5), solver={"method": method, "tolerance": 1e-9})
    plant = Plant(core, robot, angle=tibias(0.0), speed=tibias(SPEED))
    plant.step(0.3, free())
    _, speed = knee(plant)
    assert np.all(speed < -0.1)
    assert np.all(speed > -0.95 * SPEED)
    lost = 0.5 * tibia_inertia(robot) * float(np.sum(SPEED**2 - speed**2))
    energy = plant.output(free()).energy
    assert energy.gear_loss == pytest.approx(lost, rel=1e-5)
    assert energy.dissipated == pytest.approx(lost, rel=1e-5)
    assert energy.actuator_work == 0.0
    assert abs(energy.residual) < 1e-6 * lost


def test_a_servo_that_pushes_into_a_stop_rests_where_both_torques_agree(core: ct.CDLL) -> None:
    """tau/k = 1.5/200 rad past the stop."""
    robot = struck(stop_damping=2.0, torque_max=100.0, speed_max=1e6)
    plant = Plant(core, robot, angle=tibias(0.0))
    push = Command(angle_ref=np.zeros((6, 3)), torque_ref=tibias(1.5))
    plant.step(3.0, push)
    angle = np.array(plant.output(push).angle)[:, 2]
    assert angle == pytest.approx(np.full(6, 0.1 + 1.5 / 200.0), abs=1e-7)
