"""Accuracies equal the errors of independent runs, are zero where nothing changes, and shrink with
a more exact solver.
"""

from __future__ import annotations

import io
import json
import math
from collections.abc import Mapping
from contextlib import redirect_stdout
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from command import Call, settings

from hexapod_cosim.cosim.cli import main
from hexapod_cosim.cosim.results.accuracy import compare_accuracy, reference_scenario
from hexapod_cosim.cosim.results.metric_table import METRICS
from hexapod_cosim.cosim.results.summary import Summary
from hexapod_cosim.cosim.run.batch import run_batch
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.cosim.scenario.records import Scenario

CYCLES = ("duration=2.4", "gait.period=0.8")  # the shortest walk with metrics
SOLVER_METRICS = [name for name in METRICS if name != "realtime_factor"]
# what a straight walk has
WALKED = [name for name in SOLVER_METRICS if not name.endswith("_per_radian")]
# which is kept out of tables under the tanh law
SHOWN = [name for name in WALKED if name != "slip_net_per_metre"]


def walk(*overrides: str) -> Scenario:
    return load_scenario("walk_flat", overrides=[*CYCLES, *overrides])


def summaries(*plans: Scenario) -> list[Summary]:
    return list(run_batch(plans, workers=1, compiled=True))


def made(value: float, other: float = 0.0, *, seed: int = 0, upright: bool = True) -> Summary:
    """Returns a run with metrics of any name."""
    return Summary(
        control="kinematic",
        seed=seed,
        status="completed",
        upright=upright,
        metrics={"way": value, "heat": other},
    )


# what is run again


@pytest.mark.parametrize(
    ("overrides", "section", "key", "value"),
    [
        ((), "settings", "tolerance", 1e-6),
        (("solver.tolerance=0.03",), "settings", "tolerance", 3e-4),
        (("solver.method=dp54", "solver.step=0.001"), "settings", "step", 1e-4),
        (("parameters={'solver.tolerance' = 0.1}",), "parameters", "solver.tolerance", 1e-3),
    ],
)
def test_the_reference_differs_by_its_tolerance_or_its_fixed_step_alone(
    overrides: tuple[str, ...], section: str, key: str, value: float
) -> None:
    plan = walk(*overrides)
    fine = reference_scenario(plan)
    found = fine.parameters if section == "parameters" else fine.settings["solver"]
    assert found[key] == pytest.approx(value, rel=1e-12)
    assert replace(fine, settings=plan.settings, parameters=plan.parameters) == plan
    assert fine.macro_step == plan.macro_step


# laws


def test_where_nothing_changes_every_error_is_zero(plant_build: Path) -> None:
    plan = walk()
    runs, again = (summaries(plan) for _ in range(2))
    found = compare_accuracy(plan, runs, again)
    assert list(found.solver_error) == SOLVER_METRICS
    assert {found.solver_error[name] for name in WALKED} == {0.0}


def test_a_hundredth_of_the_tolerance_makes_the_errors_smaller_by_a_power_of_ten_at_least(
    plant_build: Path,
) -> None:
    """Sums the relative errors of all metrics but the energy residual, which is itself an error."""
    sizes = []
    for tolerance in ("1e-2", "1e-4"):
        plan = walk(f"solver.tolerance={tolerance}")
        (run,), reference = summaries(plan), summaries(reference_scenario(plan))
        found = compare_accuracy(plan, [run], reference)
        assert found.reference == f"solver.tolerance={float(tolerance) / 100.0:g}"
        sizes.append(
            sum(
                abs(found.solver_error[name] / run.metrics[name])
                for name in WALKED
                if run.metrics[name] and name != "energy_residual"
            )
        )
    assert sizes[0] > 10.0 * sizes[1] > 0.0


def test_errors_of_several_runs_are_of_the_means_over_those_that_walked_each_time() -> None:
    runs = [made(1.0, 5.0), made(2.0, 6.0, seed=1), made(99.0, seed=2)]
    fine = [made(1.5, math.nan), made(2.1, 6.5, seed=1), made(50.0, seed=2, upright=False)]
    found = compare_accuracy(walk(), runs, fine)
    assert found.runs == 2
    assert found.solver_error == {"way": pytest.approx(-0.3), "heat": pytest.approx(-0.5)}
    assert found.notes == (
        "kinematic, seed 2, at solver.tolerance=1e-06 ended differently: the robot fell",
    )


# the command


@pytest.fixture(scope="module")
def checked(
    plant_build: Path, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, Mapping[str, Any]]:
    """Runs a comparison of one seed with --check-accuracy; its report has no figures."""
    folder = tmp_path_factory.mktemp("checked") / "out"
    words = ["compare", "walk_flat", "-o", str(folder), "--seeds", "1", "--check-accuracy"]
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(io.StringIO()) as out:
        patch.setattr("hexapod_cosim.cosim.report.plots.DRAWINGS", {})
        code = main([*words, "--json", *settings(*CYCLES)])
    assert code == 0
    return folder, json.loads(out.getvalue())


def test_a_run_shows_an_error_beside_every_metric_and_keeps_it(call: Call, tmp_path: Path) -> None:
    arguments = [
        "simulate",
        "walk_flat",
        "-o",
        tmp_path,
        "--check-accuracy",
        *settings(*CYCLES, "outputs.plots=false"),
    ]
    code, out, _ = call(*arguments)
    lines = {line.split()[0]: line for line in out.split("± is the solver's error")[0].splitlines()}
    assert code == 0
    assert all(" ± " in lines[name] for name in SHOWN)
    assert " ± " not in lines["realtime_factor"]
    stored = json.loads((tmp_path / "metrics.json").read_text())
    assert list(stored) == [*METRICS, "warnings", "accuracy"]
    assert list(stored["accuracy"]["solver_error"]) == SOLVER_METRICS


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("command", [["simulate"], ["compare", "--seeds", "1"]])
def test_an_interrupt_of_the_check_leaves_whole_results_without_it(
    call: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: list[str]
) -> None:
    def struck(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("hexapod_cosim.cosim.cli.runs.reference_scenario", struck)
    quick = settings("duration=0.2", "outputs.plots=false")
    code, _, err = call(*command, "stand", "-o", tmp_path / "out", "--check-accuracy", *quick)
    assert code == 130
    assert "interrupted" in err
    assert json.loads((tmp_path / "out" / "run.json").read_text())["status"] == "completed"
    assert "accuracy" not in json.loads((tmp_path / "out" / "metrics.json").read_text())
    assert call("report", tmp_path / "out")[0] == 0
