"""Runs whose energy balance do not close, and servos above their rating: told from where to where,
in literal numbers.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from command import Call
from walks import PARAMETERS, PERIOD, ROBOT, Walk

from hexapod_cosim.cosim.results.walk import View
from hexapod_cosim.cosim.results.warnings import energy_warnings, servo_warnings, walk_warnings


def books(missing: float) -> Walk:
    """The motors did 60 J and took 40 J; so much [J] is missing at the end."""
    walk = Walk()
    walk.grow("LF.femur.positive_work", 6.0)
    walk.grow("RM.tibia.negative_work", 4.0)
    walk.set("energy.residual", missing * walk.time / 10.0)
    return walk


@pytest.mark.parametrize(
    ("missing", "told"), [(0.99, ""), (-0.99, ""), (1.01, "1.01%"), (-4.3, "4.30%")]
)
def test_books_that_miss_more_than_a_hundredth_of_the_motors_work_are_told(
    missing: float, told: str
) -> None:
    found = energy_warnings(View(books(missing).recording, PARAMETERS, PERIOD))
    assert len(found) == (1 if told else 0)
    assert all(
        f"the energy balance does not explain {told} of the motors' work: tighten solver.tolerance"
        in text
        for text in found
    )


def test_books_that_are_wrong_in_the_middle_of_a_run_are_told_though_they_close_at_its_end() -> (
    None
):
    walk = books(0.0)
    walk.set("energy.residual", 2.0 * np.sin(np.pi * walk.time / 10.0))
    assert "2.00%" in energy_warnings(View(walk.recording, PARAMETERS, PERIOD))[0]


def test_a_doubt_of_the_books_is_a_doubt_of_the_run() -> None:
    walk = books(5.0)
    walk.set("torso.position[3]", 0.13)
    assert any(
        "energy balance" in text
        for text in walk_warnings(View(walk.recording, PARAMETERS, PERIOD), ROBOT)
    )


@pytest.mark.parametrize(("torque", "told"), [(1.19, False), (1.21, True)])
def test_a_servo_above_its_rating_over_the_run_is_told(torque: float, told: bool) -> None:
    """1.2 N m, the root of the mean square of all the run's time."""
    walk = Walk()
    walk.grow("LM.femur.torque_squared", torque**2)
    found = servo_warnings(walk.recording, ROBOT)
    assert found == (
        [f"servo LM.femur works at {torque:.2f} N m RMS, above its continuous rating of 1.2 N m"]
        if told
        else []
    )


def test_a_run_at_a_coarse_fixed_step_says_in_terminal_report_and_metrics_that_its_books_do_not_close(
    call: Call, tmp_path: Path
) -> None:
    """Steps of 1 ms on stiff ground: an explicit method at the edge of what it can do."""
    changes = (
        "--set",
        "solver.method=rk4",
        "--set",
        "solver.step=1e-3",
        "--set",
        "duration=0.4",
        "--set",
        "macro_step=0.01",
    )
    code, out, err = call("simulate", "stand", "-o", tmp_path / "out", *changes)
    assert code == 0
    told = "the energy balance does not explain"
    assert told in err
    assert "energy_residual" in out
    assert told in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    metrics = json.loads((tmp_path / "out" / "metrics.json").read_text(encoding="utf-8"))
    assert metrics["energy_residual"] > 0.01
