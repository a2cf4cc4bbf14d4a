"""Tests the plant's sine, cosine, arc tangent, logarithm and power, which do not use libm so that
every platform gives the same bits.
"""

from __future__ import annotations

import ctypes as ct
import math

import numpy as np
import pytest
from plant import pointer

ULP = 2.3e-16  # relative to 1
FEW_ULPS = 8e-16  # relative: a square root and two halvings of the angle before the polynomial
POWER = 1e-15  # relative: roundings of the logarithm's small part times the exponent
LOGARITHM = 4e-15  # relative: rounding of 1 + x and of twelve terms


@pytest.fixture(scope="module")
def arguments() -> np.ndarray:
    rng = np.random.default_rng(3)
    special = [
        0.0,
        1e-300,
        1e-9,
        0.25,
        -0.25,
        0.7,
        -0.999,
        1.0,
        math.pi / 4,
        math.pi / 2,
        math.pi,
        -math.pi,
        2 * math.pi,
        1e3,
    ]
    return np.concatenate(
        [
            special,
            rng.uniform(-7.0, 7.0, 4000),
            rng.uniform(-1.0, 0.5, 2000),
            10.0 ** rng.uniform(-12.0, 4.0, 1000),
        ]
    )


def evaluated(core: ct.CDLL, x: np.ndarray) -> tuple[np.ndarray, ...]:
    out = tuple(np.zeros_like(x) for _ in range(3))
    core.hx_probe_elementary(pointer(x), *map(pointer, out), len(x))
    return out


def test_sine_and_cosine_are_exact_to_one_unit_in_the_last_place_of_1(
    core: ct.CDLL, arguments: np.ndarray
) -> None:
    sine, cosine, _ = evaluated(core, arguments)
    assert np.max(np.abs(sine - np.sin(arguments))) <= ULP
    assert np.max(np.abs(cosine - np.cos(arguments))) <= ULP


def test_small_sines_are_exact_relative_to_themselves(core: ct.CDLL) -> None:
    x = np.concatenate(
        [10.0 ** np.linspace(-300.0, -1.0, 500), math.pi - 10.0 ** np.linspace(-9.0, -1.0, 500)]
    )
    sine, *_ = evaluated(core, x)
    assert np.max(np.abs(sine / np.sin(x) - 1.0)) <= 2 * ULP


def test_the_logarithm_is_exact_to_a_few_units_in_the_last_place(
    core: ct.CDLL, arguments: np.ndarray
) -> None:
    x = arguments[(arguments > -1.0) & (arguments != 0.0)]
    *_, logarithm = evaluated(core, x)
    assert np.max(np.abs(logarithm / np.log1p(x) - 1.0)) <= LOGARITHM
    assert np.all(evaluated(core, np.zeros(1))[2] == 0.0)


def test_the_arc_tangent_is_that_of_the_quadrant(core: ct.CDLL) -> None:
    core.hx_probe_atan2.restype = ct.c_double
    rng = np.random.default_rng(4)
    points = [
        *rng.normal(size=(2000, 2)),
        *(rng.normal(size=(500, 2)) * 10.0 ** rng.uniform(-100.0, 100.0, (500, 2))),
    ]
    axes = [(y, x) for y in (0.0, -0.0, 1.0, -1.0, 1e-9) for x in (1.0, -1.0, 1e-9, -1e-9)]
    for y, x in [*points, *axes]:
        got, expected = core.hx_probe_atan2(ct.c_double(y), ct.c_double(x)), math.atan2(y, x)
        assert abs(got - expected) <= FEW_ULPS * abs(expected)
    assert core.hx_probe_atan2(ct.c_double(0.0), ct.c_double(0.0)) == 0.0


def powers(core: ct.CDLL, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    out = np.zeros_like(x), np.zeros_like(x)
    core.hx_probe_power(pointer(x), pointer(y), *map(pointer, out), len(x))
    return out


def test_powers_are_exact_to_a_few_units_in_the_last_place(core: ct.CDLL) -> None:
    rng = np.random.default_rng(5)
    x = np.concatenate([10.0 ** rng.uniform(-12.0, 3.0, 4000), 10.0 ** rng.uniform(-300, -9, 500)])
    y = rng.uniform(-1.0, 3.0, len(x))
    y[4000:] = rng.uniform(-1.0, 1.0, 500)
    expected = np.array([math.pow(a, b) for a, b in zip(x, y, strict=True)])
    assert np.max(np.abs(powers(core, x, y)[0] / expected - 1.0)) <= POWER
