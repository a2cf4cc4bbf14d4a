"""The report of a run or a comparison: one static HTML file with everything in it."""

from __future__ import annotations

import base64
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from hexapod_cosim.cosim.comparison import BETTER, SAME, WORSE, Change, Comparison
from hexapod_cosim.cosim.files import write_text
from hexapod_cosim.cosim.metrics import DUST, FLOORS, METRICS
from hexapod_cosim.cosim.results import Stored
from hexapod_cosim.cosim.toml_text import to_toml

REPORT, PLOTS = "report.html", "plots"

Rows = list[dict[str, Any]]


def write_report(
    runs: Mapping[str, Stored],
    folder: Path,
    *,
    tell: Callable[[str], None],
    comparison: Comparison | None = None,
    scenario: str | None = None,
    command: str | None = None,
) -> list[Path]:
    """Draws the figures and writes report.html for runs by control. Returns the files, the report last.

    `tell` hears what could not be drawn. A comparison, whose figures are over all seeds while the runs are those of the first one, says
    by what `scenario` (TOML) and `command` it was made; a single run has its own.
    """
    from hexapod_cosim.cosim.plots import FIGURES, save_figures  # noqa: PLC0415  matplotlib is slow to import

    files, skipped = save_figures({label: run.view for label, run in runs.items()}, folder / PLOTS)
    missing = [f"{FIGURES[name].title} is not drawn: {reason}" for name, reason in skipped.items()]
    for text in missing:
        tell(text)
    environment = Environment(loader=PackageLoader("hexapod_cosim.cosim", "report"), autoescape=True, undefined=StrictUndefined)
    first = next(iter(runs.values()))
    figures = [
        (item.title, item.caption, _embedded(folder / PLOTS / f"{name}.svg")) for name, item in FIGURES.items() if name not in skipped
    ]
    if comparison is None:
        rows, notes, losses = metric_rows({label: run.metrics for label, run in runs.items()}), "", []
    else:
        rows, notes, losses = comparison_rows(comparison), about(comparison), comparison.losses
    facts = {label: run.facts for label, run in runs.items()}
    page = environment.get_template("report.html.jinja").render(
        title=first.facts["title"], labels=list(runs), rows=rows, about=notes, losses=losses, figures=figures, facts=facts, missing=missing,
        scenario=first.scenario if scenario is None else scenario, command=first.facts.get("command", "") if command is None else command,
        gains={label: to_toml(run.facts["gains"]) for label, run in runs.items() if run.facts.get("gains")},
    )  # fmt: skip
    write_text(folder / REPORT, page)
    return [*files, folder / REPORT]


def _embedded(svg: Path) -> str:
    return "data:image/svg+xml;base64," + base64.b64encode(svg.read_bytes()).decode("ascii")


def metric_rows(metrics: Mapping[str, Mapping[str, float | None]]) -> Rows:
    """A row per metric: name, unit, meaning, and values by control as text."""
    empty = {"change": "", "interval": "", "verdict": ""}
    return [
        {"name": name, "unit": unit, "meaning": meaning, "values": [_shown(name, run.get(name)) for run in metrics.values()]} | empty
        for name, (unit, _, meaning) in METRICS.items()
    ]


def comparison_rows(comparison: Comparison) -> Rows:
    """The same of means, with changes from the first control to the second; before them, if of several seeds, how many runs walked."""
    rows = metric_rows(comparison.means)
    for row in rows:
        change = comparison.changes[row["name"]]
        row |= {"change": _change(change), "interval": _interval(change), "verdict": change.verdict}
    count, walked = len(comparison.seeds), list(comparison.walked.values())
    if count == 1:
        return rows
    verdict = SAME if walked[0] == walked[1] else BETTER if walked[1] > walked[0] else WORSE
    first = {"name": "walked", "unit": "runs", "meaning": "runs in which the robot walked to the end", "change": "", "interval": ""}
    return [first | {"values": [f"{number} of {count}" for number in walked], "verdict": verdict}, *rows]


def about(comparison: Comparison) -> str:
    """What the table's figures are, in a sentence; "" for a single seed."""
    seeds, n = comparison.seeds, len(comparison.seeds)
    judged = max(change.pairs for change in comparison.changes.values())
    told = f" of the {judged} in which both walked to the end" if judged < n else ""
    return (
        f"Means over {n} seeds ({seeds[0]} to {seeds[-1]}){told}, both controls on each; 95 % intervals of the mean change."
        if n > 1
        else ""
    )


def _shown(name: str, value: float | None) -> str:
    return number(value, dust=DUST * FLOORS[name])


def number(value: float | None, *, dust: float = 0.0) -> str:
    """A value for people; smaller than `dust` is 0."""
    if value is not None and abs(value) < dust:
        return "0"
    return "-" if value is None or not math.isfinite(value) else f"{value:.4g}"


def _change(change: Change) -> str:
    """Relative, where the first value stands clear of the floor; of a single pair, if it means anything."""
    told = math.isfinite(change.relative) and (change.pairs > 1 or change.verdict != SAME)
    return f"{change.relative:+.1%}" if told else ""


def _interval(change: Change) -> str:
    low, high = change.interval
    return f"{low:+.1%} .. {high:+.1%}" if math.isfinite(low) else ""
