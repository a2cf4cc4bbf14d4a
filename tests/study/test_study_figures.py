"""The figures and the page of a study: they show walks only, and name every interval."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gains import make_gains
from matplotlib.figure import Figure
from studies import KINEMATIC, replace_stored, run_quietly, study_of

from hexapod_cosim.cosim.results.comparison import made_change
from hexapod_cosim.extensions.study import figures
from hexapod_cosim.extensions.study.figures import drawing_of
from hexapod_cosim.extensions.study.run import report_on
from hexapod_cosim.extensions.study.store import FIGURES
from hexapod_cosim.extensions.study.summary import Figures, Mean, Point, read_results
from hexapod_cosim.models import load_robot

GRID = {"factors": {"friction.mu": [0.3, 0.5], "command.vx": [0.05, 0.08]}}
LIST = {
    "design": "list",
    "factors": {"friction.mu": [0.3, 0.5, 0.5], "gait.name": ["tripod", "tripod", "wave"]},
}


def point(
    number: int,
    values: Mapping[str, Any],
    slips: Mapping[str, float],
    *,
    runs: int = 2,
    walked: int = 2,
    pairs: int = 2,
) -> Point:
    """Returns a point with a slip for each control; all other metrics are 1."""
    means = {
        name: {
            figure: Mean(slip if figure == "slip_per_metre" else 1.0, math.nan, walked)
            for figure in FIGURES
        }
        for name, slip in slips.items()
    }
    before, after = (
        slips.get(name, math.nan) if pairs else math.nan for name in ("kinematic", "compliant")
    )
    changes = {
        name: made_change(
            name,
            before=before,
            after=after,
            half_width=math.nan,
            log_half_width=math.nan,
            pairs=pairs,
        )
        for name in FIGURES
    }
    figures = Figures(
        pairs={"compliant": pairs},
        means=means,
        runs=dict.fromkeys(slips, runs),
        walked=dict.fromkeys(slips, walked),
        changes={"compliant": changes},
    )
    return Point(number=number, values=values, held_out=False, figures=figures)


def shown(figure: Figure, panel: int = 2) -> np.ndarray[Any, Any]:
    """Returns what a panel of a heat map shows, by default the changes."""
    values = figure.axes[panel].images[0].get_array()
    assert values is not None
    return np.ma.filled(values, np.nan)


def test_a_cell_shows_its_slips_and_is_empty_without_a_walk() -> None:
    study = study_of(GRID)
    nothing = {"kinematic": math.nan, "compliant": math.nan}
    # the last two cells have no run
    points = [
        point(0, {"friction.mu": 0.3, "command.vx": 0.05}, {"kinematic": 0.4, "compliant": 0.1}),
        point(1, {"friction.mu": 0.3, "command.vx": 0.08}, nothing, walked=0, pairs=0),  # fell
    ]
    figure = figures.heat_map(points, study)
    nan = math.nan
    for place, expected in enumerate((0.4, 0.1, -75.0)):
        np.testing.assert_allclose(shown(figure, place), [[expected, nan], [nan, nan]])


@pytest.fixture
def folder(athena_fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """A function that runs a study, writes its report and returns the page.

    `lost`: number of stored runs that are removed before.
    """

    def made(table: Mapping[str, Any], *, lost: int = 0, pictures: bool = False) -> str:
        if not pictures:
            monkeypatch.setattr("hexapod_cosim.extensions.study.page.drawing_of", lambda _: None)
        out = tmp_path / "out"
        run_quietly(study_of(table), out, fmu=athena_fmu, gains=make_gains(load_robot("athena")))
        if lost:
            replace_stored(study_of(table), out, lambda row: row if row["run"] >= lost else None)
            facts = (out / "run.json").read_text()
            (out / "run.json").write_text(facts.replace('"completed"', '"running"'))
        report_on(out)
        return " ".join((out / "report.html").read_text().split())

    return made


@pytest.mark.filterwarnings("error")
def test_where_nothing_walks_there_are_no_figures_and_the_page_says_why(folder: Any) -> None:
    page = folder(
        pictures=True,
        table={"seeds": 2, "factors": {"friction.mu": [0.17, 0.19], "command.vx": [0.05, 0.08]}},
    )
    assert "none of 8 kinematic runs walked to its end; 4 of them" in page
    assert "<img" not in page


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "table", [LIST, {**GRID, "seeds": 2}, {"seeds": 2, "factors": {"friction.mu": [0.3, 0.19]}}]
)
def test_figures_of_all_designs_are_drawn_without_a_warning(
    athena_fmu: Path, tmp_path: Path, table: dict[str, Any]
) -> None:
    run_quietly(
        study_of(table), tmp_path / "out", fmu=athena_fmu, gains=make_gains(load_robot("athena"))
    )
    results = read_results(tmp_path / "out")
    found = drawing_of(results)
    assert found is not None
    assert found.name == "heat_map" if "command.vx" in table["factors"] else "effects"
    found.draw().draw_without_rendering()


def test_a_page_compares_each_control_with_the_first_one(folder: Any) -> None:
    controls = ["kinematic", "paper", "compliant"]
    page = folder({"controls": controls, "seeds": 2, **GRID})
    assert "kinematic → paper, compliant, relative to the mean of kinematic" in page
    over_all = page.partition("<h2>Over all runs</h2>")[2]
    assert "over the 8 and 8 pairs in which both walked" in over_all
    assert all(f">to {control}</th>" in over_all for control in controls[1:])


def test_a_page_of_one_control_has_the_files_name_without_a_title_and_no_pairs(folder: Any) -> None:
    page = folder({**KINEMATIC, "seeds": 2, "factors": {"friction.mu": [0.3, 0.19]}})
    assert "<h1>test</h1>" in page
    assert "pair" not in page.partition("<h2>Over all runs</h2>")[2]


def test_a_page_of_an_unfinished_study_says_what_its_figures_are_of(folder: Any) -> None:
    page = folder({"seeds": 2, **GRID}, lost=5)
    for text in (
        "11 of 16 runs",
        "not done yet",
        "Not all runs are there.",
        "over the 5 pairs in which both walked",
    ):
        assert text in page
