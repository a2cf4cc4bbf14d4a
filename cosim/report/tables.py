"""Makes the rows of a report's tables as texts: metrics, changes, accuracies, loads on servos."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from hexapod_cosim.cosim.results.accuracy import Accuracy
from hexapod_cosim.cosim.results.comparison import BETTER, METHOD, SAME, WORSE, Change
from hexapod_cosim.cosim.results.metric_table import DUST, FLOORS, METRICS, shown_metrics
from hexapod_cosim.cosim.results.side_by_side import Comparisons
from hexapod_cosim.models import JOINT_NAMES, LEG_NAMES

SIZE = (len(LEG_NAMES), len(JOINT_NAMES))

Rows = list[dict[str, Any]]
Metrics = Mapping[str, Mapping[str, float | None]]


def metric_rows(metrics: Metrics, *, net_slip: bool) -> Rows:
    """Returns a row per metric that the runs have: name, unit, meaning and values as texts.

    metrics: by control.
    """
    empty: dict[str, Any] = {"change": "", "interval": "", "verdict": "", "changes": []}
    shown = [(name, *METRICS[name]) for name in shown_metrics(metrics, net_slip=net_slip)]
    return [
        {
            "name": name,
            "unit": unit,
            "meaning": meaning,
            "values": [_shown(name, run.get(name)) for run in metrics.values()],
        }
        | empty
        for name, unit, _, meaning in shown
    ]


def comparison_rows(comparison: Comparisons, *, net_slip: bool = False) -> Rows:
    """Returns the rows of the means, with the changes from the reference of each other control.

    `changes` of a row has an entry for each pair; `change`, `interval` and `verdict` are those of
    the first entry. Over several seeds, the first row tells how many runs walked to the end.
    """
    rows = metric_rows(comparison.means, net_slip=net_slip)
    for row in rows:
        changes = [shown_change(pair.changes[row["name"]]) for pair in comparison.pairs]
        row |= {**changes[0], "changes": changes}
    count, walked = len(comparison.seeds), comparison.walked
    if count == 1:
        return rows
    counted = [
        {"change": "", "interval": "", "verdict": _more(*(walked[label] for label in pair.labels))}
        for pair in comparison.pairs
    ]
    first = {
        "name": "walked",
        "unit": "runs",
        "meaning": "runs in which the robot walked upright to the end and arrived",
        "values": [f"{number} of {count}" for number in walked.values()],
        **counted[0],
        "changes": counted,
    }
    return [first, *rows]


def shown_change(change: Change) -> dict[str, str]:
    """Returns a change, its interval and its verdict as texts, "" where there is none."""
    return {"change": _change(change), "interval": _interval(change), "verdict": change.verdict}


def _more(before: int, after: int) -> str:
    """Returns the verdict on a number of walks."""
    return SAME if before == after else BETTER if after > before else WORSE


def about(comparison: Comparisons) -> str:
    """Returns a sentence on what the table's values are; "" for a single seed."""
    seeds, n = comparison.seeds, len(comparison.seeds)
    if n == 1:
        return ""
    if len(comparison.pairs) > 1:
        return (
            f"Means over those of {n} seeds ({seeds[0]} to {seeds[-1]}) on which the control "
            f"walked to the end; changes are over the pairs in which both walked; {METHOD}."
        )
    judged = max(change.pairs for change in comparison.pairs[0].changes.values())
    part = f" of the {judged} in which both walked to the end" if judged < n else ""
    return (
        f"Means over {n} seeds ({seeds[0]} to {seeds[-1]}){part}, both controls on each; {METHOD}."
    )


def _shown(name: str, value: float | None) -> str:
    return number(value, dust=DUST * FLOORS[name])


def number(value: float | None, *, dust: float = 0.0) -> str:
    """Returns a value as text with four digits; one smaller than `dust` is 0."""
    if value is not None and abs(value) < dust:
        return "0"
    return "-" if value is None or not math.isfinite(value) else f"{value:.4g}"


def _change(change: Change) -> str:
    """Returns the relative change; "" near the floor and for a single pair without a verdict."""
    known = math.isfinite(change.relative) and (change.pairs > 1 or change.verdict != SAME)
    return _share(change.relative) if known else ""


def _interval(change: Change) -> str:
    low, high = change.interval
    return f"{_share(low).removesuffix(' %')} to {_share(high)}" if math.isfinite(low) else ""


def _share(value: float) -> str:
    return f"{100.0 * value:+.1f} %"


def with_errors(rows: Rows, accuracies: Mapping[str, Accuracy]) -> Rows:
    """Returns the rows of a report's table with the solver's error beside each value.

    The accuracies are by control, in the order of the values.
    """
    if not accuracies:
        return rows
    return [
        row
        | {
            "values": [
                _with_error(row["name"], *pair)
                for pair in zip(row["values"], accuracies.values(), strict=True)
            ]
        }
        for row in rows
    ]


def _with_error(name: str, text: str, accuracy: Accuracy) -> str:
    error = abs(accuracy.solver_error.get(name, math.nan))
    dust = DUST * FLOORS.get(name, 0.0)
    return f"{text} ± {0.0 if error < dust else error:.2g}" if math.isfinite(error) else text


def about_accuracy(accuracies: Mapping[str, Accuracy]) -> str:
    """Explains the numbers in sentences; returns "" where accuracy was not checked."""
    if not accuracies:
        return ""
    first = next(iter(accuracies.values()))
    counted = sorted({item.runs for item in accuracies.values()})
    means = (
        f" Means over {' and '.join(map(str, counted))} runs of each control."
        if counted[-1] > 1
        else ""
    )
    return (
        "± is the solver's error: by so much a value differs from that of the same walk at "
        f"{first.reference}, with the same commands and control period.{means}"
    )
