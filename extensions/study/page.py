"""Writes the tables of a study as texts, and its report: one file, also of a study that runs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hexapod_cosim.cosim.common.files import write_text
from hexapod_cosim.cosim.master.loop import COMPLETED
from hexapod_cosim.cosim.report.headline import Part, cards, effects
from hexapod_cosim.cosim.report.page import embedded, render
from hexapod_cosim.cosim.report.tables import number, shown_change
from hexapod_cosim.cosim.results.comparison import METHOD
from hexapod_cosim.cosim.results.metric_table import DUST, FLOORS, METRICS, shown_metrics
from hexapod_cosim.cosim.results.summary import balance_warnings
from hexapod_cosim.extensions.study.figures import drawing_of, save
from hexapod_cosim.extensions.study.records import WALKED, shown_value
from hexapod_cosim.extensions.study.store import FIGURES
from hexapod_cosim.extensions.study.summary import POINT_METRICS, SUMMARY, Mean, Point, Results

SHOWN_POINTS = 100  # rows of the table of points
PARTS = {"training": "training", "held_out": "held out"}
ENDINGS = {COMPLETED: "fell"}  # how a run ended that did not walk to its end


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
        control: {name: mean.value for name, mean in of_control.items()}
        for control, of_control in overall.means.items()
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
            row += shown_change(overall.changes[control][name]).values()
        rows.append(row)
    return Table(columns, rows, left=("metric", "unit", ""))


def failure_table(results: Results) -> Table:
    """Returns a row for each reason for which runs did not walk to their end."""
    rows = [
        [str(count), control, ENDINGS.get(status, status), reason]
        for (control, status, reason), count in results.failures.items()
    ]
    return Table(["runs", "control", "how", "reason"], rows, left=("control", "how", "reason"))


def point_table(results: Results) -> Table:
    """Returns a row for each of at most about SHOWN_POINTS evenly chosen points."""
    study, points = results.study, results.points
    columns = ["point", *(factor.label for factor in study.factors)]
    columns += [f"walked, {control}" for control in study.controls]
    for name in POINT_METRICS:
        columns += [f"{name} [{METRICS[name][0]}], {control}" for control in study.controls]
        columns += [f"change to {control}" for control in study.controls[1:]]
    step = max(math.ceil(len(points) / SHOWN_POINTS), 1)
    return Table(columns, [_point_row(point, results) for point in points[::step]])


def _point_row(point: Point, results: Results) -> list[str]:
    controls, figures = results.study.controls, point.figures
    row = [f"{point.number}{' held out' if point.held_out else ''}"]
    row += [shown_value(value) for value in point.values.values()]
    row += [f"{figures.walked[name]} of {figures.runs[name]}" for name in controls]
    for name in POINT_METRICS:
        row += [shown_mean(name, figures.means[control][name]) for control in controls]
        row += [shown_change(found[name])["change"] for found in figures.changes.values()]
    return row


def optimum_table(results: Results) -> Table:
    """Returns a row for each metric before and after an optimisation, with its change."""
    optimum = results.optimum or {"before": {}, "best": {}}
    before, best = optimum["before"], optimum["best"]
    rows = [
        [
            *(words, name, _shown_figure(name, value), _shown_figure(name, best[part][name])),
            *_shown_table(best["change"][part].get(name)),
        ]
        for part, words in PARTS.items()
        for name, value in before.get(part, {}).items()
    ]
    columns = ["runs", "metric", "before", "after", "change", "95 % interval", "", "pairs"]
    return Table(columns, rows, left=("runs", "metric", ""))


def best_settings(results: Results) -> str:
    """Returns the settings of the best trial as text, "" without one."""
    if results.optimum is None:
        return ""
    best = results.optimum["best"]
    values = [f"{name} {shown_value(value)}" for name, value in best["values"].items()]
    broken = "" if best["feasible"] else "; it breaks a constraint"
    return f"Best: trial {best['number']}, {', '.join(values)}{broken}"


def _shown_table(table: Mapping[str, Any] | None) -> list[str]:
    """Returns change, interval, verdict and pairs of a table of Change.as_table() from JSON."""
    if table is None or table["relative"] is None:
        return ["-", "", "", ""]
    relative, low, high = (table[key] for key in ("relative", "low", "high"))
    interval = "" if low is None else f"{100.0 * low:+.1f} to {100.0 * high:+.1f} %"
    return [f"{100.0 * relative:+.1f} %", interval, table["verdict"], str(table["pairs"])]


def shown_mean(name: str, item: Mean) -> str:
    """Returns a mean with the half width of its interval as text."""
    dust = DUST * FLOORS[name]
    known = math.isfinite(item.half_width) and item.half_width >= dust
    width = f" ± {item.half_width:.2g}" if known else ""
    return number(item.value, dust=dust) + width


def _shown_figure(name: str, value: float | None) -> str:
    return f"{value:.0%}" if name == WALKED and value is not None else number(value)


REPORT, FIGURES_FOLDER = "report.html", "plots"
TOO_SHORT = (
    "too short for figures, which are of whole gait cycles after the second: set a longer duration."
)


def write_study_report(results: Results, folder: Path) -> list[Path]:
    """Draws the figures and writes the page. Returns the files, the page last."""
    drawing = drawing_of(results)
    files = save(drawing, folder / FIGURES_FOLDER) if drawing else []
    page = render(
        "study.html.jinja",
        package=__package__,
        controls=results.study.controls,
        results=results,
        headline=headline(results),
        cards={name: cards(changes) for name, changes in results.overall.changes.items()},
        walks=shown_walks(results),
        overall=overall_table(results),
        meanings={name: meaning for name, (_, _, meaning) in METRICS.items()},
        points=point_table(results),
        drawing=drawing,
        picture=embedded(folder / FIGURES_FOLDER / f"{drawing.name}.svg") if drawing else "",
        optimum=optimum_table(results),
        best=best_settings(results),
        failures=failure_table(results),
        notes=list(notes(results)),
        method=METHOD,
    )
    write_text(folder / REPORT, page)
    return [folder / SUMMARY, *files, folder / REPORT]


def headline(results: Results) -> list[Part]:
    """Returns the headline: the largest changes to the second control, or how many runs walked."""
    overall, controls = results.overall, results.study.controls
    if len(controls) > 1 and overall.pairs[controls[1]]:
        return effects(
            overall.changes[controls[1]], [Part(f"Against {controls[0]} control, {controls[1]}")]
        )
    return [Part(f"Walked to the end: {shown_walks(results)}.")]


def shown_walks(results: Results) -> str:
    """Returns how many runs walked to their end, by control."""
    overall = results.overall
    return ", ".join(f"{name} {overall.walked[name]} of {n}" for name, n in overall.runs.items())


def notes(results: Results) -> Iterator[str]:
    """Yields the notes as sentences: missing runs, no walks, short walks, unbalanced energy."""
    overall = results.overall
    if results.facts["status"] != COMPLETED and results.study.optimise is None:
        yield (
            "Not all runs are there. Means by control are of the runs that are there, which need "
            "not be of the same points and seeds; changes are of whole pairs."
        )
    for control, total in overall.runs.items():
        walked = overall.walked[control]
        if total and not walked:
            (_, status, reason), count = next(
                item for item in results.failures.items() if item[0][0] == control
            )
            alike = "all" if count == total else f"{count} of them"
            yield (
                f"none of {total} {control} runs walked to its end; "
                f"{alike} {ENDINGS.get(status, status)}: {reason}"
            )
        elif walked and not results.figured[control]:
            yield f"All {walked} {control} walks are {TOO_SHORT}"
        yield from balance_warnings(control, results.residuals[control], runs=total)
