"""The tables of a study: means, intervals and changes by the textbook, failures by reason."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gains import make_gains
from scipy import stats
from studies import KINEMATIC, Row, replace_stored, rows, run_quietly, study_of, use_runner
from study_runners import Fake

from hexapod_cosim.controller import save_gains
from hexapod_cosim.extensions.study.folder import OPTIMUM
from hexapod_cosim.extensions.study.page import optimum_table
from hexapod_cosim.extensions.study.run import report_on
from hexapod_cosim.extensions.study.summary import SUMMARY, read_results
from hexapod_cosim.models import load_robot

METRIC = "cost_of_transport"
FACTORS = {"friction.mu": [0.3, 0.5], "command.vx": [0.05, 0.08]}
Call = Callable[..., tuple[int, str, str]]


@pytest.fixture
def compared(athena_fmu: Path, tmp_path: Path) -> Path:
    """Returns the folder of a study of both controls, 4 points and 3 seeds."""
    gains = make_gains(load_robot("athena"))
    run_quietly(
        study_of({"seeds": 3, "factors": FACTORS}), tmp_path / "out", fmu=athena_fmu, gains=gains
    )
    return tmp_path / "out"


def values(folder: Path, control: str, **where: Any) -> np.ndarray[Any, Any]:
    chosen = [
        row
        for row in rows(folder)
        if row["control"] == control and all(row[key] == value for key, value in where.items())
    ]
    return np.array(
        [row[METRIC] for row in sorted(chosen, key=lambda row: (row["point"], row["seed"]))]
    )


def half_width(sample: np.ndarray[Any, Any]) -> float:
    return float(stats.t.ppf(0.975, len(sample) - 1) * stats.sem(sample))


def test_totals_are_over_all_pairs(compared: Path) -> None:
    read_results(compared)
    summary = json.loads((compared / SUMMARY).read_text())
    before, after = values(compared, "kinematic"), values(compared, "compliant")
    change = summary["changes"]["compliant"][METRIC]
    assert (summary["runs"], summary["points"], change["pairs"]) == (24, 4, 12)
    assert change["relative"] == pytest.approx((after - before).mean() / before.mean(), rel=1e-12)
    assert change["half_width"] == pytest.approx(half_width(after - before), rel=1e-9)
    assert summary["means"]["compliant"][METRIC]["mean"] == pytest.approx(after.mean(), rel=1e-12)


def test_failures_keep_out_of_the_means(athena_fmu: Path, tmp_path: Path) -> None:
    study = study_of({**KINEMATIC, "seeds": 3, "factors": {"friction.mu": [0.17, 0.19, 0.5]}})
    run_quietly(study, tmp_path / "out", fmu=athena_fmu)
    results = read_results(tmp_path / "out")
    assert dict(results.failures) == {
        ("kinematic", "completed", "the robot fell"): 3,
        ("kinematic", "refused", "no walk with #"): 3,
    }
    assert results.overall.means["kinematic"][METRIC].value == pytest.approx(
        values(tmp_path / "out", "kinematic", point=2).mean()
    )
    assert math.isnan(results.points[0].figures.means["kinematic"][METRIC].value)


def test_the_command_runs_a_study_and_its_report_holds_everything(
    call: Call, athena_fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    use_runner(monkeypatch, Fake)
    file, gains, out = tmp_path / "mine.toml", tmp_path / "gains.toml", tmp_path / "out"
    file.write_text(
        'title = "Mine <&>"\nseeds = 2\n'
        "[factors]\nfriction.mu = [0.17, 0.5, 0.7]\ncommand.vx = [0.05, 0.08]\n"
    )
    save_gains(make_gains(load_robot("athena")), gains)
    code, stdout, err = call(
        "study", file, "-o", out, "--fmu", athena_fmu, "--gains", gains, "--workers", "1", "--json"
    )
    assert code == 0, err
    summary = json.loads(stdout)
    assert (summary["runs"], summary["walked"]) == (24, {"kinematic": 8, "compliant": 8})
    page = (out / "report.html").read_text()
    for text in (
        "Mine &lt;&amp;&gt;",
        "no walk with #",
        "kinematic",
        "friction.mu",
        "hexapod study",
        "manifest.json",
        "prefers-color-scheme",
    ):
        assert text in page
    assert page.count("data:image/svg+xml;base64,") == 1
    assert "http://" not in page.replace("http://www.w3.org", "")
    assert {path.stem for path in (out / "plots").iterdir()} == {"heat_map"}
    (out / "report.html").unlink()
    code, stdout, err = call("report", out)
    assert (code, (out / "report.html").read_text()) == (0, page), err
    assert "report.html" in stdout


def optimisation(**changes: Any) -> dict[str, Any]:
    question = {
        "metric": "slip_per_metre",
        "trials": 15,
        "batch": 5,
        "variables": {
            "friction.mu": {"uniform": [0.3, 0.9]},
            "gains.hold.path_rate": {"uniform": [0.5, 2.0], "relative": True},
        },
        "training": {"scenarios": ["walk_flat", "push"], "seeds": {"first": 10, "count": 2}},
        "held_out": {"scenarios": ["ripple", "turn"], "seeds": 3},
    }
    return {"set": {"friction.mu": 0.5}, "optimise": {**question, **changes}}


def test_a_resumed_optimisation_has_the_same_trials_and_optimum(
    athena_fmu: Path, tmp_path: Path
) -> None:
    gains, study = make_gains(load_robot("athena")), study_of(optimisation())
    whole = run_quietly(study, tmp_path / "whole", fmu=athena_fmu, gains=gains)
    run_quietly(study, tmp_path / "parted", fmu=athena_fmu, gains=gains)
    # as if it had been killed in the second batch
    replace_stored(study, tmp_path / "parted", lambda row: row if row["run"] < 27 else None)
    assert run_quietly(study, tmp_path / "parted", fmu=athena_fmu, gains=gains) == whole
    first, second = ((tmp_path / name / OPTIMUM).read_text() for name in ("whole", "parted"))
    assert first == second


def test_the_best_trial_is_the_least_and_held_out_runs_come_after_all_trials(
    athena_fmu: Path, tmp_path: Path
) -> None:
    study = study_of(optimisation())
    found = run_quietly(
        study, tmp_path / "out", fmu=athena_fmu, gains=make_gains(load_robot("athena"))
    )
    training, held = (
        [row for row in found if row["seed"] >= 10],
        [row for row in found if row["seed"] < 10],
    )
    assert max(row["run"] for row in training) < min(row["run"] for row in held)
    means = {
        point: np.mean([row["slip_per_metre"] for row in training if row["point"] == point])
        for point in range(15)
    }
    best = json.loads((tmp_path / "out" / OPTIMUM).read_text())["best"]
    assert best["number"] == min(means, key=lambda point: means[point])
    assert best["training"]["slip_per_metre"] == pytest.approx(means[best["number"]], rel=1e-12)
    assert {row["case"] for row in held} == {"ripple", "turn"}
    assert {row["case"] for row in training} == {"walk_flat", "push"}
    assert {row["point"] for row in held} == {16, 17}
    # points 15 and 16 are before the optimisation: no variable is set
    assert {row["friction.mu"] for row in found if row["point"] in (15, 16)} == {None}


def test_what_the_best_trial_gains_is_paired_and_by_hand(athena_fmu: Path, tmp_path: Path) -> None:
    found = run_quietly(
        study_of(optimisation()),
        tmp_path / "out",
        fmu=athena_fmu,
        gains=make_gains(load_robot("athena")),
    )
    best = json.loads((tmp_path / "out" / OPTIMUM).read_text())["best"]

    def sample(point: int) -> np.ndarray[Any, Any]:
        chosen = [row for row in found if row["point"] == point]
        return np.array(
            [
                row["slip_per_metre"]
                for row in sorted(chosen, key=lambda row: (row["case"], row["seed"]))
            ]
        )

    points = {"training": (15, best["number"], 4), "held_out": (16, 17, 6)}
    for part, (first, last, pairs) in points.items():
        before, after = sample(first), sample(last)
        change = best["change"][part]["slip_per_metre"]
        assert (change["pairs"], change["verdict"]) == (pairs, "better")
        assert change["relative"] == pytest.approx(
            (after - before).mean() / before.mean(), rel=1e-12
        )
        assert change["half_width"] == pytest.approx(half_width(after - before), rel=1e-9)
    report_on(tmp_path / "out")
    row = optimum_table(read_results(tmp_path / "out")).rows[-2]
    page = (tmp_path / "out" / "report.html").read_text()
    assert row[0] == "held out"
    assert all(text.replace("-", "−") in page for text in row[4:6])


def test_held_out_runs_do_not_reach_the_optimiser_not_even_when_a_study_goes_on(
    athena_fmu: Path, tmp_path: Path
) -> None:
    """The store keeps the first batch, and held-out runs whose metrics would change the choice."""
    gains, study, out = (
        make_gains(load_robot("athena")),
        study_of(optimisation()),
        tmp_path / "out",
    )
    whole = [
        row for row in run_quietly(study, out, fmu=athena_fmu, gains=gains) if row["seed"] >= 10
    ]
    best = json.loads((out / OPTIMUM).read_text())["best"]

    def other(row: Row) -> Row | None:
        if row["seed"] >= 10:
            return row if row["point"] < 5 else None
        return {**row, "slip_per_metre": row["slip_per_metre"] - 1e6}

    replace_stored(study, out, other)
    assert [
        row for row in run_quietly(study, out, fmu=athena_fmu, gains=gains) if row["seed"] >= 10
    ] == whole
    again = json.loads((out / OPTIMUM).read_text())["best"]
    assert all(again[key] == best[key] for key in ("number", "values", "training"))
    assert again["held_out"]["slip_per_metre"] < -1e5  # they were there, and read for the report


def test_a_fall_leaves_a_trial_without_figures_and_out_of_the_choice(
    athena_fmu: Path, tmp_path: Path
) -> None:
    variables = {"friction.mu": [0.17, 0.19, 0.5, 0.7]}  # refused, falls, walks, walks
    study = study_of(optimisation(variables=variables, metric="stability_margin"))  # more is better
    run_quietly(study, tmp_path / "out", fmu=athena_fmu, gains=make_gains(load_robot("athena")))
    best = json.loads((tmp_path / "out" / OPTIMUM).read_text())["best"]
    assert (best["values"], best["feasible"], best["held_out"]["walked"]) == (
        {"friction.mu": 0.7},
        True,
        1.0,
    )
    trials = json.loads((tmp_path / "out" / OPTIMUM).read_text())["trials"]
    assert {trial["feasible"] for trial in trials} == {True, False}


def test_a_constraint_keeps_the_best_within_it(athena_fmu: Path, tmp_path: Path) -> None:
    bound = {"cost_of_transport": {"at_least": 3.0}}
    study = study_of(optimisation(constraints=bound))
    run_quietly(study, tmp_path / "out", fmu=athena_fmu, gains=make_gains(load_robot("athena")))
    best = json.loads((tmp_path / "out" / OPTIMUM).read_text())["best"]
    assert best["feasible"]
    assert best["training"]["cost_of_transport"] >= 3.0
