"""Single functions of the C controller equal those of the Python controller and closed forms."""

from __future__ import annotations

import ctypes as ct
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from gains import PERIOD, make_gains

from hexapod_cosim.controller import JointCommand, LegSolver, make_gait
from hexapod_cosim.controller.comply.support import Support
from hexapod_cosim.controller.sense.health import Health
from hexapod_cosim.controller.walk.inverse_dynamics import Demand, InverseDynamics
from hexapod_cosim.models import load_robot


def scattered(generator: np.random.Generator, reach: float) -> np.ndarray:
    """Returns feet (6, 2) whose root mean square distance from their centre is this [m]."""
    feet = generator.normal(size=(6, 2))
    return np.asarray(feet * reach / np.sqrt(((feet - feet.mean(axis=0)) ** 2).sum() / 6.0))


def pointers(*arrays: np.ndarray) -> list[ct.c_void_p]:
    return [array.ctypes.data_as(ct.c_void_p) for array in arrays]


@pytest.mark.parametrize(
    ("load", "reach"),
    [(50.0, 0.2), (50.0, 0.0125), (50.0, 0.0101), (50.0, 0.0099), (1.5e-6, 0.2), (0.6e-6, 0.2)],
)
def test_shares_are_the_same_down_to_no_load_or_feet_that_stand_together(
    controller_core: ct.CDLL, load: float, reach: float
) -> None:
    robot, generator = load_robot("athena"), np.random.default_rng(7)
    rest = InverseDynamics(robot, LegSolver(robot), period=PERIOD).rest()
    support, none = (
        Support(robot, make_gait(robot), make_gains(robot).support, rest=rest),
        np.zeros((6, 3)),
    )
    for active in (np.ones(6), generator.uniform(0.0, 1.0, 6), np.full(6, 1e-6)):
        feet, asked, found = (
            scattered(generator, reach),
            np.array([0.3, -0.2, load, 0.0, 0.0, 0.4]),
            np.empty((6, 3)),
        )
        controller_core.hx_probe_shares(*pointers(feet, active, asked, found))
        demand = Demand(
            none, np.zeros((6, 3, 3)), push=0.3 - 0.2j, weight=load, moment=0j, twist=0.4,
        )  # fmt: skip
        expected = support.shares(feet @ [1.0, 1.0j], active, demand).forces()
        scale = np.abs(expected).max(axis=0)  # scales of the pushes and of the loads
        np.testing.assert_allclose(
            found / scale, expected / scale, atol=1e-9
        )  # the system's condition number is at most 1e6


@pytest.mark.parametrize("extra", [0.0, 0.5, -0.5])
def test_the_torque_of_a_servo_that_moves_against_its_drag_is_explained(
    controller_core: ct.CDLL, extra: float
) -> None:
    """At 2 rad/s a stiffness of 10 N m/rad with 0.1 rad of error and a drag of 0.2 N m s/rad give
    0.6 N m. Of a larger load the rest is unexplained; of a smaller one what damping leaves, which
    may be up to 0.4 N m.
    """
    speed, load = 2.0, 0.6 + extra
    expected = {0.0: 0.0, 0.5: -0.5, -0.5: 0.1}[extra]
    found = np.empty(1)
    model = np.array([10.0, 0.2, 0.0, 4.0, PERIOD])
    joint = np.array([100.0, speed, speed, speed, 0.1, 0.0, load, load])
    controller_core.hx_probe_unexplained(*pointers(model, joint, found))
    assert 4.0 * found[0] == pytest.approx(expected, abs=1e-14)
    legs: Any = SimpleNamespace(speed_max=100.0, load_torques=lambda _angle, _force: every(load))
    health = Health(load_robot("athena"), None, legs=legs, period=PERIOD)
    health.stiffness, health.drag, health.rotor, health.most = 10.0, 0.2, 0.0, 4.0
    health.angle, health.speed = every(-speed * PERIOD), every(speed)
    command = JointCommand(angle_ref=every(0.1 - speed * PERIOD), speed_ref=every(speed))
    twin = health._unexplained(every(0.0), np.zeros((6, 3)), command, np.zeros(6, dtype=np.bool_))
    assert twin == pytest.approx(every(expected), abs=1e-14)


