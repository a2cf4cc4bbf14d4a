"""The report of a run or a comparison: one static HTML file with everything in it."""

from __future__ import annotations

import base64
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from hexapod_cosim.cosim.files import write_text
from hexapod_cosim.cosim.metrics import DUST, FLOORS, METRICS
from hexapod_cosim.cosim.results import Stored
from hexapod_cosim.cosim.toml_text import to_toml

REPORT, PLOTS = "report.html", "plots"
BETTER, WORSE, SAME = "better", "worse", "same"
LEAST_CHANGE = 0.005  # less is neither better nor worse


def write_report(
    runs: Mapping[str, Stored], folder: Path, *, tell: Callable[[str], None], scenario: str | None = None, command: str | None = None
) -> list[Path]:
    """Draws the figures and writes report.html for runs by control. Returns the files, the report last.

    `tell` hears what could not be drawn; `scenario` (TOML) and `command` made a comparison, a single run has its own.
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
    rows = metric_rows({label: run.metrics for label, run in runs.items()})
    facts = {label: run.facts for label, run in runs.items()}
    page = environment.get_template("report.html.jinja").render(
        title=first.facts["title"], labels=list(runs), rows=rows, figures=figures, facts=facts, missing=missing,
        scenario=first.scenario if scenario is None else scenario, command=first.facts.get("command", "") if command is None else command,
        gains={label: to_toml(run.facts["gains"]) for label, run in runs.items() if run.facts.get("gains")},
    )  # fmt: skip
    write_text(folder / REPORT, page)
    return [*files, folder / REPORT]


def _embedded(svg: Path) -> str:
    return "data:image/svg+xml;base64," + base64.b64encode(svg.read_bytes()).decode("ascii")


def metric_rows(metrics: Mapping[str, Mapping[str, float | None]]) -> list[dict[str, Any]]:
    """A row per metric: name, unit, meaning, values by control as text, and the change from the first control to the last."""
    rows: list[dict[str, Any]] = []
    for name, (unit, less_is_better, meaning) in METRICS.items():
        values = [run.get(name) for run in metrics.values()]
        change, verdict = _change(values, less_is_better, FLOORS[name]) if len(values) > 1 else ("", "")
        row = {
            "name": name,
            "unit": unit,
            "meaning": meaning,
            "values": [number(value, dust=DUST * FLOORS[name]) for value in values],
            "change": change,
            "verdict": verdict,
        }
        rows.append(row)
    return rows


def number(value: float | None, *, dust: float = 0.0) -> str:
    """A value for people; smaller than `dust` is 0."""
    if value is not None and abs(value) < dust:
        return "0"
    return "-" if value is None or not math.isfinite(value) else f"{value:.4g}"


def _change(values: list[float | None], less_is_better: bool | None, floor: float) -> tuple[str, str]:
    """Relative change where both values stand clear of the floor, and what it means."""
    before, after = values[0], values[-1]
    if before is None or after is None or not math.isfinite(before) or not math.isfinite(after):
        return "", ""
    change = after - before
    shown = f"{change / abs(before):+.1%}" if abs(before) > floor else ""
    if less_is_better is None:
        return shown, ""
    if abs(change) < max(floor, LEAST_CHANGE * abs(before)):
        return "", SAME
    return shown, BETTER if (change < 0.0) == less_is_better else WORSE
