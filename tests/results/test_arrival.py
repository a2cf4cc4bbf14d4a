"""Which runs arrive at the end of the commanded path, and that comparisons count no others."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from hexapod_cosim.cosim.master.loop import COMPLETED
from hexapod_cosim.cosim.report.headline import headline
from hexapod_cosim.cosim.report.writing import comparison_rows
from hexapod_cosim.cosim.results.arrival import missed_end
from hexapod_cosim.cosim.results.comparison import compare_runs, read_seeds, write_seeds
from hexapod_cosim.cosim.results.metrics import METRICS
from hexapod_cosim.cosim.results.summary import Summary
from hexapod_cosim.cosim.results.uncertainty import compare_all

STUCK = "the robot did not arrive: it missed the end by 5.5 m per metre walked"


def run(control: str, seed: int, missed: str = "") -> Summary:
    metrics = dict.fromkeys(METRICS, 1.0 if control == "kinematic" else 0.1)
    return Summary(
        control=control, seed=seed, status=COMPLETED, upright=True, missed=missed, metrics=metrics
    )


@pytest.mark.parametrize(
    ("path", "turn", "text"),
    [
        (0.49, math.nan, ""),
        (5.5, math.nan, STUCK),
        (math.nan, 0.49, ""),
        (math.nan, 0.6, "missed the end by 0.6 rad per radian turned"),
        (math.nan, math.nan, "the robot did not get ahead"),
    ],
)
def test_a_robot_arrives_within_half_of_its_way(path: float, turn: float, text: str) -> None:
    found = missed_end({"path_error": path, "yaw_drift_per_radian": turn})
    assert text in found
    assert bool(text) == bool(found)


def test_a_stuck_robot_has_not_walked_and_is_not_praised() -> None:
    before = [run("kinematic", seed) for seed in range(3)]
    after = [run("mine", seed, missed=STUCK) for seed in range(3)]
    comparison = compare_all({"kinematic": before, "mine": after})
    assert comparison.walked == {"kinematic": 3, "mine": 0}
    assert comparison.losses[0] == f"mine, seed 0: {STUCK}"
    assert comparison_rows(comparison)[0]["values"] == ["3 of 3", "0 of 3"]
    said = "".join(part.text for part in headline(comparison.main))
    assert "less" not in said
    assert said.endswith("No pair of walks can be compared.")


def test_changes_are_of_the_pairs_in_which_both_arrived() -> None:
    before = [run("kinematic", seed) for seed in range(3)]
    after = [run("mine", 0, missed=STUCK), run("mine", 1), run("mine", 2)]
    assert compare_runs(before, after).changes["peak_force"].pairs == 2


def test_seeds_csv_keeps_who_arrived(tmp_path: Path) -> None:
    runs = [run("kinematic", 0), run("mine", 0, missed=STUCK)]
    write_seeds(tmp_path / "seeds.csv", runs)
    assert read_seeds(tmp_path / "seeds.csv") == {"kinematic": [runs[0]], "mine": [runs[1]]}
