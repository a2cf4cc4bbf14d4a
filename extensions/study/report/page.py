"""Writes report.html, the report of a study in one file, also of a study that is not finished."""

from __future__ import annotations

import math
from pathlib import Path

import tomlkit

from hexapod_cosim.cosim.common.files import without_none, write_text
from hexapod_cosim.cosim.report.page import embedded, render
from hexapod_cosim.cosim.results.comparison import METHOD
from hexapod_cosim.cosim.results.metric_table import METRICS
from hexapod_cosim.extensions.study.report import tables
from hexapod_cosim.extensions.study.report.figures import drawings, save
from hexapod_cosim.extensions.study.report.notes import notes
from hexapod_cosim.extensions.study.summary import SUMMARY, Results

REPORT, FIGURES_FOLDER = "report.html", "plots"
HEADLINES = ("slip_per_metre", "cost_of_transport")  # metrics whose changes come first


def write_study_report(results: Results, folder: Path) -> list[Path]:
    """Draws the figures and writes the page. Returns the files, the page last."""
    before = math.nan
    if results.optimum is not None and results.study.optimise is not None:
        metric = results.study.optimise.metrics[0]
        before = tables.number(results.optimum["before"]["training"][metric])
    found = drawings(results, before=before)
    files = save(found, folder / FIGURES_FOLDER) if found else []
    pictures = [
        (item.title, item.caption, embedded(folder / FIGURES_FOLDER / f"{name}.svg"))
        for name, item in found.items()
    ]
    page = render(
        "study.html.jinja",
        extension="study",
        controls=results.study.controls,
        results=results,
        cards=cards(results),
        overall=tables.overall_table(results),
        meanings={name: meaning for name, (_, _, meaning) in METRICS.items()},
        points=tables.point_table(results),
        figures=pictures,
        optimum=tables.optimum_table(results),
        optimum_changes=tables.optimum_changes(results),
        failures=tables.failure_table(results),
        toml=_toml(results),
        notes=notes(results),
        method=METHOD,
    )
    write_text(folder / REPORT, page)
    return [folder / SUMMARY, *files, folder / REPORT]


def cards(results: Results) -> list[tuple[str, str, str, str]]:
    """Returns name, value, what it is of and verdict of the figures at the top of the page."""
    overall = results.overall
    found = [
        (name, f"{overall.walked[name]} / {runs}", "walked to the end", "")
        for name, runs in overall.runs.items()
    ]
    for name in HEADLINES:
        for control, changes in overall.changes.items():
            change = changes[name]
            if text := tables.shown_change(change):
                title = f"{name.replace('_', ' ')}, {control}"
                of = f"95 %: {tables.shown_interval(change)}, {change.pairs} pairs"
                found.append((title, text, of, change.verdict))
    return found


def _toml(results: Results) -> dict[str, str]:
    """Returns the files that repeat the study, by title."""
    content = {"The study": results.manifest["study"]}
    content |= {f"Scenario {name}": table for name, table in results.manifest["scenarios"].items()}
    if results.manifest["gains"] is not None:
        content["Gains"] = results.manifest["gains"]
    return {title: tomlkit.dumps(without_none(table)) for title, table in content.items()}
