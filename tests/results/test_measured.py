"""Integrals and peaks measured by the plant equal sums over samples of 0.1 ms of the same walk."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from gains import make_gains
from measured import Samples, driven, integral, landing_rates, sampled, slipped

from hexapod_cosim.cosim.results.metrics import landing_rates as plant_rates
from hexapod_cosim.cosim.results.walk import View, Walk
from hexapod_cosim.cosim.run.run import simulate
from hexapod_cosim.cosim.scenario.records import CONTROLS
from hexapod_cosim.cosim.scenario.scenario import load_scenario
from hexapod_cosim.models import load_robot

PERIOD, CYCLES = 0.8, 3  # s, 1
AGREED = 5e-3  # relative
TIGHT, DEFAULT = 1e-6, 1e-4  # tolerances of the solver
# relative: of slip at the default tolerance, a creep of 0.5 mm/s beside errors of 0.004 mm/s in the
# motion itself
CREPT = 1e-2

pytestmark = pytest.mark.usefixtures("plant_build")


@dataclass(frozen=True)
class Twice:
    """The measured cycle of a walk: metrics from the plant, and samples."""

    metrics: dict[str, float]
    walk: Walk
    samples: Samples
    before: Samples  # and half a cycle before it
    crept: float  # relative, how near slip is


@pytest.fixture(
    scope="module",
    params=[(control, tolerance) for control in CONTROLS for tolerance in (DEFAULT, TIGHT)],
)
def twice(request: pytest.FixtureRequest, plant_build: Path) -> Twice:
    """Runs with the error control's steps and samples along steps of 0.1 ms: at a tight tolerance
    both are the same motion.
    """
    control, tolerance = request.param
    settings = (
        f"control={control}",
        "macro_step=0.005",
        f"gait.period={PERIOD}",
        f"solver.tolerance={tolerance}",
    )
    plan = load_scenario("walk_flat", overrides=[*settings, f"duration={CYCLES * PERIOD}"])
    gains = None if control == "kinematic" else make_gains(load_robot("athena"), period=0.005)
    result = simulate(plan, gains=gains)
    walk = View(result.outcome.judged, result.parameters, PERIOD).walk
    assert walk is not None
    before = sampled(plan, result.outcome.recording, begin=1.5 * PERIOD)
    return Twice(
        dict(result.metrics),
        walk,
        before.after(2.0 * PERIOD),
        before,
        CREPT if tolerance == DEFAULT else AGREED,
    )


def test_slip_is_the_way_of_loaded_feet_along_the_ground(twice: Twice) -> None:
    slip = slipped(twice.samples, twice.walk.weight) / twice.walk.distance
    assert twice.metrics["slip_per_metre"] == pytest.approx(slip, rel=twice.crept)


def test_cost_of_transport_is_the_positive_power_of_the_motors(twice: Twice) -> None:
    assert twice.metrics["cost_of_transport"] == pytest.approx(
        driven(twice.samples) / (twice.walk.weight * twice.walk.distance), rel=AGREED
    )


def test_torques_are_squared_over_all_time(twice: Twice) -> None:
    squares, servo = integral(twice.samples.torque**2), load_robot("athena").servo
    assert twice.metrics["torque_rms"] == pytest.approx(
        np.sqrt(squares.sum() / (18.0 * PERIOD)), rel=AGREED
    )
    assert twice.metrics["servo_load_max"] == pytest.approx(
        np.sqrt(squares.max() / PERIOD) / 1.2, rel=AGREED
    )
    assert twice.metrics["heat"] == pytest.approx(squares.sum() / twice.walk.distance, rel=AGREED)
    copper = squares.sum() / servo.motor_constant**2
    paid = (driven(twice.samples) + copper) / (twice.walk.weight * twice.walk.distance)
    assert twice.metrics["electrical_cost"] == pytest.approx(paid, rel=AGREED)


def test_the_peak_is_the_largest_force_of_all_samples(twice: Twice) -> None:
    assert twice.metrics["peak_force"] == pytest.approx(
        twice.samples.normal.max() / twice.walk.weight, rel=AGREED
    )


def test_landings_are_counted_and_as_steep_as_sampled(twice: Twice) -> None:
    """Every landing, except the softest of a walk, which is 1.5 % off at the default tolerance: it
    comes after a bounce, whose motion differs.
    """
    measured = np.sort(plant_rates(twice.walk))
    seen = np.sort(landing_rates(twice.before, apart=0.5 * PERIOD, after=2.0 * PERIOD))
    assert len(measured) == len(seen) == 6
    np.testing.assert_allclose(measured[1:], seen[1:], rtol=AGREED)
    assert measured[0] == pytest.approx(seen[0], rel=1.5e-2)
    assert twice.metrics["loading_rate"] == pytest.approx(
        np.percentile(seen, 95) / twice.walk.weight, rel=AGREED
    )


def test_the_use_of_the_friction_cone_is_that_of_the_samples(twice: Twice) -> None:
    """Percentiles within a bin of the plant's, which is 0.063 sqrt(share) wide; shares of time
    above 0.9 within 0.1 % of the time.
    """
    loaded = twice.samples.normal[1] > 0.01 * twice.walk.weight
    across = twice.samples.tangential[1][loaded]
    use = across / (0.7 * twice.samples.normal[1][loaded])
    p50, p95 = np.percentile(use, [50.0, 95.0])
    assert twice.metrics["cone_use_p50"] == pytest.approx(p50, abs=0.063 * np.sqrt(p50) / 2.0)
    assert twice.metrics["cone_use_p95"] == pytest.approx(p95, abs=0.063 * np.sqrt(p95) / 2.0)
    assert twice.metrics["cone_use_over_90"] == pytest.approx(float(np.mean(use > 0.9)), abs=1e-3)
