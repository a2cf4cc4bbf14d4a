"""Warnings of an energy balance that does not close and of servos above their rating."""

from __future__ import annotations

import pytest
from walks import PARAMETERS, PERIOD, ROBOT, Walk

from hexapod_cosim.cosim.master.loop import COMPLETED
from hexapod_cosim.cosim.results.metrics import METRICS
from hexapod_cosim.cosim.results.summary import Summary
from hexapod_cosim.cosim.results.uncertainty import compare_all
from hexapod_cosim.cosim.results.warnings import energy_warnings, servo_warnings, walk_warnings
from hexapod_cosim.cosim.results.window import View


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
