"""Writes report.html, the report of a study in one file, also of a study that is not finished."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import tomlkit

from hexapod_cosim.cosim.common.files import without_none, write_text
from hexapod_cosim.cosim.master.loop import COMPLETED
from hexapod_cosim.cosim.report.page import embedded, render
from hexapod_cosim.cosim.results.comparison import METHOD
from hexapod_cosim.cosim.results.metric_table import METRICS
from hexapod_cosim.cosim.results.summary import balance_warnings
from hexapod_cosim.extensions.study import tables
from hexapod_cosim.extensions.study.figures import drawings, save
from hexapod_cosim.extensions.study.records import SOBOL, Study
from hexapod_cosim.extensions.study.summary import SUMMARY, Results

REPORT, FIGURES_FOLDER = "report.html", "plots"
HEADLINES = ("slip_per_metre", "cost_of_transport")  # metrics whose changes come first
TOO_SHORT = (
    "too short for figures, which are of whole gait cycles after the second: set a longer duration."
)


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


def notes(results: Results) -> list[str]:
    """Returns the notes as sentences."""
    found = [*_of_design(results.study), *_of_missing_runs(results)]
    found += [*_without_walks(results), *_of_walks(results)]
    for control, (count, largest) in results.unbalanced.items():
        runs = results.overall.runs[control]
        found += balance_warnings(control, count, largest, runs=runs)
    return found


def _of_design(study: Study) -> Iterator[str]:
    if study.design == SOBOL and study.optimise is None and study.points & (study.points - 1):
        below = 1 << (study.points.bit_length() - 1)
        yield (
            f"{study.points} Sobol points are no power of two: only {below} or {2 * below} would "
            "cover the factors evenly."
        )


def _of_missing_runs(results: Results) -> Iterator[str]:
    if results.facts["status"] != COMPLETED and results.study.optimise is None:
        yield (
            "Not all runs are there. Means by control are of the runs that are there, which need "
            "not be of the same points and seeds; changes are of whole pairs."
        )


def _without_walks(results: Results) -> Iterator[str]:
    """Yields a note for each control under which no run walked to its end."""
    overall = results.overall
    for control, total in overall.runs.items():
        reasons = [(key, count) for key, count in results.failures.items() if key[0] == control]
        if reasons and not overall.walked[control]:
            (_, status, reason), count = reasons[0]
            alike = "all" if len(reasons) == 1 else f"{count} of them"
            yield (
                f"none of {total} {control} runs walked to its end; "
                f"{alike} {tables.ending(status)}: {reason}"
            )


def _of_walks(results: Results) -> Iterator[str]:
    """Yields a note for each scenario and control whose walks gave no figures."""
    for (case, control), (walked, figured) in results.walks.items():
        if not figured:
            yield f"All {walked} {control} walks of {case} are {TOO_SHORT}"
