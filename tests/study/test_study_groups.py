"""Figures of points and of all runs equal the textbook formulas, whichever runs are missing."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from studies import Row, study_of, write_rows

from hexapod_cosim.cosim.results.comparison import Change, change_of, half_width_of
from hexapod_cosim.extensions.study.records import Study
from hexapod_cosim.extensions.study.store import FIGURES, Store
from hexapod_cosim.extensions.study.summary import Figures, Point, Runs, failure_counts, points_of

ROUNDING = 1e-11  # relative: some dozen sums of numbers of one size
COUNT, SEEDS = 5, 7
PAIR = ("point", "case", "seed", "control")
TWO = study_of({"seeds": SEEDS, "factors": {"friction.mu": {"linspace": [0.3, 0.7, COUNT]}}})
BOTH = TWO.controls
THREE = study_of(
    {
        "seeds": SEEDS,
        "controls": ["kinematic", "paper", "compliant"],
        "factors": {"friction.mu": {"linspace": [0.3, 0.7, COUNT]}},
    }
)


def made_rows(study: Study, points: Sequence[int], *, seed: int = 0) -> list[Row]:
    """Returns all runs of points; one run in five falls, and one metric in ten is missing."""
    drawn = np.random.default_rng([seed, *points])
    found = []
    for point in points:
        for k in range(len(study.seeds)):
            for c, control in enumerate(study.controls):
                figures = {
                    name: 1.0 + point + 0.3 * drawn.standard_normal() - 0.5 * c for name in FIGURES
                }
                found.append(
                    {
                        "run": len(study.controls) * (point * len(study.seeds) + k) + c,
                        "point": point,
                        "case": "walk_flat",
                        "friction.mu": 0.3,
                        "seed": study.seeds[k],
                        "control": control,
                        "status": "completed",
                        "reason": "",
                        "warnings": "",
                        "walked": bool(drawn.random() > 0.2),
                        **{n: v if drawn.random() > 0.1 else None for n, v in figures.items()},
                    }
                )
    return found


def some_of(rows: Sequence[Row], *, share: float, seed: int) -> list[Row]:
    """Returns a random share of the rows, as of a study that is not finished."""
    kept = np.random.default_rng(seed).random(len(rows)) < share
    return [row for row, keep in zip(rows, kept, strict=True) if keep]


Summed = Callable[..., tuple[list[Point], Figures]]


@pytest.fixture
def summed(tmp_path: Path) -> Summed:
    """A function that stores rows and returns the points and the figures of all runs."""

    def found(rows: Sequence[Row], study: Study = TWO) -> tuple[list[Point], Figures]:
        write_rows(study, tmp_path, rows)
        with closing(Store(tmp_path, study)) as store:
            runs = Runs(study, store)
            return points_of(runs, store), runs.figures()

    return found


def by_hand(rows: Sequence[Row], name: str, other: str = "compliant") -> Change:
    """Returns the change over the pairs of which both runs walked, computed by pairs.

    other: the control that is compared with kinematic control.
    """
    found = {
        (row["point"], row["case"], row["seed"], row["control"]): row[name]
        for row in rows
        if row["walked"]
    }
    pairs = [
        (value, found[(*key[:3], other)])
        for key, value in found.items()
        if key[3] == "kinematic" and (*key[:3], other) in found
    ]
    return change_of(
        name, [(math.nan if a is None else a, math.nan if b is None else b) for a, b in pairs]
    )


def assert_same(found: Change, expected: Change) -> None:
    for name in ("before", "after", "half_width"):
        assert getattr(found, name) == pytest.approx(
            getattr(expected, name), rel=ROUNDING, nan_ok=True
        )
    assert (found.pairs, found.verdict) == (expected.pairs, expected.verdict)


def assert_changes_of_pairs(found: Figures, rows: Sequence[Row], study: Study) -> None:
    """Asserts the numbers of pairs and the changes from kinematic to each other control."""
    assert list(found.changes) == list(found.pairs) == list(study.controls[1:])
    for control, changes in found.changes.items():
        walks = {tuple(row[key] for key in PAIR): row["walked"] for row in rows}
        assert found.pairs[control] == sum(
            walked and key[-1] == control and walks.get((*key[:-1], "kinematic"), False)
            for key, walked in walks.items()
        )
        for name in FIGURES:
            assert_same(changes[name], by_hand(rows, name, control))


@pytest.mark.parametrize("study", [TWO, THREE], ids=["two controls", "three controls"])
@pytest.mark.parametrize("share", [1.0, 0.8, 0.3])
def test_changes_are_of_whole_pairs_whichever_runs_are_missing(
    summed: Summed, share: float, study: Study
) -> None:
    rows = some_of(made_rows(study, range(COUNT)), share=share, seed=0)
    points, overall = summed(rows, study)
    assert_changes_of_pairs(overall, rows, study)
    for point in points:
        own = [row for row in rows if row["point"] == point.number]
        assert_changes_of_pairs(point.figures, own, study)


def test_a_single_control_has_no_pairs(summed: Summed) -> None:
    alone = replace(TWO, laws=TWO.laws[1:])
    points, overall = summed(made_rows(alone, [0]), alone)
    for found in (overall, points[0].figures):
        assert not found.changes
        assert not found.pairs


@pytest.mark.parametrize("share", [1.0, 0.3])
def test_means_and_counts_are_of_all_walks_with_a_pair_or_without(
    summed: Summed, share: float
) -> None:
    rows = some_of(made_rows(TWO, range(COUNT)), share=share, seed=3)
    points, overall = summed(rows)
    for control in BOTH:
        own = [row for row in rows if row["control"] == control]
        assert (overall.runs[control], overall.walked[control]) == (
            len(own),
            sum(row["walked"] for row in own),
        )
        for point in points:
            of_point = [row for row in own if row["point"] == point.number]
            assert (point.figures.runs[control], point.figures.walked[control]) == (
                len(of_point),
                sum(row["walked"] for row in of_point),
            )
            for name in FIGURES:
                values = np.array(
                    [row[name] for row in of_point if row["walked"] and row[name] is not None]
                )
                mean = point.figures.means[control][name]
                assert mean.value == pytest.approx(
                    values.mean() if len(values) else math.nan, rel=ROUNDING, nan_ok=True
                )
                assert mean.half_width == pytest.approx(
                    half_width_of(values), rel=ROUNDING, nan_ok=True
                )
                assert mean.runs == len(values)


def test_falls_leave_no_figures_where_nothing_walked(summed: Summed) -> None:
    rows = [{**row, "walked": False} for row in made_rows(TWO, [0, 1])]
    points, overall = summed(rows)
    assert len(points) == 2
    for found in (overall, *(point.figures for point in points)):
        assert all(math.isnan(mean.value) for mean in found.means["kinematic"].values())
        changes = found.changes["compliant"].values()
        assert all(change.pairs == 0 and not change.verdict for change in changes)
        assert found.pairs == {"compliant": 0}
    assert sum(overall.runs.values()) == len(rows)


def test_failures_are_counted_without_the_numbers_in_their_reasons_the_most_first(
    tmp_path: Path,
) -> None:
    reasons = ["stuck after 1.5 s", "", "stuck after 12 s", ""]
    warnings = ["", "leg 3 is short | late", "", ""]
    rows = [
        {**row, "walked": False, "reason": reason, "warnings": warning}
        for row, reason, warning in zip(made_rows(TWO, [0]), reasons, warnings, strict=False)
    ]
    rows = [{**row, "control": "kinematic"} for row in rows]
    write_rows(TWO, tmp_path, rows)
    with closing(Store(tmp_path, TWO)) as store:
        assert failure_counts(store) == {
            ("kinematic", "completed", "stuck after # s"): 2,
            ("kinematic", "completed", "leg # is short"): 1,
            ("kinematic", "completed", "the robot fell"): 1,
        }
