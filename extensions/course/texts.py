"""The tables of a course as texts, for the terminal, the report and the documentation."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping

from hexapod_cosim.extensions.course.records import SHOWN, Quantity
from hexapod_cosim.extensions.course.statistics import Interval, Rate
from hexapod_cosim.extensions.course.table import ALL, CaseFigures, ClassFigures, Table

NUMBER = re.compile(r"[0-9.]*[0-9]")
NONE = "-"  # where there is no value
LEAST_HALF = 5e-4  # of a mean: a narrower interval is not shown
SCALES: Mapping[str, tuple[float, str]] = {  # shown value over the metric's, and its unit
    "slip": (1e3, "mm/m"),
    "path": (1e3, "mm/m"),
    "tilt": (180.0 / math.pi, "deg"),
    "heat": (1.0, ""),
}


def unit_of(quantity: Quantity) -> str:
    """Returns the unit that a quantity is shown in, "" for a number without one."""
    unit = SCALES.get(quantity.name, (1.0, quantity.unit))[1]
    return "" if unit == "1" else unit


def heading(quantity: Quantity) -> str:
    """Returns the short title of a quantity with the unit that it is shown in."""
    return " ".join(filter(None, [quantity.short, unit_of(quantity)]))


def shown_rate(rate: Rate) -> str:
    """Returns successes among runs, as "9/10"."""
    return f"{rate.successes}/{rate.runs}" if rate.runs else NONE


def shown_rate_interval(rate: Rate) -> str:
    """Returns a rate with its interval, as "90 (60..98)" in %."""
    found = rate.interval
    if math.isnan(found.value):
        return NONE
    return f"{100.0 * found.value:.0f} ({100.0 * found.low:.0f}..{100.0 * found.high:.0f})"


def shown_mean(quantity: Quantity, mean: Interval) -> str:
    """Returns a mean and half of its interval, in the unit of `heading`."""
    if math.isnan(mean.value):
        return NONE
    scale = SCALES.get(quantity.name, (1.0, ""))[0]
    value, half = scale * mean.value, scale * (mean.high - mean.value)
    known = math.isfinite(half) and half > LEAST_HALF * abs(value)
    return f"{_short(value, 3)} ± {_short(half, 2)}" if known else _short(value, 3)


def _short(value: float, digits: int) -> str:
    """Returns a number with a number of digits, large ones without an exponent."""
    text = f"{value:.{digits}g}"
    return f"{value:.0f}" if "e+" in text else text


def shown_change(ratio: Interval) -> str:
    """Returns a ratio as a change in % with its interval, as "-52 (-55..-48)".

    An interval that does not show in whole percents is left out.
    """
    if math.isnan(ratio.value):
        return NONE
    change = _percent(ratio.value)
    if math.isnan(ratio.low) or {_percent(ratio.low), _percent(ratio.high)} == {change}:
        return change
    return f"{change} ({_percent(ratio.low)}..{_percent(ratio.high)})"


def _percent(ratio: float) -> str:
    change = 100.0 * (ratio - 1.0)
    return f"{change:+.0f}" if round(change) else "0"


def class_rows(table: Table) -> tuple[list[str], list[list[str]]]:
    """Returns the table of classes: success, and changes of the medians from the reference."""
    columns = ["class", "control", "against", "success %", *(f"{item.short} %" for item in SHOWN)]
    rows = [
        [name, *_compared(table, column), shown_rate_interval(figures.success)]
        + [_class_cell(table, figures, item) for item in SHOWN]
        for (name, column), figures in table.classes.items()
        if name != ALL or len(table.classes) > 2 * len(table.columns)
    ]
    return columns, rows


def _compared(table: Table, column: str) -> tuple[str, str]:
    """Returns control and reference of a column; "" for that of the reference."""
    control, reference = table.columns[column]
    return control, reference if reference != control else ""


def _class_cell(table: Table, figures: ClassFigures, quantity: Quantity) -> str:
    if figures.control == table.reference:
        return "ref."
    return shown_change(figures.ratio(quantity.name))


def case_rows(table: Table) -> tuple[list[str], list[list[str]]]:
    """Returns the table of cases: successes, and means over them."""
    columns = ["case, control", "success", *(heading(item) for item in SHOWN)]
    rows = [
        [f"{name}, {control}", shown_rate(figures.success)]
        + [shown_mean(item, figures.mean(item.name)) for item in SHOWN]
        for (name, control), figures in table.cases.items()
        if control in table.controls
    ]
    return columns, rows


def failure_rows(table: Table) -> tuple[list[str], list[list[str]]]:
    """Returns the table of failed runs by case, control and reason."""
    rows = [
        [name, control, str(count), reason]
        for (name, control), figures in table.cases.items()
        if control in table.controls
        for reason, count in _alike(figures)
    ]
    return ["case", "control", "runs", "reason"], rows


def _alike(figures: CaseFigures) -> Iterator[tuple[str, int]]:
    """Yields reasons with their numbers of runs; reasons that differ in numbers alone are one."""
    counts: dict[str, tuple[str, int]] = {}
    for reason, count in figures.failures.items():
        key = NUMBER.sub("#", reason)
        first, total = counts.get(key, (reason, 0))
        counts[key] = first, total + count
    yield from counts.values()


def sweep_rows(table: Table) -> tuple[list[str], list[list[str]]]:
    """Returns the successes over the heights of each sweep."""
    names = dict.fromkeys(case.sweep for case in table.course.cases if case.sweep)
    rows = []
    for name in names:
        for control in table.controls:
            found = table.sweep(name, control)
            cells = "  ".join(
                f"{1e3 * case.case.height:.0f} mm {shown_rate(case.success)}" for case in found
            )
            rows.append([name, control, cells])
    return ["heights", "control", "success"], [row for row in rows if row[2]]


def tables(table: Table) -> list[tuple[str, tuple[list[str], list[list[str]]]]]:
    """Returns titles and contents of all tables that are not empty."""
    every = [
        (
            "Classes: success, and medians over cases of the change from the control that is named "
            "beside it (95 % interval)",
            class_rows(table),
        ),
        ("Success over the height of stones and stairs", sweep_rows(table)),
        ("Cases: means over the successful runs ± half a 95 % interval", case_rows(table)),
        ("Failures", failure_rows(table)),
    ]
    return [(title, content) for title, content in every if content[1]]
