"""Writes report.html, the report of a study in one file, also of a study that is not finished."""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import tomlkit
from jinja2 import Environment, PackageLoader, StrictUndefined

from hexapod_cosim.cosim.common.control_style import control_styles
from hexapod_cosim.cosim.common.files import without_none, write_text
from hexapod_cosim.cosim.results.comparison import METHOD, Change
from hexapod_cosim.cosim.results.metrics import DUST, FLOORS, METRICS, shown_metrics
from hexapod_cosim.extensions.study.groups import Point
from hexapod_cosim.extensions.study.moments import Mean
from hexapod_cosim.extensions.study.objective import WALKED
from hexapod_cosim.extensions.study.records import DRAWN
from hexapod_cosim.extensions.study.report.figures import drawings, save
from hexapod_cosim.extensions.study.report.notes import notes
from hexapod_cosim.extensions.study.store import FIGURES
from hexapod_cosim.extensions.study.summary import POINTS, SUMMARY, Results

REPORT, FIGURES_FOLDER = "report.html", "plots"
SHOWN_POINTS = 100  # rows of the table of points; points.parquet has all
POINT_METRICS = (  # in that table
    "slip_per_metre",
    "cost_of_transport",
    "peak_force",
    "torque_rms",
)


def write_study_report(results: Results, folder: Path) -> list[Path]:
    """Draws the figures and writes the page. Returns the files, the page last."""
    before = math.nan
    if results.optimum is not None and results.study.optimise is not None:
        before = _number(results.optimum["before"]["training"][results.study.optimise.metrics[0]])
    found = drawings(results, before=before)
    files = save(found, folder / FIGURES_FOLDER) if found else []
    pictures = [
        (item.title, item.caption, _embedded(folder / FIGURES_FOLDER / f"{name}.svg"))
        for name, item in found.items()
    ]
    environment = Environment(
        loader=PackageLoader("hexapod_cosim.extensions.study", "report"),
        autoescape=True,
        undefined=StrictUndefined,
    )
    page = environment.get_template("study.html.jinja").render(
        styles=control_styles(results.study.controls),
        results=results,
        overall=overall_rows(results),
        points=point_rows(results),
        figures=pictures,
        optimum=optimum_rows(results),
        optimum_changes=optimum_changes(results),
        failures=[(*key, count) for key, count in results.failures.items()],
        toml=_toml(results),
        notes=notes(results),
        interval_meaning=interval_meaning(results),
        method=METHOD,
        wall=shown_time(results.wall),
        metrics=POINT_METRICS,
    )
    write_text(folder / REPORT, page)
    return [folder / POINTS, folder / SUMMARY, *files, folder / REPORT]


def _embedded(svg: Path) -> str:
    return "data:image/svg+xml;base64," + base64.b64encode(svg.read_bytes()).decode("ascii")


def _toml(results: Results) -> dict[str, str]:
    """Returns the files that repeat the study, by title."""
    gains = results.manifest["gains"]
    texts = {"The study": tomlkit.dumps(without_none(results.manifest["study"]))}
    texts |= {
        f"Scenario {name}": tomlkit.dumps(without_none(table))
        for name, table in results.manifest["scenarios"].items()
    }
    return texts | ({} if gains is None else {"Gains": tomlkit.dumps(without_none(gains))})


def interval_meaning(results: Results) -> str:
    """Returns what the intervals of the table over all runs are over."""
    if results.study.optimise is not None:
        return "over all trials, training and held-out runs: how much trials differ"
    if results.of_points == 1:
        return "over seeds"
    if results.study.design in DRAWN:
        return "over points drawn from the factors' distributions and their seeds"
    return "over points and seeds: mostly how much the points differ"


def overall_rows(results: Results) -> list[dict[str, Any]]:
    """Returns a row per metric: means over all walks by control, and the changes over all pairs.

    There is a change for each control but the first, in their order.
    """
    overall, rows = results.overall, []
    means = {
        control: {name: overall.means[control][name].value for name in FIGURES}
        for control in results.study.controls
    }
    for name in (each for each in shown_metrics(means, net_slip=False) if each in FIGURES):
        unit, _, meaning = METRICS[name]
        values = [
            shown_mean(name, overall.means[control][name]) for control in results.study.controls
        ]
        changes = [
            {"control": control, "pairs": found[name].pairs, **shown_change(found[name])}
            | {"spread": spread(results, control, name)}
            for control, found in overall.changes.items()
        ]
        facts = {"name": name, "unit": unit, "meaning": meaning}
        rows.append({**facts, "values": values, "changes": changes})
    return rows


