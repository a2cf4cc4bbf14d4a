"""The tables of a study as texts, for the terminal and for the report."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from hexapod_cosim.cosim.master.loop import COMPLETED
from hexapod_cosim.cosim.results.comparison import Change
from hexapod_cosim.cosim.results.metric_table import DUST, FLOORS, METRICS, shown_metrics
from hexapod_cosim.extensions.study.groups import Mean, Point
from hexapod_cosim.extensions.study.records import WALKED, Factor
from hexapod_cosim.extensions.study.store import FIGURES
from hexapod_cosim.extensions.study.summary import POINT_METRICS, Results

NONE = "-"  # where there is no value
SHOWN_POINTS = 100  # rows of the table of points


@dataclass(frozen=True)
class Table:
    """A table of texts."""

    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    left: Sequence[str] = ()  # columns that are aligned to the left: those without numbers

    @property
    def right(self) -> list[int]:
        """The places of the columns with numbers."""
        return [k for k, name in enumerate(self.columns) if name not in self.left]


def overall_table(results: Results) -> Table:
    """Returns a row for each metric: means over all walks, and the changes over all pairs."""
    overall, controls = results.overall, results.study.controls
    means = {
        control: {name: overall.means[control][name].value for name in FIGURES}
        for control in controls
    }
    columns = ["metric", "unit", *controls]
    for control in controls[1:]:
        title = "change" if len(controls) == 2 else f"to {control}"
        columns += [title, "95 % interval", ""]
    rows = []
    for name in (each for each in shown_metrics(means, net_slip=False) if each in FIGURES):
        row = [name, METRICS[name][0]]
        row += [shown_mean(name, overall.means[control][name]) for control in controls]
        for control in controls[1:]:
            change = overall.changes[control][name]
            row += [shown_change(change), shown_interval(change), change.verdict]
        rows.append(row)
    return Table(columns, rows, left=("metric", "unit", ""))


def failure_table(results: Results) -> Table:
    """Returns a row for each reason for which runs did not walk to their end."""
    rows = [
        [str(count), control, ending(status), reason]
        for (control, status, reason), count in results.failures.items()
    ]
    return Table(["runs", "control", "how", "reason"], rows, left=("control", "how", "reason"))


def ending(status: str) -> str:
    """Returns the word for how a run ended that did not walk to its end."""
    return "fell" if status == COMPLETED else status


def point_table(results: Results) -> Table:
    """Returns a row for each of at most about SHOWN_POINTS evenly chosen points."""
    study, points = results.study, results.points
    columns = ["point", *map(label_of, study.factors)]
    columns += [f"walked, {control}" for control in study.controls]
    for name in POINT_METRICS:
        columns += [f"{name}, {control}" for control in study.controls]
        columns += [f"change to {control}" for control in study.controls[1:]]
    step = max(math.ceil(len(points) / SHOWN_POINTS), 1)
    return Table(columns, [_point_row(point, results) for point in points[::step]])


def label_of(factor: Factor) -> str:
    """Returns the name of a factor with its unit."""
    unit = "x designed" if factor.relative else factor.unit
    return f"{factor.name} [{unit}]" if unit else factor.name


def _point_row(point: Point, results: Results) -> list[str]:
    controls, figures = results.study.controls, point.figures
    row = [f"{point.number}{' held out' if point.held_out else ''}"]
    row += [shown_value(value) for value in point.values.values()]
    row += [f"{figures.walked[name]} of {figures.runs[name]}" for name in controls]
    for name in POINT_METRICS:
        row += [shown_mean(name, figures.means[control][name]) for control in controls]
        row += [shown_change(found[name]) for found in figures.changes.values()]
    return row


def optimum_table(results: Results) -> Table:
    """Returns rows of the settings before the optimisation and of the best trials."""
    optimum = results.optimum
    if optimum is None:
        return Table([], [])
    names, parts = optimum["variables"], ("training", "held_out")
    figures = [(part, name) for part in parts for name in optimum["before"][part]]
    columns = ["", *names, *(f"{name}, {part.replace('_', ' ')}" for part, name in figures)]
    unset = {"values": dict.fromkeys(names), "label": "before", **optimum["before"]}
    rows = [
        [
            item.get("label") or _trial(item),
            *(shown_value(item["values"][name]) for name in names),
            *(_shown_figure(name, item[part][name]) for part, name in figures),
        ]
        for item in (unset, *optimum["best"])
    ]
    return Table(columns, rows, left=("",))


def optimum_changes(results: Results) -> Table:
    """Returns the changes from the settings before the optimisation to the best trials."""
    rows = [
        [_trial(item), part.replace("_", " "), name, *_shown_table(table), str(table["pairs"])]
        for item in (results.optimum or {"best": []})["best"]
        for part in ("held_out", "training")
        for name, table in item["change"][part].items()
    ]
    columns = ["from before to", "runs", "metric", "change", "95 % interval", "", "pairs"]
    return Table(columns, rows, left=("from before to", "runs", "metric", ""))


def _trial(item: Mapping[str, Any]) -> str:
    return f"trial {item['trial']}" + ("" if item["feasible"] else " (breaks a constraint)")


def _shown_table(table: Mapping[str, Any]) -> Iterator[str]:
    """Yields change, interval and verdict of a table of Change.as_table() that JSON held."""
    relative, low, high = (number(table[key]) for key in ("relative", "low", "high"))
    yield f"{relative:+.1%}" if math.isfinite(relative) else NONE
    yield _shown_range(low, high)
    yield table["verdict"]


def shown_value(value: Any) -> str:
    """Returns the value of a setting as text."""
    return NONE if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)


def shown_mean(name: str, item: Mean) -> str:
    """Returns a mean with the half width of its interval as text."""
    if not math.isfinite(item.value):
        return NONE
    least = DUST * FLOORS[name]
    value = 0.0 if abs(item.value) < least else item.value
    known = math.isfinite(item.half_width) and item.half_width >= least
    return f"{_short(value, 3)} ± {_short(item.half_width, 2)}" if known else _short(value, 3)


def _short(value: float, digits: int) -> str:
    """Returns a number with a number of digits, without an exponent unless it is tiny."""
    text = f"{value:.{digits}g}"
    return f"{value:.0f}" if "e+" in text else text


def shown_change(change: Change) -> str:
    """Returns a change relative to the first control's mean."""
    known = change.pairs > 0 and math.isfinite(change.relative)
    return f"{change.relative:+.0%}" if known else ""


def shown_interval(change: Change) -> str:
    """Returns the interval of a relative change."""
    return _shown_range(*change.interval) if shown_change(change) else ""


def _shown_range(low: float, high: float) -> str:
    return f"{low:+.1%} .. {high:+.1%}" if math.isfinite(low) else ""


def _shown_figure(name: str, value: float | None) -> str:
    if value is None or not math.isfinite(value):
        return NONE
    return f"{value:.0%}" if name == WALKED else f"{value:.4g}"


def number(value: float | None) -> float:
    """Returns a number of a JSON file, which has null for NaN."""
    return math.nan if value is None else value
