"""Tests the slow loops on ideal geometry: the feet are fixed to the ground, and the torso lies or
walks otherwise than planned.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from gains import HOLD, PERIOD
from standing import HOME

from hexapod_cosim.controller import Parts
from hexapod_cosim.controller.walk.hold import Hold, HoldInput, fit_plane

LEVEL = np.full(6, -0.12)  # m; planned heights of the feet
LOADS = np.full(6, 0.5)  # relative to a third of the weight
LOOKS = 200
EXACT = 1e-12


def make(parts: Parts | None = None, **changes: float) -> Hold:
    return Hold(replace(HOLD, **changes), Parts() if parts is None else parts, period=PERIOD)


def sight(**changes: Any) -> HoldInput:
    """Returns what the loops see of a robot that rests as planned, with changes."""
    still = HoldInput(HOME, LEVEL, HOME, LEVEL, LOADS, np.zeros(2), 0.0, 0j, 0.0)
    values: dict[str, Any] = {
        name: np.array(value) if isinstance(value, list | tuple) else value
        for name, value in changes.items()
    }
    return still._replace(**values)


def seen_heights(low: float, roll: float, pitch: float) -> np.ndarray:
    """Returns heights (6,) of feet on a plane, seen from a torso that is too low by `low` [m] and
    inclined, to first order.
    """
    return np.asarray(LEVEL + low + HOME.real * pitch - HOME.imag * roll)


def plane(height: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Returns the coefficients (3,) of the plane through the feet of the stance."""
    found = fit_plane(HOME, height, weights)
    assert found is not None
    return found


def settle(
    hold: Hold,
    *,
    low: float = 0.0,
    roll: float = 0.0,
    pitch: float = 0.0,
    ground: tuple[float, float] = (0.0, 0.0),
) -> Iterator[np.ndarray]:
    """Yields the remaining error of height and tilt [m, rad, rad] while the lift of the feet takes
    effect.

    Raising the feet by lift = a + b x + c y (torso axes) lowers the torso by a and inclines it.
    """
    base = np.column_stack([np.ones(6), HOME.real, HOME.imag])
    for _ in range(LOOKS):
        a, b, c = np.linalg.lstsq(base, np.array(hold.lift), rcond=None)[0]
        # raising the feet by b x in torso axes while they stand on the ground lowers the nose:
        # pitch grows by b, roll by -c
        now = np.add([low, roll, pitch], [a, -c, b])
        tilt = now[1] + ground[0], now[2] + ground[1]
        hold.update(sight(height=seen_heights(*now), tilt=tilt))
        yield now


def test_a_plane_through_points_is_found_whatever_their_weights() -> None:
    generator = np.random.default_rng(2)
    for _ in range(20):
        c, along, across = generator.normal(size=3)
        weights = generator.uniform(0.31, 2.0, 6)
        height = c + along * HOME.real + across * HOME.imag
        np.testing.assert_allclose(plane(height, weights), (c, along, across), atol=EXACT)


def test_a_plane_near_points_is_the_weighted_least_squares() -> None:
    generator = np.random.default_rng(3)
    height, weights = generator.normal(size=6), generator.uniform(0.31, 2.0, 6)
    base, root = np.column_stack([np.ones(6), HOME.real, HOME.imag]), np.sqrt(weights)
    expected = np.linalg.lstsq(base * root[:, None], height * root, rcond=None)[0]
    np.testing.assert_allclose(plane(height, weights), expected, atol=EXACT)


@pytest.mark.parametrize(
    ("low", "roll", "pitch"),
    [
        (0.005, 0.0, 0.0),
        (-0.005, 0.0, 0.0),
        (0.0, 0.02, 0.0),
        (0.0, 0.0, -0.02),
        (0.004, -0.01, 0.02),
    ],
)
def test_a_torso_that_lies_wrong_is_driven_back_at_the_stated_rates(
    low: float, roll: float, pitch: float
) -> None:
    hold = make()
    left = np.array(list(settle(hold, low=low, roll=roll, pitch=pitch)))
    time = hold.every * PERIOD * np.arange(LOOKS)
    # an integrator with time steps h: (1 - rate h)^k, which differs from e^(-rate t) by a relative
    # rate h/2
    np.testing.assert_allclose(
        left[:, 0],
        low * (1.0 - HOLD.height_rate * hold.every * PERIOD) ** np.arange(LOOKS),
        atol=1e-9,
    )
    for column, start in ((1, roll), (2, pitch)):
        np.testing.assert_allclose(
            left[:, column],
            start * np.exp(-HOLD.attitude_rate * time),
            atol=0.1 * abs(start) + EXACT,
        )
    assert np.abs(left[-1]).max() < 1e-5


def test_ground_that_begins_to_slope_is_followed_with_its_time() -> None:
    """The loop first compensates the tilt that the sensor measures; later it attributes the tilt to
    the ground.
    """
    hold = make()
    list(settle(hold))
    first = np.array(list(settle(hold, ground=(0.0, 0.03))))
    assert np.abs(first).max() > 0.005
    for _ in range(4):
        last = np.array(list(settle(hold, ground=(0.0, 0.03))))
    assert np.abs(last[-1]).max() < 1e-3


