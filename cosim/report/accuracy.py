"""Adds accuracies to tables: an error beside every value, and the effect of half the macro-step."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from hexapod_cosim.cosim.results.accuracy import Accuracy
from hexapod_cosim.cosim.results.metric_table import DUST, FLOORS

SHOWN = 0.0005  # relative; a smaller effect would be shown as 0.0 %

Rows = list[dict[str, Any]]
Metrics = Mapping[str, Mapping[str, float | None]]


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
    error = accuracy.solver_error.get(name, math.nan)
    return f"{text} ± {_short(name, abs(error))}" if math.isfinite(error) else text


def effect_rows(rows: Rows, accuracies: Mapping[str, Accuracy], metrics: Metrics) -> Rows:
    """Returns the effects of half the macro-step, in rows like those of a report's table.

    metrics: the values by control, for relative effects.
    """
    return [
        {
            "name": (name := row["name"]),
            "unit": row["unit"],
            "values": [
                _effect(name, item.macro_step_effect.get(name, math.nan), metrics[label].get(name))
                for label, item in accuracies.items()
            ],
        }
        for row in rows
        if any(row["name"] in item.macro_step_effect for item in accuracies.values())
    ]


def _effect(name: str, effect: float, value: float | None) -> str:
    """Returns an effect with its sign and, where the value allows, its share of the value."""
    if not math.isfinite(effect):
        return "-"
    text = _short(name, effect)
    sign = "" if text == "0" or effect < 0.0 else "+"
    known = value is not None and abs(value) > FLOORS.get(name, 0.0)
    share = effect / value if value is not None and known else 0.0
    relative = f" ({100.0 * share:+.1f} %)" if abs(share) >= SHOWN else ""
    return f"{sign}{text}{relative}"


def _short(name: str, value: float) -> str:
    """Returns a value with two digits, or 0 where it is below the metric's round-off."""
    return "0" if abs(value) < DUST * FLOORS.get(name, 0.0) or value == 0.0 else f"{value:.2g}"


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
        f"{first.reference}, with the same commands and control period.{means} "
        f"Half the macro-step, {first.macro_step:g} s, in which the controller acts and outputs "
        "are read twice as often, changes:"
    )
