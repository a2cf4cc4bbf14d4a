"""Sums of runs equal the textbook formulas for any missing runs and any cuts, in bounded memory."""

from __future__ import annotations

import math
import tracemalloc
from collections.abc import Iterator, Sequence
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
TWO = study_of({"seeds": SEEDS, "factors": {"friction.mu": {"linspace": [0.3, 0.7, POINTS]}}})
BOTH = TWO.run_controls


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


def by_hand(rows: Sequence[dict[str, Any]], name: str) -> Change:
    """Returns the change over the pairs of which both runs walked, computed by pairs."""
    found = {
        (row["point"], row["case"], row["seed"], row["control"]): row[name]
        for row in rows
        if row["walked"]
    }
    pairs = [
        (value, found[(*key[:3], BOTH[1])])
        for key, value in found.items()
        if key[3] == BOTH[0] and (*key[:3], BOTH[1]) in found
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


@pytest.mark.parametrize("share", [1.0, 0.8, 0.3])
def test_changes_are_of_whole_pairs_whichever_runs_are_missing(share: float) -> None:
    for seed in range(5):
        rows = some_of(made_rows(TWO, range(POINTS), seed=seed), share=share, seed=seed)
        points, overall = summed(rows)
        for name in FIGURES:
            assert_same(overall.changes[name], by_hand(rows, name))
            for point in points:
                assert_same(
                    point.changes[name],
                    by_hand([row for row in rows if row["point"] == point.number], name),
                )


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
        point.changes["peak_force"].before
        == overall.changes["peak_force"].before
        == pytest.approx(by_hand(rows, "peak_force").before)
    )
    assert point.pairs == overall.pairs == SEEDS - 1


def test_where_tables_are_cut_does_not_show() -> None:
    rows = some_of(made_rows(TWO, range(POINTS)), share=0.9, seed=1)
    points, overall = summed(rows)
    for cuts in ([1], [3, 4, 5, 17], list(range(1, len(rows)))):
        others, again = summed(rows, cuts=cuts)
        assert [(item.number, item.runs, item.pairs) for item in others] == [
            (item.number, item.runs, item.pairs) for item in points
        ]
        for name in FIGURES:
            assert_same(again.changes[name], overall.changes[name])
            for one, other in zip(points, others, strict=True):
                assert_same(other.changes[name], one.changes[name])
                assert other.means[BOTH[1]][name].value == pytest.approx(
                    one.means[BOTH[1]][name].value, rel=ROUNDING, nan_ok=True
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
    assert all(change.pairs == 0 and not change.verdict for change in overall.changes.values())
    assert (overall.runs, overall.pairs, sum(overall.failures.values())) == (
        len(rows),
        0,
        len(rows),
    )


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


def test_a_columns_table_says_what_its_points_say() -> None:
    rows = some_of(made_rows(TWO, range(POINTS)), share=0.7, seed=2)
    (block, *_) = list(
        blocks_of(
            Rows(part, TWO)
            for part in whole_pairs([pa.Table.from_pylist(rows, schema=schema_of(TWO))], BOTH)
        )
    )
    for place, row in enumerate(points_table(block, TWO).to_pylist()):
        point = point_at(block, place, TWO)
        assert (row["point"], row["pairs"], row["compliant.walked"]) == (
            point.number,
            point.pairs,
            point.walked["compliant"],
        )
        for name in FIGURES:
            assert (row[f"kinematic.{name}"] or math.nan) == pytest.approx(
                point.means["kinematic"][name].value, nan_ok=True
            )
            assert row[f"change.{name}.verdict"] == point.changes[name].verdict


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