def every(value: float) -> np.ndarray:
    """Returns the value for each joint."""
    return np.full((6, 3), value)


def transcendental(core: ct.CDLL, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, ...]:
    """Returns sine, cosine, e^x - 1, tanh x, x^(2/3) and the angles of the points (x, y)."""
    out = [np.zeros_like(x) for _ in range(6)]
    core.hx_probe_transcendental(*pointers(x, y), (ct.c_void_p * 6)(*pointers(*out)), len(x))
    return tuple(out)


ULP = 2.3e-16  # relative to 1


def test_the_controllers_sines_and_cosines_are_exact_to_one_unit_in_the_last_place_of_1(
    controller_core: ct.CDLL,
) -> None:
    rng = np.random.default_rng(8)
    quarters = np.arange(-8, 9) * (0.5 * math.pi)
    x = np.concatenate(
        [quarters, rng.uniform(-7.0, 7.0, 5000), 10.0 ** rng.uniform(-300.0, 4.0, 2000)]
    )
    sine, cosine, *_ = transcendental(controller_core, x, x)
    assert np.max(np.abs(sine - np.sin(x))) <= ULP
    assert np.max(np.abs(cosine - np.cos(x))) <= ULP
    small = (np.abs(x) < 3.0) & (x != 0.0)
    assert np.max(np.abs(sine[small] / np.sin(x[small]) - 1.0)) <= 2 * ULP


def test_the_controllers_exponential_is_exact_and_ends_at_minus_one(
    controller_core: ct.CDLL,
) -> None:
    rng = np.random.default_rng(9)
    x = np.concatenate(
        [rng.uniform(-39.0, 39.0, 5000), 10.0 ** rng.uniform(-300.0, 0.0, 500), [0.0]]
    )
    *_, growth, tanh, _, _ = transcendental(controller_core, x, x)
    for found, expected in ((growth, np.expm1(x)), (tanh, np.tanh(x))):
        np.testing.assert_allclose(found, expected, rtol=4 * ULP, atol=0.0)
    far = np.array([-41.0, -1e9, -1e300])
    assert list(transcendental(controller_core, far, far)[2]) == [-1.0, -1.0, -1.0]
    ends = np.array([-1e300, 1e300])
    assert list(transcendental(controller_core, ends, ends)[3]) == [-1.0, 1.0]


def test_the_controllers_power_of_two_thirds_is_exact(controller_core: ct.CDLL) -> None:
    x = np.concatenate([10.0 ** np.random.default_rng(10).uniform(-190.0, 190.0, 5000), [8.0]])
    found = transcendental(controller_core, x, x)[4]
    np.testing.assert_allclose(found, np.cbrt(x) ** 2, rtol=5 * ULP, atol=0.0)
    assert found[-1] == pytest.approx(4.0, rel=5 * ULP)
    assert list(transcendental(controller_core, np.zeros(1), np.zeros(1))[4]) == [0.0]


def test_the_controllers_arc_tangent_is_that_of_the_quadrant(controller_core: ct.CDLL) -> None:
    rng = np.random.default_rng(11)
    axes = [(x, y) for y in (0.0, -0.0, 1.0, -1.0, 1e-9) for x in (1.0, -1.0, 1e-9, -1e-9)]
    diagonals = [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-3.0, -3.0)]
    points = np.concatenate(
        [
            rng.normal(size=(3000, 2)),
            rng.normal(size=(1000, 2)) * 10.0 ** rng.uniform(-250.0, 250.0, (1000, 2)),
            np.array(axes + diagonals),
        ]
    )
    x, y = np.ascontiguousarray(points.T)
    *_, found = transcendental(controller_core, x, y)
    np.testing.assert_allclose(found, np.arctan2(y, x), rtol=3 * ULP, atol=0.0)
    assert list(transcendental(controller_core, np.zeros(1), np.zeros(1))[5]) == [0.0]
