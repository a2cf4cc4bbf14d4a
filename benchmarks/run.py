"""Runs all benchmarks of speed and accuracy: `python -m benchmarks.run [--quick]`.

Builds the drivers, measures, prints the table, and writes CSV files and the figure into
benchmarks/results/<machine>/.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import os
import platform
import subprocess
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import track
from rich.table import Table

from benchmarks import BUILD, RESULTS, machine
from benchmarks.figure import draw
from benchmarks.judge import agreement, spreads
from benchmarks.loop import compiled_factors, realtime_factor
from benchmarks.measure import Bench, Run
from benchmarks.parts import (
    cost_of,
    crowding,
    derivatives,
    instances,
    instructions,
    instructions_per_step,
    resident_bytes,
)
from benchmarks.series import OURS, PLANT_LAW, Series, command, ours, peers
from benchmarks.studies import measured_studies
from benchmarks.table import Parts, Row, chosen_setting, goals, rows
from benchmarks.toolchain import REQUIREMENTS, Tools, prepare
from benchmarks.walks import STIFF_RUBBER, STIFF_SLOPE, Case, family, stiff, write

QUICK_WALKS = 5  # every n-th walk; odd, so that both robots are included
QUICK_SETTINGS = 2  # every n-th setting
STEEP = {
    f"friction slope {STIFF_SLOPE:g} s/m": {"slope": STIFF_SLOPE},
    f"rubber of {STIFF_RUBBER:g} N/m^1.5": {"stiffness": STIFF_RUBBER},
}
DERIVATIVE_WALKS = 4
MET = {True: "[green]yes[/green]", False: "[red]no[/red]", None: ""}  # goals

console = Console(width=180)


def main() -> None:
    """Runs everything in about a quarter of an hour.

    With --quick it takes a minute or two and writes into build/bench instead of the results.
    """
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument(
        "--quick",
        action="store_true",
        help="few walks and settings, no peer that takes long to build",
    )
    quick = parser.parse_args().quick
    tools = prepare(quick=quick)
    folder = BUILD / "quick" if quick else RESULTS / machine()
    folder.mkdir(parents=True, exist_ok=True)
    series = [
        *_chosen(ours(), quick),
        *_chosen([one for one in peers() if command(one.engine, tools)], quick),
    ]
    walks = family()[:: QUICK_WALKS if quick else 1]
    files = {walk.name: write(walk) for walk in walks}
    bench = Bench(tools, files | _steep_files(walks))
    runs = measured(bench, series, [walk.name for walk in walks])
    worked = {run.engine for run in runs if math.isfinite(run.seconds)}
    tools.missing.update({one: bench.errors[one] for one in bench.errors if one not in worked})
    facts = json.dumps(described(tools), indent=2)
    (folder / "machine.json").write_text(f"{facts}\n", encoding="utf-8")
    _write_walks(folder, runs, series)
    parts, scaling = measured_parts(bench, series, runs, walks, quick=quick)
    table = rows(runs, series, parts)
    _write_csv(folder / "table.csv", [asdict(row) | {"met": row.met} for row in table])
    _write_csv(folder / "instances.csv", scaling)
    _print_results(runs, series, table, tools, folder)
    if quick:
        console.print(
            'quick: few walks, settings and peers; "the best of them" is the best of these only'
        )


def _chosen(series: Sequence[Series], quick: bool) -> list[Series]:
    if not quick:
        return list(series)
    return [replace(one, settings=one.settings[::QUICK_SETTINGS]) for one in series if one.quick]


def _steep_files(walks: Iterable[Case]) -> dict[str, Path]:
    changed = [stiff(walk, **change) for walk in walks for change in STEEP.values()]
    return {walk.name: write(walk) for walk in changed}


def measured(bench: Bench, series: Sequence[Series], walks: Sequence[str]) -> list[Run]:
    """Runs every method at every setting on every walk.

    Engines alternate, so that the noise of the machine affects all of them.
    """
    turns = max(len(one.settings) for one in series)
    return [
        bench.run(one, one.settings[k], walk)
        for place, walk in enumerate(track(walks, description="walks", console=console))
        for k in range(turns)
        for one in series
        if k < len(one.settings) and place % one.every == 0
    ]


def measured_parts(
    bench: Bench,
    series: Sequence[Series],
    runs: Sequence[Run],
    walks: Sequence[Case],
    *,
    quick: bool,
) -> tuple[Parts, list[dict[str, Any]]]:
    """Measures the parts other than walks, and the cost by number of instances."""
    files = [bench.walks[walk.name] for walk in walks]
    kernels = derivatives(bench.tools, files[:DERIVATIVE_WALKS])
    scaling = instances(bench.tools, files[0])
    chosen = chosen_setting(runs, series)
    steep, per_step = {}, math.nan
    if chosen:
        setting = chosen.spread.setting
        for name, change in STEEP.items():
            pairs = [(stiff(walk, **change).name, walk.name) for walk in walks]
            steep[name] = cost_of(bench, chosen.series, setting, pairs)
        per_step = instructions_per_step(bench, chosen.series, setting, walks[0].name)
    parts = Parts(
        derivatives=kernels,
        steep=steep,
        loop={
            control: realtime_factor(bench.tools, control) for control in ("kinematic", "compliant")
        },
        compiled=compiled_factors(bench.tools),
        crowd=crowding(scaling),
        studies=measured_studies(quick=quick),
        structure=scaling[0]["bytes_per_instance"],
        resident=resident_bytes(scaling),
        allocations=sum(one["allocations"] for one in scaling),
        instructions=instructions(bench.tools, files[0], list(kernels)),
        walk_instructions=per_step,
    )
    return parts, scaling


def _write_walks(folder: Path, runs: Sequence[Run], series: Sequence[Series]) -> None:
    _write_csv(
        folder / "walks.csv",
        [asdict(run) | {"realtime_factor": run.realtime_factor} for run in runs],
    )
    settings = [
        {"engine": one.engine, "method": one.method, "law": one.law} | asdict(spread)
        for one in series
        for spread in spreads(runs, one)
    ]
    _write_csv(folder / "settings.csv", settings)
    draw(runs, series, folder)


def _write_csv(path: Path, records: Sequence[dict[str, Any]]) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(records[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(
            {
                key: f"{value:.6g}" if isinstance(value, float) else value
                for key, value in row.items()
            }
            for row in records
        )


def described(tools: Tools) -> dict[str, Any]:
    """Returns what the figures depend on: processor, compiler, versions of the peers."""
    compiler = subprocess.run(
        ["cc", "--version"], capture_output=True, text=True, check=False
    ).stdout.partition("\n")[0]
    wheels = [
        line for line in REQUIREMENTS.read_text(encoding="utf-8").splitlines() if "==" in line
    ]
    return {
        "processor": machine(),
        "processors": os.cpu_count(),
        "system": platform.platform(terse=True),
        "compiler": compiler,
        "python": platform.python_version(),
        "peers": wheels,
        "missing": tools.missing,
    }


def _print_results(
    runs: Sequence[Run], series: Sequence[Series], table: Sequence[Row], tools: Tools, folder: Path
) -> None:
    console.print(shown(table, title=f"{len({run.walk for run in runs})} walks on {machine()}"))
    console.print(shown(goals(table), title="goals"))
    for engine in dict.fromkeys(
        one.engine for one in series if one.engine != OURS and one.law == PLANT_LAW
    ):
        console.print(
            f"{engine} comes as close to our converged paths as {agreement(runs, engine):.1e} m"
            " (median over the walks)"
        )
    for peer, reason in tools.missing.items():
        console.print(f"{peer} is missing: {reason}", markup=False)
    console.print(f"written to {folder}")


def shown(found: Sequence[Row], *, title: str) -> Table:
    """Formats the table for a terminal."""
    table = Table(title=title)
    columns: tuple[tuple[str, Callable[[Row], str], Any], ...] = (
        ("figure", lambda row: f"{row.figure} [{row.unit}]".replace("[", "\\["), "left"),
        ("ours", lambda row: _number(row.ours), "right"),
        ("peer", lambda row: row.peer, "left"),
        ("theirs", lambda row: _number(row.theirs), "right"),
        ("ratio", lambda row: _number(row.ratio), "right"),
        ("goal", _goal, "right"),
        ("met", lambda row: MET[row.met], "left"),
    )
    for name, _, justify in columns:
        table.add_column(name, justify=justify, no_wrap=name != "figure")
    for row in found:
        table.add_row(*(text(row) for _, text, _ in columns))
    return table


def _goal(row: Row) -> str:
    if math.isnan(row.goal):
        return ""
    judged = "ratio" if row.judged == "ratio" else ""
    relation = "<=" if row.better == "less" else ">="
    return f"{judged} {relation} {_number(row.goal)}".strip()


def _number(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.0f}" if abs(value) >= 1000.0 else f"{value:.3g}"


if __name__ == "__main__":
    main()
