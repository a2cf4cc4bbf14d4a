"""The report of a run or a comparison: one static HTML file with everything in it."""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from hexapod_cosim.cosim.files import write_text
from hexapod_cosim.cosim.metrics import METRICS
from hexapod_cosim.cosim.results import Stored

REPORT, PLOTS = "report.html", "plots"
BETTER, WORSE, SAME = "better", "worse", ""
LEAST_CHANGE = 0.005  # less is neither better nor worse


def write_report(runs: Mapping[str, Stored], folder: Path) -> list[Path]:
    """Draws the figures and writes report.html for runs by control. Returns the files, the report last."""
    from hexapod_cosim.cosim.plots import FIGURES, save_figures  # noqa: PLC0415  matplotlib is slow to import

    files = save_figures({label: run.view for label, run in runs.items()}, folder / PLOTS)
    environment = Environment(loader=PackageLoader("hexapod_cosim.cosim", "report"), autoescape=True, undefined=StrictUndefined)
    first = next(iter(runs.values()))
    figures = [(title, _embedded(folder / PLOTS / f"{name}.svg")) for name, (title, _) in FIGURES.items()]
    rows = metric_rows({label: run.metrics for label, run in runs.items()})
    facts = {label: run.facts for label, run in runs.items()}
    page = environment.get_template("report.html.jinja").render(
        title=first.facts["title"], labels=list(runs), rows=rows, figures=figures, scenario=first.scenario, facts=facts
    )
    write_text(folder / REPORT, page)
    return [*files, folder / REPORT]


def _embedded(svg: Path) -> str:
    return "data:image/svg+xml;base64," + base64.b64encode(svg.read_bytes()).decode("ascii")


def metric_rows(metrics: Mapping[str, Mapping[str, float | None]]) -> list[dict[str, Any]]:
    """A row per metric: name, unit, meaning, values by control as text, and the change from the first control to the last."""
    rows: list[dict[str, Any]] = []
    for name, (unit, less_is_better, meaning) in METRICS.items():
        values = [run.get(name) for run in metrics.values()]
        change, verdict = _change(values, less_is_better) if len(values) > 1 else ("", SAME)
        row = {
            "name": name,
            "unit": unit,
            "meaning": meaning,
            "values": [number(value) for value in values],
            "change": change,
            "verdict": verdict,
        }
        rows.append(row)
    return rows


def number(value: float | None) -> str:
    """A value for people."""
    return "-" if value is None or not math.isfinite(value) else f"{value:.4g}"


def _change(values: list[float | None], less_is_better: bool | None) -> tuple[str, str]:
    before, after = values[0], values[-1]
    if before is None or after is None or not math.isfinite(before) or not math.isfinite(after) or before == 0.0:
        return "", SAME
    change = (after - before) / abs(before)
    if less_is_better is None or abs(change) < LEAST_CHANGE:
        return f"{change:+.1%}", SAME
    return f"{change:+.1%}", BETTER if (change < 0.0) == less_is_better else WORSE
