"""Tests the restitution that a drop reports."""

from __future__ import annotations

import numpy as np
import pytest

from hexapod_cosim.cosim.results.drop import Bounce, Drop
from hexapod_cosim.cosim.run.single_run import simulate
from hexapod_cosim.cosim.scenario.reading import load_scenario

STIFF = "contact.stiffness=1e9"  # the weight acts for too short a time to matter
NEAR = 5e-3  # of the restitution: what is left of the weight's part


@pytest.mark.usefixtures("plant_build")
@pytest.mark.parametrize(
    ("law", "delivered"), [("exact_restitution", 0.5), ("hunt_crossley", 0.6630)]
)
def test_a_stiff_ground_delivers_what_the_law_promises(law: str, delivered: float) -> None:
    scenario = load_scenario("drop", overrides=[STIFF, f"contact.law={law}", "duration=0.6"])
    drop = simulate(scenario).facts.drop
    assert drop is not None
    assert drop.asked == 0.5
    assert drop.of_the_law == pytest.approx(delivered, abs=1e-4)
    assert drop.bounces[0].restitution == pytest.approx(delivered, abs=NEAR)


@pytest.mark.usefixtures("plant_build")
@pytest.mark.parametrize("stiffness", [1e7, 1e8, 1e9])
def test_the_peak_of_a_drop_is_that_of_a_hertz_impact(stiffness: float) -> None:
    """A sphere of a sixth of the mass stores its energy at its depth: 2/5 K d^(5/2) = E.

    The ground gives all of it back, and the peak is neither rounded nor missed where the impact is
    shorter than a macro-step of 2 ms (0.7 ms at 1e9 N/m^1.5).
    """
    law = ["contact.law=hertz", f"contact.stiffness={stiffness}", "duration=0.4"]
    result = simulate(load_scenario("drop", overrides=law))
    weight, mass, g = 54.936, 5.6 / 6, 9.81  # N of the robot, kg on a foot, m/s2
    assert result.facts.drop is not None
    first = result.facts.drop.bounces[0]
    depth = (first.peak * weight / stiffness) ** (2.0 / 3.0)
    energy = 0.5 * mass * first.speed**2 + mass * g * depth
    assert 0.4 * stiffness * depth**2.5 == pytest.approx(energy, rel=1e-4)
    assert first.restitution == pytest.approx(1.0, abs=1e-4)
    assert result.metrics["peak_force"] == pytest.approx(first.peak, rel=1e-4)


@pytest.mark.usefixtures("plant_build")
def test_the_metrics_of_a_drop_are_of_all_of_it() -> None:
    """The peak is in the first 0.1 s; in its last second the robot stands."""
    result = simulate(load_scenario("drop"))
    assert result.facts.drop is not None
    bounces = result.facts.drop.bounces
    peaks = [bounce.peak for bounce in bounces]
    assert peaks == sorted(peaks, reverse=True)
    assert result.metrics["peak_force"] == peaks[0] > 20.0  # BW
    assert np.isnan(result.metrics["slip_per_metre"])
    times = np.diff([bounce.time for bounce in bounces])
    flights = [2.0 * bounce.speed / 9.81 for bounce in bounces[1:]]  # s    at its speed
    assert times == pytest.approx(flights, abs=4e-3)  # two macro-steps


def test_the_text_of_a_drop_tells_asked_and_delivered() -> None:
    bounce = Bounce(time=0.1, speed=0.94, peak=51.2, restitution=0.4926)
    assert Drop(0.5, 0.5, (bounce,)).text == (
        "Asked for restitution 0.5, the law gives 0.5000; "
        "delivered 0.4926 at 0.94 m/s (peak 51.2 BW)."
    )
