"""Writes the tables of README.md and docs/ that compare controls: `make figures`.

usage: python -m benchmarks.course.pages [FOLDER]

The folder is that of `hexapod benchmark`, out/benchmark; the other tables' walks are run here.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path

from benchmarks import ROOT
from hexapod_cosim.cosim.common.files import write_text
from hexapod_cosim.cosim.results.side_by_side import Comparisons, compare_all
from hexapod_cosim.cosim.run.batch import run_batch
from hexapod_cosim.cosim.scenario.controls import parse_controls
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.cosim.scenario.variation import STANDARD
from hexapod_cosim.extensions.course import texts
from hexapod_cosim.extensions.course.store import read_table
from hexapod_cosim.extensions.course.table import Table

PAGES = (
    *(ROOT / "docs" / name for name in ("comparison.md", "control.md")),
    ROOT / "extensions" / "course" / "README.md",
)
SEEDS = range(10)
WALKED = ("kinematic", "paper", "compliant")
OWN = [f"{name}={name}@own" for name in WALKED]
CHOSEN = [f"{name}@chosen" for name in WALKED]
TWIN = "compliant against kinematic@chosen"
# metric -> its row, and factor and unit of its values
ROWS = {
    "foot_error_stance": ("feet from their plan in stance, RMS", 1e3, "mm"),
    "foot_error_swing": ("feet from their plan in swing, RMS", 1e3, "mm"),
    "height_rms": ("height RMS", 1e3, "mm"),
    "roll_rms": ("roll RMS", 1e3, "mrad"),
    "pitch_rms": ("pitch RMS", 1e3, "mrad"),
    "loading_rate": ("loading rate at touch-down", 1.0, "BW/s"),
    "peak_force": ("peak normal force", 1.0, "BW"),
    "torque_rms": ("torque RMS", 1.0, "N m"),
    "cost_of_transport": ("cost of transport, mechanical", 1.0, ""),
    "electrical_cost": ("electrical cost, with copper loss", 1.0, ""),
    "servo_load_max": ("hottest servo, torque RMS of its rating", 1.0, ""),
    "path_error": ("path error", 1e3, "mm/m"),
    "slip_per_metre": ("slip per metre", 1e3, "mm/m"),
}
DETAILS = ("foot_error_swing", "height_rms", "pitch_rms")
BEGIN, END = "<!-- control:{} -->", "<!-- /control:{} -->"  # of a table's place on a page


def compared(scenario: str, controls: Sequence[str], *settings: str) -> Comparisons:
    """Returns the comparison of controls over SEEDS, in a scenario without its gait."""
    plan = replace(load_scenario(scenario, overrides=settings), variation=STANDARD)
    named = {key: value for key, value in plan.settings.items() if key != "gait"}
    found = parse_controls(controls, where="benchmarks.course.pages")
    plans = [
        replace(plan, settings=named, control=control.text, seed=seed)
        for control in found
        for seed in SEEDS
    ]
    with closing(run_batch(plans, compiled=True)) as runs:
        done = list(runs)
    count = len(SEEDS)
    return compare_all(
        {control.label: done[k * count : (k + 1) * count] for k, control in enumerate(found)}
    )


def metrics_table(comparison: Comparisons, *, brief: bool = False) -> str:
    """Returns a row for each metric: means, and in brackets the change from the reference.

    brief: without the metrics of DETAILS.
    """
    pairs = {pair.labels[1]: pair for pair in comparison.pairs}
    rows = [["walked to the end", *(f"{n} of {len(SEEDS)}" for n in comparison.walked.values())]]
    for name, (title, scale, unit) in ROWS.items():
        if brief and name in DETAILS:
            continue
        cells = [title]
        for label, means in comparison.means.items():
            shown = f"{scale * means[name]:.3g} {unit}".strip()
            change = pairs[label].changes[name].relative if label in pairs else math.nan
            cells.append(f"{shown} ({100.0 * change:+.0f} %)" if math.isfinite(change) else shown)
        rows.append(cells)
    return markdown(["", *comparison.labels], rows)


def course_tables(table: Table) -> Mapping[str, str]:
    """Returns the tables of a course by their names."""
    headings, rows = texts.class_rows(table)
    keep = [k for k, heading in enumerate(headings) if heading not in ("control", "against")]
    chosen = [row for row in rows if tuple(row[1:3]) == table.columns[TWIN]]
    return {
        "all": markdown(headings[1:], [row[1:] for row in rows if row[0] == "all"]),
        "compliant": markdown(
            [headings[k] for k in keep], [[row[k] for k in keep] for row in chosen]
        ),
        "heights": markdown(*texts.sweep_rows(table)),
    }


def markdown(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Returns a table in Markdown."""
    lines = [headings, ["---"] * len(headings), *rows]
    return "\n".join(
        "| " + " | ".join(text.replace("|", "/") for text in line) + " |" for line in lines
    )


def put_into(pages: Sequence[Path], tables: Mapping[str, str]) -> None:
    """Replaces the text between the markers of each table, on the page that has them.

    Raises ValueError for a table without a place, before a page is changed.
    """
    texts = {page: page.read_text(encoding="utf-8") for page in pages}
    for name, table in tables.items():
        begin, end = BEGIN.format(name), END.format(name)
        page = next((page for page, text in texts.items() if begin in text), None)
        if page is None or end not in texts[page]:
            raise ValueError(f"no page has a place {begin} ... {end}; looked in {pages}")
        head, _, rest = texts[page].partition(begin)
        texts[page] = f"{head}{begin}\n\n{table}\n\n{end}{rest.partition(end)[2]}"
    for page, text in texts.items():
        write_text(page, text)


def main(arguments: Sequence[str] | None = None) -> int:
    """Writes the tables into the pages."""
    folder = Path(*(arguments or sys.argv[1:] or ["out/benchmark"]))
    table, _ = read_table(folder)
    tables = dict(course_tables(table))
    for law in ("tanh", "bristle"):
        flat = compared("walk_flat", [*OWN, *CHOSEN], f"friction.law={law}")
        tables[f"flat {law}"] = metrics_table(flat)
    put_into(PAGES, tables)
    demo = compared("demo_course", [*OWN, CHOSEN[0], CHOSEN[-1]])
    put_into((ROOT / "README.md",), {"demo": metrics_table(demo, brief=True)})
    return 0


if __name__ == "__main__":
    sys.exit(main())
