"""Warnings of an energy balance that does not close and of servos above their rating."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from command import Call
from walks import PARAMETERS, PERIOD, ROBOT, Walk

from hexapod_cosim.cosim.master.loop import COMPLETED
from hexapod_cosim.cosim.results.comparisons import compare_all
from hexapod_cosim.cosim.results.metrics import METRICS
from hexapod_cosim.cosim.results.summary import Summary
from hexapod_cosim.cosim.results.walk import View
from hexapod_cosim.cosim.results.warnings import energy_warnings, servo_warnings, walk_warnings


def walk_missing(missing: float) -> Walk:
    """A walk whose motors did 60 J and took 40 J; `missing` [J] is the residual at the end."""
    walk = Walk()
    walk.grow("LF.femur.positive_work", 6.0)
    walk.grow("RM.tibia.negative_work", 4.0)
    walk.set("energy.residual", missing * walk.time / 10.0)
    return walk


@pytest.mark.parametrize(
    ("missing", "shown"), [(0.99, ""), (-0.99, ""), (1.01, "1.01%"), (-4.3, "4.30%")]
)
def test_a_residual_above_a_hundredth_of_the_motors_work_is_warned_of(
    missing: float, shown: str
) -> None:
    found = energy_warnings(View(walk_missing(missing).recording, PARAMETERS, PERIOD))
    text = f"the energy balance does not explain {shown} of the motors' work"
    assert len(found) == (1 if shown else 0)
    assert all(f"{text}: tighten solver.tolerance" in warning for warning in found)


def test_a_residual_in_the_middle_of_a_run_is_warned_of_though_it_vanishes_at_the_end() -> None:
    walk = walk_missing(0.0)
    walk.set("energy.residual", 2.0 * np.sin(np.pi * walk.time / 10.0))
    assert "2.00%" in energy_warnings(View(walk.recording, PARAMETERS, PERIOD))[0]


def test_an_energy_warning_is_a_warning_of_the_run() -> None:
    walk = walk_missing(5.0)
    walk.set("torso.position[3]", 0.13)
    found = walk_warnings(View(walk.recording, PARAMETERS, PERIOD), ROBOT)
    assert any("energy balance" in text for text in found)


@pytest.mark.parametrize(("torque", "warned"), [(1.19, False), (1.21, True)])
def test_a_servo_above_its_rating_over_the_run_is_warned_of(torque: float, warned: bool) -> None:
    """The rating of 1.2 N m is compared with the RMS torque over the whole run."""
    walk = Walk()
    walk.grow("LM.femur.torque_squared", torque**2)
    found = servo_warnings(walk.recording, ROBOT)
    text = f"servo LM.femur works at {torque:.2f} N m RMS, above its continuous rating of 1.2 N m"
    assert found == ([text] if warned else [])


@pytest.mark.usefixtures("undrawn")
def test_a_run_at_a_coarse_fixed_step_reports_its_residual_in_terminal_report_and_metrics(
    call: Call, tmp_path: Path
) -> None:
    """Steps of 1 ms on stiff ground are at the limit of an explicit method."""
    settings = ("solver.method=rk4", "solver.step=1e-3", "duration=0.4", "macro_step=0.01")
    changes = [word for text in settings for word in ("--set", text)]
    code, out, err = call("simulate", "stand", "-o", tmp_path / "out", *changes)
    assert code == 0
    warning = "the energy balance does not explain"
    assert warning in err
    assert "energy_residual" in out
    assert warning in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    metrics = json.loads((tmp_path / "out" / "metrics.json").read_text(encoding="utf-8"))
    assert metrics["energy_residual"] > 0.01
    assert any(warning in text for text in metrics["warnings"])
    assert call("report", tmp_path / "out")[0] == 0


def seeds_of(control: str, residuals: list[float]) -> list[Summary]:
    """Completed walks with these energy residuals; all other metrics are 1."""
    return [
        Summary(
            control=control,
            seed=seed,
            status=COMPLETED,
            upright=True,
            metrics=dict.fromkeys(METRICS, 1.0) | {"energy_residual": residual},
        )
        for seed, residual in enumerate(residuals)
    ]


def test_a_comparison_counts_the_runs_of_each_control_whose_energy_balance_misses() -> None:
    kinematic = seeds_of("kinematic", [0.0099, 0.023, 0.0101])
    compliant = seeds_of("compliant", [0.0099, 0.001, float("nan")])
    (text,) = compare_all({"kinematic": kinematic, "compliant": compliant}).unbalanced
    expected = "kinematic: the energy balance of 2 of 3 runs misses more than 1 %, at most 2.3 %"
    assert text.startswith(f"{expected}: tighten solver.tolerance")


@pytest.mark.usefixtures("undrawn")
def test_a_comparison_over_seeds_reports_its_residuals_in_terminal_report_and_metrics(
    call: Call, tmp_path: Path
) -> None:
    """Steps of 1 ms on stiff ground are at the limit of an explicit method."""
    settings = ("solver.method=rk4", "solver.step=1e-3", "duration=0.4", "macro_step=0.01")
    changes = [word for text in settings for word in ("--set", text)]
    code, _, err = call("compare", "stand", "--seeds", "2", "-o", tmp_path / "out", *changes)
    assert code == 0
    metrics = json.loads((tmp_path / "out" / "metrics.json").read_text(encoding="utf-8"))
    (warning,) = (text for text in metrics["warnings"] if text.startswith("kinematic: the energy"))
    assert " of 2 runs misses more than 1 %, at most " in warning
    assert err.count(warning) == 1
    page = tmp_path / "out" / "report.html"
    assert warning in page.read_text(encoding="utf-8")
    assert call("report", tmp_path / "out")[0] == 0
    assert warning in page.read_text(encoding="utf-8")
