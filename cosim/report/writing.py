"""Writes the report of a run or a comparison: one HTML file with tables, plots and a replay."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import tomlkit
from markupsafe import Markup

from hexapod_cosim.cosim.common.control_style import control_styles
from hexapod_cosim.cosim.common.files import without_none, write_text
from hexapod_cosim.cosim.report.figures import Figures, draw_figures, write_figures
from hexapod_cosim.cosim.report.geometry import material_legend
from hexapod_cosim.cosim.report.headline import cards, creep_note, headline, plain_headline
from hexapod_cosim.cosim.report.page import NO_VIEWER, embedded, render, viewer_script
from hexapod_cosim.cosim.report.payload import as_json, make_payload
from hexapod_cosim.cosim.report.tables import (
    Rows,
    about,
    about_accuracy,
    comparison_rows,
    metric_rows,
    with_errors,
)
from hexapod_cosim.cosim.results.accuracy import Accuracy
from hexapod_cosim.cosim.results.comparison import METHOD
from hexapod_cosim.cosim.results.facts import RunFacts
from hexapod_cosim.cosim.results.folder import StoredResult
from hexapod_cosim.cosim.results.ground import describe_terrain
from hexapod_cosim.cosim.results.metric_table import has_net_slip
from hexapod_cosim.cosim.results.metrics import plans_feet
from hexapod_cosim.cosim.results.side_by_side import Comparisons

ALL_FORMATS = ("svg", "png")  # of figures
REPORT, PLOTS, PROFILE = "report.html", "plots", "profile"
STATIC = "static"  # of a section: its figure alone, without plots of the viewer


class Section(NamedTuple):
    """Holds a group of plots of the report."""

    name: str  # of the static figure that shows the same
    title: str
    caption: str
    shape: str = ""  # layout of its plots: three in a row, "pairs" or STATIC


SECTIONS = (
    Section("foot_forces", "Foot forces", "Normal force of each foot, in body weights."),
    Section(
        "slip",
        "Slip",
        "Above, the way all loaded feet have slipped since the start; "
        "below, the slip speed of each foot.",
    ),
    Section(
        "feet",
        "Planned and real feet",
        "How far each foot's centre is from where the command plans it, in the torso's frame; "
        "the figures show both paths.",
    ),
    Section(
        "posture",
        "Height and attitude",
        "Height of the torso above the ground, and its roll, pitch and yaw.",
        "pairs",
    ),
    Section(
        "profile",
        "Height profile",
        "The ground below the torso along its path; dots where feet touched down.",
        STATIC,
    ),
    Section("torques", "Torques", "The largest absolute torque over the six legs, joint by joint."),
    Section(
        "energy",
        "Energy audit",
        "Work, loss and stored energy since the start; beside them the unexplained residual.",
        STATIC,
    ),
    Section(
        "footfall",
        "Footfall",
        "Over the last gait cycles. Bars: the foot is on the ground. Grey bands: the gait plans it "
        "to swing.",
        STATIC,
    ),
    Section(
        "path",
        "Path of the torso",
        "The torso from above, its end marked by a dot; dotted, where the command leads.",
        STATIC,
    ),
)


def write_report(
    runs: Mapping[str, StoredResult],
    folder: Path,
    *,
    warn: Callable[[str], None],
    comparison: Comparisons | None = None,
    scenario: str | None = None,
    command: str | None = None,
    walks: Sequence[str] = (),
    accuracies: Mapping[str, Accuracy] = MappingProxyType({}),
    figures: Figures | None = None,
    formats: Sequence[str] = ("svg",),
) -> list[Path]:
    """Writes the figures and report.html; returns the files, the report last.

    Args:
        runs: by control; of a comparison, those of the first seed.
        folder: where report.html and the folder of figures are written.
        warn: called with a message for each figure that cannot be drawn.
        comparison: the metrics over all seeds; without it the report is of a single run.
        scenario, command: of a comparison; a single run has its own. The scenario is TOML.
        walks: sentences on the gait and stance of each control of a comparison, if they differ.
        accuracies: by control, where they were checked.
        figures: those of the runs; by default they are drawn now.
        formats: of the figures that are drawn now, among ALL_FORMATS.
    """
    if figures is None:
        figures = draw_figures({label: run.view for label, run in runs.items()}, formats)
    files, first = write_figures(figures, folder / PLOTS), next(iter(runs.values()))
    content = _figures(runs, figures, folder / PLOTS)
    for text in content["missing"]:
        warn(text)
    content |= _one_run(first) if comparison is None else _comparison(comparison, first.facts)
    page = render(
        "report.html.jinja",
        controls=runs,
        title=first.facts.title,
        scenario=first.scenario if scenario is None else scenario,
        command=first.facts.command if command is None else command,
        differences=walks,
        **content | _accuracy(content["rows"], accuracies),
        **_facts(runs),
        **_ground(runs),
        **_replay(runs),
    )
    write_text(folder / REPORT, page)
    return [*files, folder / REPORT]


def _figures(runs: Mapping[str, StoredResult], figures: Figures, folder: Path) -> dict[str, Any]:
    """Returns the sections of the page, pictures of the static ones, and what is missing."""
    skipped = dict(figures.skipped)
    if all(run.view.surface is None for run in runs.values()):
        skipped[PROFILE] = ""  # a plane has none, which is no loss
    if not any(plans_feet(run.view.recording) for run in runs.values()):
        skipped["feet"] = ""  # a controller need not report its plan
    missing = [
        f"{section.title} is not drawn: {skipped[section.name]}"
        for section in SECTIONS
        if skipped.get(section.name)
    ]
    images = {
        section.name: embedded(folder / f"{section.name}.svg")
        for section in SECTIONS
        if section.shape == STATIC and f"{section.name}.svg" in figures.images
    }
    shown = [section for section in SECTIONS if section.name not in skipped]
    return {"sections": shown, "images": images, "missing": missing}


def _ground(runs: Mapping[str, StoredResult]) -> dict[str, Any]:
    """Returns the text on the ground and the legend's entries for its materials."""
    first = next(iter(runs.values()))
    found = [
        entry
        for run in runs.values()
        if run.view.surface is not None
        for entry in material_legend(run.view.surface, run.view.parameters)
    ]
    return {
        "terrain": describe_terrain(first.view.surface, first.facts.parameters),
        "materials": [entry for k, entry in enumerate(found) if entry not in found[:k]],
        "creep": creep_note(first.facts, first.view.surface),
    }