def test_corrections_of_the_posture_have_limits() -> None:
    hold = make()
    for _ in range(500):
        hold.update(sight(height=seen_heights(0.05, 0.0, 0.0)))
    np.testing.assert_allclose(hold.lift, -HOLD.height_limit)
    hold.reset()
    hold.update(sight())
    for _ in range(60):
        hold.update(sight(height=seen_heights(0.0, 0.4, 0.0), tilt=(0.4, 0.0)))
    np.testing.assert_allclose(hold.lift, HOLD.angle_limit * HOME.imag, atol=EXACT)


def test_a_foot_counts_beyond_four_tenths_of_a_third_of_the_weight() -> None:
    height = np.array([0.003, 0.0, 0.0, 0.0, 0.0, 0.0])
    for load, counts in ((0.4, False), (0.41, True)):
        found = plane(height, np.array([load, 1.0, 1.0, 1.0, 1.0, 1.0]))
        assert bool(np.abs(found).max() > 1e-5) is counts
        hold = make()
        for k in range(2):
            hold.update(sight(plane=HOME - 0.01 * k, load=[load] * 6))
        assert (abs(hold.way) > 1e-3) is counts


def walk(
    hold: Hold,
    v: complex,
    yaw_rate: float,
    *,
    legs: tuple[int, ...],
    ordered: tuple[complex, float],
    looks: int = 100,
) -> tuple[complex, float]:
    """Moves a torso with a steady twist over feet fixed to the ground; all but `legs` are in the
    air.

    Returns the true displacement and heading.
    """
    way, yaw, time = 0j, 0.0, hold.every * PERIOD
    loads = [1.0 if leg in legs else 0.0 for leg in range(6)]
    for k in range(looks + 1):
        yaw = yaw_rate * k * time
        way = v * k * time if yaw_rate == 0.0 else v * (np.exp(1j * yaw) - 1.0) / (1j * yaw_rate)
        feet = np.exp(-1j * yaw) * (HOME - way)
        shaken = np.where(
            np.array(loads) > 0.0, feet, feet + 0.1 * np.sin(k)
        )  # feet in the air may be anywhere
        hold.update(
            sight(plane=shaken, load=loads, yaw=yaw, velocity=ordered[0], yaw_rate=ordered[1])
        )
    return way, yaw


@pytest.mark.parametrize("legs", [(0, 2, 4), (1, 3, 5), (0, 1, 2, 3, 4, 5), (2,)])
@pytest.mark.parametrize("yaw_rate", [0.0, 0.3, -0.2])
def test_the_way_and_heading_lost_are_the_commanded_less_the_true_ones_whichever_legs_stand(
    yaw_rate: float, legs: tuple[int, ...]
) -> None:
    hold, looks = make(), 100
    ordered = 0.08 + 0.01j, 0.25
    way, yaw = walk(hold, 0.07 - 0.02j, yaw_rate, legs=legs, ordered=ordered, looks=looks)
    time = hold.every * PERIOD * looks
    assert hold.heading == pytest.approx(ordered[1] * time - yaw, abs=1e-9)
    # the commanded displacement, along the commanded heading in the middle of each look
    middle = ordered[1] * hold.every * PERIOD * (np.arange(looks) + 0.5)
    commanded = (ordered[0] * np.exp(1j * middle) * hold.every * PERIOD).sum()
    assert hold.way == pytest.approx(commanded - way, abs=1e-9)


def test_without_a_foot_that_stood_all_the_time_the_way_is_taken_as_commanded() -> None:
    hold = make()
    for k in range(10):
        loads = [1.0 if (leg + k) % 2 else 0.0 for leg in range(6)]
        hold.update(sight(plane=HOME * k, load=loads, velocity=0.1 + 0j))
    assert hold.way == 0j


@pytest.mark.parametrize("heading", [0.0, 2.0])
def test_steering_drives_a_steady_loss_to_a_steady_correction_that_makes_it_good(
    heading: float,
) -> None:
    """The robot walks 6 mm/s less than commanded and turns 0.01 rad/s more."""
    hold, time, way, yaw = make(), make().every * PERIOD, 0j, heading
    for _ in range(600):
        feet = np.exp(-1j * yaw) * (HOME - way)
        hold.update(sight(plane=feet, yaw=yaw, velocity=0.08 + 0j, yaw_rate=0.0))
        way += np.exp(1j * yaw) * (0.08 + hold.velocity - 0.006) * time
        yaw += (hold.yaw_rate + 0.01) * time
    # the turn leaves a constant heading error, so the robot walks a little sideways to keep to the
    # commanded heading
    assert hold.heading == pytest.approx(-0.01 / HOLD.path_rate, rel=1e-3)
    assert hold.velocity == pytest.approx(
        0.006 + 0.08 * (np.exp(1j * hold.heading) - 1.0), abs=1e-4
    )
    assert hold.yaw_rate == pytest.approx(-0.01, abs=1e-6)
    assert abs(hold.way) == pytest.approx(abs(hold.velocity) / HOLD.path_rate, rel=0.02)


def test_parts_switched_off_do_nothing() -> None:
    hold = make(Parts(posture=False, path=False))
    walk(hold, 0.07 + 0j, 0.1, legs=(0, 2, 4), ordered=(0.08 + 0j, 0.0))
    hold.update(sight(height=seen_heights(0.01, 0.1, 0.1), tilt=(0.1, 0.1)))
    assert not any(hold.lift)
    assert hold.velocity == 0j
    assert hold.yaw_rate == 0.0
