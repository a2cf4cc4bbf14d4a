"""Runs the cases of the comparison, prints the tables and writes them to docs and CSV files.

usage: python -m benchmarks.control [--quick] [--only SECTION] [--tuning]
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.progress import Progress

from benchmarks import BUILD, ROOT
from benchmarks.control.cases import (
    DATA,
    ablation,
    grid,
    robustness,
    seeds,
    sticking,
    tuning,
)
from benchmarks.control.measure import Measured, Section, measure
from benchmarks.control.tables import changes_table, put_into, refused, robustness_table, write_csv
from hexapod_cosim.models import HexapodError

PAGES = tuple(ROOT / "docs" / "control" / name for name in ("parts.md", "results.md"))
RESULTS = ROOT / "benchmarks" / "results" / "control"
QUICK_SEEDS, QUICK_CYCLES = 2, 3.0  # the smallest numbers that give metrics
QUICK_CASES = 8  # every n-th case of a section, counted from the last


def sections() -> list[Section]:
    """Returns the sections of the pages, one for each table."""
    judged = seeds("judged")
    grids = [
        Section(name=f"grid {robot}", cases=grid(robot), seeds=judged)
        for robot in DATA["judged"]["robots"]
    ]
    return [
        Section(name="ablation", cases=ablation(), seeds=judged), *grids,
        Section(name="sticking", cases=sticking(), seeds=judged),
        Section(name="robustness", cases=robustness(), seeds=seeds("robustness")),
    ]  # fmt: skip


def tuning_sections() -> list[Section]:
    """Returns the sections that may be used for tuning."""
    return [
        Section(name=f"tuning {robot}", cases=tuning(robot), seeds=seeds("tuning"))
        for robot in DATA["tuning"]["robots"]
    ]


def quick(chosen: Sequence[Section]) -> list[Section]:
    """Returns the sections with a few cases and seeds."""
    return [
        Section(
            name=one.name,
            cases=list(one.cases)[::-QUICK_CASES][::-1],
            seeds=one.seeds[:QUICK_SEEDS],
        )
        for one in chosen
    ]


def tables(measured: Measured) -> dict[str, str]:
    """Returns the tables in Markdown by section."""
    return {
        name: (robustness_table if name == "robustness" else changes_table)(cases)
        for name, cases in measured.items()
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Makes all tables in some five minutes on two processors.

    With --quick it takes a minute and writes into build/bench instead of docs and results.
    """
    parser = argparse.ArgumentParser(prog="python -m benchmarks.control", description=main.__doc__)
    parser.add_argument(
        "--quick",
        action="store_true",
        help="few cases and seeds, short walks; docs and results stay as they are",
    )
    parser.add_argument(
        "--only", metavar="SECTION", help="one table: " + ", ".join(one.name for one in sections())
    )
    parser.add_argument(
        "--tuning",
        action="store_true",
        help="the cases that gains may be tuned on; docs and results stay as they are",
    )
    given = parser.parse_args(arguments)
    offered = tuning_sections() if given.tuning else sections()
    chosen = [one for one in offered if given.only in {None, one.name}]
    if not chosen:
        parser.error(
            f"no section {given.only!r}: choose one of " + ", ".join(one.name for one in offered)
        )
    try:
        measured = walked(
            quick(chosen) if given.quick else chosen, QUICK_CYCLES if given.quick else None
        )
        expect_walks(measured)
        kept = write(measured, pages=() if given.quick or given.tuning else PAGES)
    except HexapodError as error:
        print(f"benchmarks.control: {error}", file=sys.stderr)
        return 1
    print("\n\n".join(f"{name}\n\n{table}" for name, table in tables(measured).items()))
    print(f"\nwritten to {kept}")
    return 0


def expect_walks(measured: Measured) -> None:
    """Raises HexapodError when a whole table would be empty."""
    for name, cases in measured.items():
        if all(map(refused, cases.values())):
            reason = next(run.reason for case in cases.values() for run in case.first)
            raise HexapodError(
                "no case of this table could be walked",
                got=reason,
                fix="fix that first; nothing was written",
                where=name,
            )


def walked(chosen: Sequence[Section], cycles: float | None) -> Measured:
    """Measures with a progress bar on stderr."""
    with Progress(console=Console(stderr=True)) as bar:
        task = bar.add_task("runs", total=None)
        return measure(
            chosen,
            cycles=cycles,
            progress=lambda done, total: bar.update(task, completed=done, total=total),
        )


def write(measured: Measured, *, pages: Sequence[Path]) -> Path:
    """Writes CSV files, and the tables into the pages if given; returns the folder of the CSV
    files.
    """
    folder = RESULTS if pages else BUILD / "control"
    folder.mkdir(parents=True, exist_ok=True)
    for name, cases in measured.items():
        write_csv(folder / f"{name.replace(' ', '_')}.csv", cases)
    if pages:
        put_into(pages, tables(measured))
    return folder


if __name__ == "__main__":
    sys.exit(main())
