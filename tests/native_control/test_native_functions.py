"""Single functions of the C controller equal those of the Python controller and closed forms."""

from __future__ import annotations

import ctypes as ct

import numpy as np
import pytest
from gains import PERIOD, make_gains
from scipy.linalg import expm

from hexapod_cosim.controller import (
    LegSolver,
    make_gait,
)
from hexapod_cosim.controller.comply.slip_pid import squeeze
from hexapod_cosim.controller.comply.support import Support
from hexapod_cosim.controller.walk.inverse_dynamics import Demand, InverseDynamics
from hexapod_cosim.models import load_robot


def scattered(generator: np.random.Generator, reach: float) -> np.ndarray:
    """Returns feet (6, 2) whose root mean square distance from their centre is this [m]."""
    feet = generator.normal(size=(6, 2))
    return np.asarray(feet * reach / np.sqrt(((feet - feet.mean(axis=0)) ** 2).sum() / 6.0))


def pointers(*arrays: np.ndarray) -> list[ct.c_void_p]:
    return [array.ctypes.data_as(ct.c_void_p) for array in arrays]


@pytest.mark.parametrize("load", [1.0, 0.3e-6, 0.12e-6, 0.0])
@pytest.mark.parametrize("reach", [0.2, 0.0101, 0.0099])
def test_the_squeeze_is_the_same_down_to_feet_without_load_or_that_stand_together(
    controller_core: ct.CDLL, load: float, reach: float
) -> None:
    generator = np.random.default_rng(6)
    for _ in range(10):
        found, feet, normal = (
            generator.normal(size=(6, 2)),
            scattered(generator, reach),
            np.full(6, load),
        )
        expected = squeeze(
            np.asarray(found @ [1.0, 1.0j], dtype=np.complex128), normal, feet @ [1.0, 1.0j]
        )
        controller_core.hx_probe_squeeze(*pointers(normal, feet, found))
        np.testing.assert_allclose(found @ [1.0, 1.0j], expected, atol=1e-12)


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


@pytest.mark.parametrize("ratio", [0.05, 0.999999, 1.0, 1.000001, 3.0, 1e4])
def test_the_suspension_is_the_matrix_exponential_whatever_its_damping(
    controller_core: ct.CDLL, ratio: float
) -> None:
    mass, stiffness, period = 1.7, 4100.0, 0.005
    damping, system = 2.0 * ratio * np.sqrt(stiffness * mass), np.zeros((3, 3))
    system[0, 1], system[1] = 1.0, np.array([-stiffness, -damping, 1.0]) / mass
    found = (ct.c_double * 6)()
    controller_core.hx_probe_suspension(
        *(ct.c_double(value) for value in (mass, damping, stiffness, period)), found
    )
    expected = expm(system * period)
    scale = np.array([[1.0, period], [1.0 / period, 1.0]])
    np.testing.assert_allclose(
        np.array(found[:4]).reshape(2, 2) / scale, expected[:2, :2] / scale, atol=1e-12
    )
    np.testing.assert_allclose(found[4:], expected[:2, 2], rtol=1e-9, atol=1e-12 / stiffness)
