"""Sums of runs equal the textbook formulas for any missing runs and any cuts, in bounded memory."""

from __future__ import annotations

import math
import tracemalloc
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from studies import study_of

from hexapod_cosim.cosim.results.comparison import Change, change_of, half_width_of
from hexapod_cosim.cosim.study.plan.records import Study
from hexapod_cosim.cosim.study.store.columns import FIGURES, schema_of
from hexapod_cosim.cosim.study.store.results import points_table
from hexapod_cosim.cosim.study.store.sums import Rows, blocks_of, whole_pairs
from hexapod_cosim.cosim.study.store.table import Overall, Point, Tally, point_at

ROUNDING = 1e-11  # relative: some dozen sums of numbers of one size
POINTS, SEEDS = 5, 7
PAIR = ("point", "case", "seed", "control")
TWO = study_of({"seeds": SEEDS, "factors": {"friction.mu": {"linspace": [0.3, 0.7, POINTS]}}})
BOTH = TWO.run_controls
THREE = study_of(
    {
        "seeds": SEEDS,
        "controls": ["kinematic", "paper", "compliant"],
        "factors": {"friction.mu": {"linspace": [0.3, 0.7, POINTS]}},
    }
)


def made_rows(study: Study, points: Sequence[int], *, seed: int = 0) -> list[dict[str, Any]]:
    """Returns all runs of points; one run in five falls, and one metric in ten is missing."""
    drawn = np.random.default_rng([seed, *points])
    found = []
    for point in points:
        for k in range(len(study.seeds)):
            for c, control in enumerate(study.run_controls):
                figures = {
                    name: 1.0 + point + 0.3 * drawn.standard_normal() - 0.5 * c for name in FIGURES
                }
                found.append(
                    {
                        "run": len(study.run_controls) * (point * len(study.seeds) + k) + c,
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


def some_of(rows: Sequence[dict[str, Any]], *, share: float, seed: int) -> list[dict[str, Any]]:
    """Returns a random share of the rows, as of a study that is not finished."""
    kept = np.random.default_rng(seed).random(len(rows)) < share
    return [row for row, keep in zip(rows, kept, strict=True) if keep]


def summed(
    rows: Sequence[dict[str, Any]], study: Study = TWO, *, cuts: Sequence[int] = ()
) -> tuple[list[Point], Overall]:
    table, ends = pa.Table.from_pylist(list(rows), schema=schema_of(study)), [0, *cuts, len(rows)]
    parts = [table.slice(a, b - a) for a, b in pairwise(ends)]
    tally = Tally(study)

    def added() -> Iterator[Rows]:
        for part in whole_pairs(parts, study.run_controls):
            yield (one := Rows(part, study))
            tally.add(one)

    points = [
        point_at(block, k, study)
        for block in blocks_of(added())
        for k in range(len(block.held_out))
    ]
    return points, tally.overall()


def by_hand(rows: Sequence[dict[str, Any]], name: str, other: str = "compliant") -> Change:
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


def assert_changes_of_pairs(
    found: Overall | Point, rows: Sequence[dict[str, Any]], study: Study
) -> None:
    """Asserts the numbers of pairs and the changes from kinematic to each other control."""
    assert list(found.changes) == list(found.pairs) == list(study.run_controls[1:])
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
def test_changes_are_of_whole_pairs_whichever_runs_are_missing(share: float, study: Study) -> None:
    for seed in range(3):
        rows = some_of(made_rows(study, range(POINTS), seed=seed), share=share, seed=seed)
        points, overall = summed(rows, study)
        assert_changes_of_pairs(overall, rows, study)
        for point in points:
            own = [row for row in rows if row["point"] == point.number]
            assert_changes_of_pairs(point, own, study)


def test_a_single_control_has_no_pairs() -> None:
    alone = replace(TWO, controls=("compliant",))
    points, overall = summed(made_rows(alone, [0]), alone)
    for found in (overall, points[0]):
        assert not found.changes
        assert not found.pairs


@pytest.mark.parametrize("share", [1.0, 0.3])
def test_means_and_counts_are_of_all_walks_with_a_pair_or_without(share: float) -> None:
    rows = some_of(made_rows(TWO, range(POINTS)), share=share, seed=3)
    points, overall = summed(rows)
    for control in BOTH:
        own = [row for row in rows if row["control"] == control]
        assert (overall.total[control], overall.walked[control]) == (
            len(own),
            sum(row["walked"] for row in own),
        )
        for point in points:
            of_point = [row for row in own if row["point"] == point.number]
            assert (point.runs[control], point.walked[control]) == (
                len(of_point),
                sum(row["walked"] for row in of_point),
            )
            for name in FIGURES:
                values = np.array(
                    [row[name] for row in of_point if row["walked"] and row[name] is not None]
                )
                mean = point.means[control][name]
                assert mean.value == pytest.approx(
                    values.mean() if len(values) else math.nan, rel=ROUNDING, nan_ok=True
                )
                assert mean.half_width == pytest.approx(
                    half_width_of(values), rel=ROUNDING, nan_ok=True
                )
                assert mean.runs == len(values)


def test_the_control_of_the_first_run_does_not_turn_a_change_round() -> None:
    rows = [{**row, "walked": True} for row in made_rows(TWO, [0])]
    del rows[0]  # a kinematic run
    (point,), overall = summed(rows)
    assert (
        point.changes["compliant"]["peak_force"].before
        == overall.changes["compliant"]["peak_force"].before
        == pytest.approx(by_hand(rows, "peak_force").before)
    )
    assert point.pairs == overall.pairs == {"compliant": SEEDS - 1}


@pytest.mark.parametrize("study", [TWO, THREE], ids=["two controls", "three controls"])
def test_where_tables_are_cut_does_not_show(study: Study) -> None:
    rows = some_of(made_rows(study, range(POINTS)), share=0.9, seed=1)
    points, overall = summed(rows, study)
    for cuts in ([1], [3, 4, 5, 17], list(range(1, len(rows)))):
        others, again = summed(rows, study, cuts=cuts)
        assert [(item.number, item.runs, item.pairs) for item in others] == [
            (item.number, item.runs, item.pairs) for item in points
        ]
        pairs: list[tuple[Point | Overall, Point | Overall]] = [
            *zip(points, others, strict=True),
            (overall, again),
        ]
        for one, other in pairs:
            for control, changes in one.changes.items():
                for name in FIGURES:
                    assert_same(other.changes[control][name], changes[name])
                    assert other.means[control][name].value == pytest.approx(
                        one.means[control][name].value, rel=ROUNDING, nan_ok=True
                    )


def test_falls_leave_no_figures_where_nothing_walked() -> None:
    rows = [{**row, "walked": False} for row in made_rows(TWO, [0, 1])]
    points, overall = summed(rows)
    assert all(
        math.isnan(mean.value)
        for point in points
        for means in point.means.values()
        for mean in means.values()
    )
    changes = overall.changes["compliant"].values()
    assert all(change.pairs == 0 and not change.verdict for change in changes)
    assert (overall.runs, sum(overall.failures.values())) == (len(rows), len(rows))
    assert overall.pairs == {"compliant": 0}


def test_sums_of_numbers_far_from_zero_keep_their_spread() -> None:
    rows = [
        {**row, "walked": True, "peak_force": 1e8 + k % 3}
        for k, row in enumerate(made_rows(TWO, range(POINTS)))
    ]
    points, _ = summed(rows, cuts=[10, 20, 33])
    for point in points:
        values = np.array(
            [
                row["peak_force"]
                for row in rows
                if row["point"] == point.number and row["control"] == BOTH[0]
            ]
        )
        # the values of 1e8 are doubles, of 16 digits
        assert point.means[BOTH[0]]["peak_force"].half_width == pytest.approx(
            half_width_of(values), rel=1e-6
        )


@pytest.mark.parametrize("study", [TWO, THREE], ids=["two controls", "three controls"])
def test_a_columns_table_says_what_its_points_say(study: Study) -> None:
    rows = some_of(made_rows(study, range(POINTS)), share=0.7, seed=2)
    table, controls = pa.Table.from_pylist(rows, schema=schema_of(study)), study.run_controls
    (block, *_) = list(blocks_of(Rows(part, study) for part in whole_pairs([table], controls)))
    for place, row in enumerate(points_table(block, study).to_pylist()):
        point = point_at(block, place, study)
        assert (row["point"], row["compliant.walked"]) == (point.number, point.walked["compliant"])
        for name in FIGURES:
            mean = point.means["kinematic"][name].value
            assert (row[f"kinematic.{name}"] or math.nan) == pytest.approx(mean, nan_ok=True)
        for control, changes in point.changes.items():
            before = f"{control}." if study is THREE else ""
            assert row[f"{before}pairs"] == point.pairs[control]
            for name, change in changes.items():
                assert row[f"{before}change.{name}.verdict"] == change.verdict
                assert (row[f"{before}change.{name}"] or math.nan) == pytest.approx(
                    change.after - change.before, nan_ok=True
                )


def test_memory_does_not_grow_with_the_runs_nor_with_the_kinds_of_failures(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A point has very many seeds, half of which fail, each for another reason."""
    monkeypatch.setattr("hexapod_cosim.cosim.study.store.table.MAX_KINDS", 100)

    def peak(count: int) -> int:
        tally = Tally(TWO)
        rows = made_rows(TWO, range(POINTS))

        def parts() -> Iterator[Rows]:
            for k in range(count):
                some = [
                    {
                        **row,
                        "point": 0,
                        "walked": row["walked"] and k % 2 == 0,
                        "reason": "a" * k + "b" * n,
                    }
                    for n, row in enumerate(rows)
                ]
                one = Rows(pa.Table.from_pylist(some, schema=schema_of(TWO)), TWO)
                tally.add(one)
                yield one

        tracemalloc.start()
        for _ in blocks_of(parts()):
            pass
        used = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert len(tally.overall().failures) <= 30
        return used

    peak(2)  # imports modules
    # 20 tables have more than MAX_KINDS kinds of failures; the reasons of 80 are some bytes longer
    assert peak(80) < 1.1 * peak(20)