def _accuracy(rows: Rows, accuracies: Mapping[str, Accuracy]) -> dict[str, Any]:
    """Returns the parts of the page on accuracy, and the rows of the table with errors."""
    return {
        "accuracy": about_accuracy(accuracies),
        "notes": [f"accuracy: {text}" for item in accuracies.values() for text in item.notes],
        "rows": with_errors(rows, accuracies),
    }


def _facts(runs: Mapping[str, StoredResult]) -> dict[str, Any]:
    """Returns the facts of all runs, by control."""
    facts = {label: run.facts for label, run in runs.items()}
    events = next(iter(facts.values())).events
    return {
        "labels": list(runs),
        "keys": {label: style.key for label, style in control_styles(runs).items()},
        "facts": facts,
        "walks": {label: one.walking.text for label, one in facts.items()},
        "events": [f"{event['time']:g} s: {event['text']}" for event in events],
        "warnings": [f"{label}: {text}" for label, one in facts.items() for text in one.warnings],
        "durations": {label: _duration(one) for label, one in facts.items()},
        "walked": {label: _walked(one) for label, one in facts.items()},
        "gains": {
            label: tomlkit.dumps(without_none(one.gains))
            for label, one in facts.items()
            if one.gains
        },
    }


def _one_run(run: StoredResult) -> dict[str, Any]:
    """Returns the parts of the page that only a report of a single run has."""
    metrics = {run.facts.control: run.metrics}
    rows = metric_rows(metrics, net_slip=has_net_slip(run.facts.parameters))
    return {
        "headline": plain_headline(run.metrics, run.facts),
        "headlines": [],
        "cards": [],
        "columns": list(metrics),
        "compared": [],
        "rows": rows,
        "about": "",
        "overall": [],
        "lead": f"Robot {run.facts.robot.name}, {_duration(run.facts)}.",
    }


def _comparison(comparison: Comparisons, facts: RunFacts) -> dict[str, Any]:
    """Returns the parts of the page that only a report of a comparison has."""
    rows = comparison_rows(comparison, net_slip=has_net_slip(facts.parameters))
    notes = about(comparison)
    means = notes.partition(f"; {METHOD}")[0]
    means = f"{means}; 95 % intervals in brackets." if means else "One run of each control."
    lead = f"Robot {facts.robot.name}. {means}"
    main = comparison.main
    return {
        "headline": headline(main),
        "headlines": [headline(pair) for pair in comparison.pairs if pair is not main],
        "cards": cards(main),
        "columns": comparison.labels,
        "compared": [pair.title for pair in comparison.pairs],
        "rows": rows,
        "about": notes,
        "overall": comparison.warnings if len(comparison.seeds) > 1 else comparison.losses,
        "lead": lead,
    }


def _replay(runs: Mapping[str, StoredResult]) -> dict[str, Any]:
    """Returns the viewer and its data; where it is not installed, a text on how to get it."""
    script = viewer_script()
    if script is None:
        return {"viewer": "", "payload": "", "thinned": [], "no_viewer": NO_VIEWER}
    payload, thinned = make_payload(runs)
    return {
        "viewer": script,
        "payload": Markup(as_json(payload)),
        "thinned": thinned,
        "no_viewer": "",
    }


def _duration(facts: RunFacts) -> str:
    simulated, wall = f"{facts.simulated:.6g} s", f"{facts.wall:.3g} s"
    return f"{simulated} simulated in {wall} ({facts.realtime_factor:.3g} x real time)"


def _walked(facts: RunFacts) -> str:
    """Returns duration and, if known, mean speed."""
    speed, simulated = facts.walk.mean_speed, f"{facts.simulated:.6g} s"
    if not math.isfinite(speed):
        return simulated
    return f"{simulated} at {1e3 * speed:.3g} mm/s"
