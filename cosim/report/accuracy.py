"""Accuracy in tables: an error beside every value, and what half the macro-step changes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from hexapod_cosim.cosim.results.accuracy import Accuracy
from hexapod_cosim.cosim.results.metrics import DUST, FLOORS

SHOWN = 0.0005  # relative: less is 0.0 %

Rows = list[dict[str, Any]]
Metrics = Mapping[str, Mapping[str, float | None]]


def with_errors(rows: Rows, accuracies: Mapping[str, Accuracy]) -> Rows:
    """The rows of a report's table with the solver's error beside each value, in the order of
    the controls.
    """
    return (
        [
            row
            | {
                "values": [
                    _with_error(row["name"], *pair)
                    for pair in zip(row["values"], accuracies.values(), strict=True)
                ]
            }
            for row in rows
        ]
        if accuracies
        else rows
    )


def _with_error(name: str, text: str, accuracy: Accuracy) -> str:
    error = accuracy.solver_error.get(name, math.nan)
    return f"{text} ± {_short(name, abs(error))}" if math.isfinite(error) else text


def effect_rows(rows: Rows, accuracies: Mapping[str, Accuracy], metrics: Metrics) -> Rows:
    """Of the rows of a report's table, those that half the macro-step may change: name, unit,
    and by control by how much it does.
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
    if not math.isfinite(effect):
        return "-"
    text = _short(name, effect)
    share = (
        effect / value if value is not None and abs(value) > FLOORS.get(name, 0.0) else 0.0
    )  # relative to next to nothing is none
    return f"{'' if text == '0' or effect < 0.0 else '+'}{text}" + (
        f" ({100.0 * share:+.1f} %)" if abs(share) >= SHOWN else ""
    )


def _short(name: str, value: float) -> str:
    """Two digits; what is less than round-off of the metric is 0."""
    return "0" if abs(value) < DUST * FLOORS.get(name, 0.0) or value == 0.0 else f"{value:.2g}"


def about_accuracy(accuracies: Mapping[str, Accuracy]) -> str:
    """What the numbers are, in sentences; "" where accuracy was not checked."""
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
        f"± is the solver's error: by so much a value differs from that of the same walk at {first.reference}, with the same commands and "
        f"control period.{means} Half the macro-step, {first.macro_step:g} s, in which the controller acts and outputs are read twice as "
        "often, changes:"
    )
