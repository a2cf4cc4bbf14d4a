"""Tests the restitution that a drop reports."""

from __future__ import annotations

from pathlib import Path

import pytest

from hexapod_cosim.cosim.results.drop import drop_text
from hexapod_cosim.cosim.run.run import simulate
from hexapod_cosim.cosim.scenario.scenario import load_scenario

STIFF = "contact.stiffness=1e9"  # the weight acts for too short a time to matter
NEAR = 5e-3  # of the restitution: what is left of the weight's part


@pytest.mark.usefixtures("plant_build")
@pytest.mark.parametrize(
    ("law", "delivered"), [("exact_restitution", 0.5), ("hunt_crossley", 0.6630)]
)
def test_a_stiff_ground_delivers_what_the_law_promises(law: str, delivered: float) -> None:
    scenario = load_scenario("drop", overrides=[STIFF, f"contact.law={law}", "duration=0.6"])
    drop = simulate(scenario).facts["drop"]
    assert drop["asked"] == 0.5
    assert drop["of_the_law"] == pytest.approx(delivered, abs=1e-4)
    assert drop["bounces"][0]["restitution"] == pytest.approx(delivered, abs=NEAR)


@pytest.mark.usefixtures("plant_build")
def test_a_drop_is_not_warned_of_figures_of_walks() -> None:
    facts = simulate(load_scenario("drop")).facts
    assert facts["drop"] is not None
    assert not [text for text in facts["warnings"] if "walked less" in text or "swung" in text]


@pytest.mark.usefixtures("plant_build")
def test_a_walk_reports_no_drop() -> None:
    assert simulate(load_scenario("walk_flat", overrides=["duration=0.1"])).facts["drop"] is None


def test_the_text_of_a_drop_tells_asked_and_delivered(tmp_path: Path) -> None:
    bounces = [{"time": 0.1, "speed": 0.94, "restitution": 0.4926}]
    facts = {"asked": 0.5, "of_the_law": 0.5, "bounces": bounces}
    assert drop_text(facts) == (
        "Asked for restitution 0.5, the law gives 0.5000; delivered 0.4926 at 0.94 m/s."
    )