def spread(results: Results, control: str, name: str) -> str:
    """Returns the least and the largest relative change over the points, if there are two.

    control: the one that is compared with the first.
    """
    found = [point.figures.changes[control][name].relative for point in results.points]
    known = [value for value in found if math.isfinite(value)]
    return f"{min(known):+.0%} .. {max(known):+.0%}" if len(known) > 1 else ""


def point_rows(results: Results) -> list[dict[str, Any]]:
    """Returns rows of at most about SHOWN_POINTS evenly chosen points."""
    points = results.points
    step = max(math.ceil(len(points) / SHOWN_POINTS), 1)
    return [_point_row(point, results) for point in points[::step]]


def _point_row(point: Point, results: Results) -> dict[str, Any]:
    controls, figures = results.study.controls, point.figures
    cells = [
        {
            "values": [shown_mean(name, figures.means[control][name]) for control in controls],
            "changes": [shown_change(found[name]) for found in figures.changes.values()],
        }
        for name in POINT_METRICS
    ]
    return {
        "number": point.number,
        "settings": [shown_value(value) for value in point.values.values()],
        "held_out": point.held_out,
        "walked": [f"{figures.walked[name]} of {figures.runs[name]}" for name in controls],
        "cells": cells,
    }


def shown_time(seconds: float) -> str:
    """Returns a duration as text."""
    for unit, size in (("hours", 3600.0), ("minutes", 60.0)):
        if seconds >= 2.0 * size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds:.3g} seconds"


def shown_value(value: Any) -> str:
    """Returns the value of a setting as text."""
    return "-" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)


def shown_mean(name: str, item: Mean) -> str:
    """Returns a mean with the half width of its interval as text."""
    if not math.isfinite(item.value):
        return "-"
    value = 0.0 if abs(item.value) < DUST * FLOORS[name] else item.value
    half = (
        f" ± {short(item.half_width, 2)}"
        if math.isfinite(item.half_width) and item.half_width >= DUST * FLOORS[name]
        else ""
    )
    return f"{short(value, 3)}{half}"


def short(value: float, digits: int) -> str:
    """Returns a number with a number of digits, without an exponent unless it is tiny."""
    text = f"{value:.{digits}g}"
    return f"{value:.0f}" if "e+" in text else text


def shown_change(change: Change) -> dict[str, str]:
    """Returns a change relative to the first control's mean, its interval and its verdict."""
    if not change.pairs or not math.isfinite(change.relative):
        return {"change": "", "interval": "", "verdict": change.verdict}
    return {
        "change": f"{change.relative:+.0%}",
        "interval": _shown_interval(*change.interval),
        "verdict": change.verdict,
    }


def _shown_interval(low: float, high: float) -> str:
    return f"{low:+.1%} .. {high:+.1%}" if math.isfinite(low) else ""


def optimum_rows(results: Results) -> list[dict[str, Any]]:
    """Returns rows of the settings before the optimisation and of the best trials."""
    optimum = results.optimum
    if optimum is None:
        return []
    before = {
        "label": "before",
        "settings": ["-"] * len(optimum["variables"]),
        **_shown_means(optimum["before"]),
    }
    return [before, *(_best_row(item, optimum) for item in optimum["best"])]


def optimum_changes(results: Results) -> list[dict[str, Any]]:
    """Returns the changes from the settings before the optimisation to the best trials.

    There is a row for each trial, metric and part of the runs, held-out runs first.
    """
    return [
        {
            "label": f"trial {item['trial']}",
            "part": part.replace("_", " "),
            "metric": name,
            **_change_row(table),
        }
        for item in (results.optimum or {"best": []})["best"]
        for part in ("held_out", "training")
        for name, table in item["change"][part].items()
    ]


def _change_row(table: Mapping[str, Any]) -> dict[str, Any]:
    relative, low, high = (_number(table[key]) for key in ("relative", "low", "high"))
    change = f"{relative:+.1%}" if math.isfinite(relative) else "-"
    return {
        "change": change,
        "interval": _shown_interval(low, high),
        "verdict": table["verdict"],
        "pairs": table["pairs"],
    }


def _best_row(item: Mapping[str, Any], optimum: Mapping[str, Any]) -> dict[str, Any]:
    label = f"trial {item['trial']}" + ("" if item["feasible"] else " (breaks a constraint)")
    return {
        "label": label,
        "settings": [shown_value(item["values"][name]) for name in optimum["variables"]],
        **_shown_means(item),
    }


def _shown_means(item: Mapping[str, Any]) -> dict[str, list[str]]:
    return {
        part: [_shown_figure(name, value) for name, value in item[part].items()]
        for part in ("training", "held_out")
    }


def _shown_figure(name: str, value: float | None) -> str:
    if value is None or not math.isfinite(value):
        return "-"
    return f"{value:.0%}" if name == WALKED else f"{value:.4g}"


def _number(value: float | None) -> float:
    return math.nan if value is None else value
