"""Writes the measurements as Markdown between the markers of pages in docs/control, and as CSV."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from hexapod_cosim.cosim.common.files import atomic_text, write_text
from hexapod_cosim.cosim.results.comparison import SAME, Change, Comparison
from hexapod_cosim.cosim.results.metrics import METRICS
from hexapod_cosim.cosim.results.summary import REFUSED
from hexapod_cosim.models import HexapodError

# metric -> heading of its column
COLUMNS = {
    "slip_per_metre": "slip",
    "foot_error_stance": "feet, stance",
    "peak_force": "peak force",
    "loading_rate": "loading rate",
    "path_error": "path error",
    "yaw_drift": "yaw drift",
    "height_rms": "height",
    "roll_rms": "roll",
    "pitch_rms": "pitch",
    "cost_of_transport": "cost",
    "electrical_cost": "electrical cost",
    "servo_load_max": "hottest servo",
}
# metric -> heading, and factor to its unit
PLAIN = {
    "slip_per_metre": ("slip [mm/m]", 1e3),
    "height_rms": ("height [mm]", 1e3),
    "roll_rms": ("roll [mrad]", 1e3),
    "pitch_rms": ("pitch [mrad]", 1e3),
    "path_error": ("path error [mm/m]", 1e3),
    "peak_force": ("peak force [BW]", 1.0),
}
BEGIN, END = "<!-- control:{} -->", "<!-- /control:{} -->"
LEGEND = (
    "Changes from kinematic to compliant, means over {} seeds;"
    " ± half a 95 % interval where it shows; ≈ not sure, or too small to measure."
)

Cases = Mapping[str, Comparison]  # by name


def changes_table(cases: Cases) -> str:
    """Returns a row for each case: completed runs under each control, and changes of all
    metrics.
    """
    rows = [
        [name, _walked(item), *(cell(key, item.changes[key]) for key in COLUMNS)]
        for name, item in cases.items()
        if not refused(item)
    ]
    return "\n\n".join(
        filter(
            None,
            [
                markdown(["case", "walked", *COLUMNS.values()], rows),
                _legend(cases),
                _left_out(cases),
            ],
        )
    )


def robustness_table(cases: Cases) -> str:
    """Returns a row for each case: completed runs, some metrics under each control, and
    fallback.
    """
    headings = ["case", "walked", *(text for text, _ in PLAIN.values()), "fallback"]
    rows = [
        [name, _walked(item), *_plain(item), _fallback(item)]
        for name, item in cases.items()
        if not refused(item)
    ]
    note = (
        "Kinematic → compliant, means over {} seeds."
        " Fallback: share of the time in which a leg walked without feedback."
    )
    return "\n\n".join(
        filter(None, [markdown(headings, rows), _legend(cases, note), _left_out(cases)])
    )


def refused(comparison: Comparison) -> bool:
    """Returns whether all runs of a control were refused."""
    return any(
        all(run.status == REFUSED for run in runs) for runs in (comparison.first, comparison.second)
    )


def cell(name: str, change: Change) -> str:
    """Formats a change: relative where that is defined, else the value under compliant control."""
    if not change.pairs:
        return "-"
    if not math.isfinite(change.relative):
        return "≈ 0" if change.verdict == SAME else f"{change.after:.2g} {METRICS[name][0]}"
    low, high = change.interval
    percent, width = 100.0 * change.relative, 50.0 * (high - low)
    shown = f" ± {width:.{int(width < 10.0)}f}" if math.isfinite(width) and width >= 1.0 else ""
    return ("≈ " if change.verdict == SAME else "") + f"{round(percent):+d}{shown} %"


def _walked(comparison: Comparison) -> str:
    first, second = comparison.walked.values()
    return f"{first} → {second} of {len(comparison.seeds)}"


def _plain(comparison: Comparison) -> list[str]:
    changes = [(comparison.changes[name], scale) for name, (_, scale) in PLAIN.items()]
    return [
        f"{_figure(scale * change.before)} → {_figure(scale * change.after)}"
        if change.pairs
        else "-"
        for change, scale in changes
    ]


def _figure(value: float) -> str:
    return f"{value:.0f}" if value >= 1000.0 else f"{value:.3g}"


def _fallback(comparison: Comparison) -> str:
    shares = [run.fallback for run in comparison.second if run.fallback is not None]
    return f"{sum(shares) / len(shares):.0%}" if shares else "-"


def _legend(cases: Cases, text: str = LEGEND) -> str:
    return text.format(max((len(item.seeds) for item in cases.values()), default=0))


def _left_out(cases: Cases) -> str:
    """Lists the refused cases with the reason."""
    lost = {
        name: next(run.reason for run in (*item.first, *item.second) if run.reason)
        for name, item in cases.items()
        if refused(item)
    }
    return "\n".join(f"- Left out: {name}. {reason}" for name, reason in lost.items())


def markdown(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [headings, ["---"] * len(headings), *rows]
    return "\n".join(
        "| " + " | ".join(text.replace("|", "/") for text in line) + " |" for line in lines
    )


def put_into(pages: Sequence[Path], tables: Mapping[str, str]) -> None:
    """Replaces what stands between the markers of each table, on the page that has them; the rest
    of the pages stays. Raises HexapodError for a missing marker; then no page is changed.
    """
    texts = {page: page.read_text(encoding="utf-8") for page in pages}
    for name, table in tables.items():
        begin, end = BEGIN.format(name), END.format(name)
        page = next((page for page, text in texts.items() if begin in text), pages[0])
        head, found, rest = texts[page].partition(begin)
        _, closed, tail = rest.partition(end)
        if not found or not closed:
            missing = end if found else begin
            raise HexapodError(
                "the pages have no place for a table",
                expected=f"a line {missing}",
                fix="add it",
                where=str(page) if found else ", ".join(map(str, pages)),
            )
        texts[page] = f"{head}{begin}\n\n{table}\n\n{end}{tail}"
    for page, text in texts.items():
        write_text(page, text)


def write_csv(path: Path, cases: Cases) -> None:
    """A line per case and metric: means, the change with its interval, and how many runs walked."""
    rows = [row for name, comparison in cases.items() for row in _records(name, comparison)]
    with atomic_text(path) as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows({key: _rounded(value) for key, value in row.items()} for row in rows)


def _records(case: str, comparison: Comparison) -> Iterable[dict[str, Any]]:
    first, second = comparison.labels
    walked = {f"walked_{label}": number for label, number in comparison.walked.items()}
    for name, change in comparison.changes.items():
        if (
            METRICS[name][1] is not None
        ):  # what the machine's load decides is no figure of the control
            means = {first: change.before, second: change.after}
            yield (
                {"case": case, "seeds": len(comparison.seeds)}
                | walked
                | {"metric": name}
                | means
                | change.as_table()
            )


def _rounded(value: Any) -> Any:
    return ("" if math.isnan(value) else f"{value:.6g}") if isinstance(value, float) else value
