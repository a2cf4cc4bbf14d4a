"""Defines the command `hexapod report`, which makes a report again."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from hexapod_cosim.cosim.cli.options import Json


def report(
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="DIR", help="A folder written by `hexapod simulate`, `compare` or `study`."
        ),
    ],
    json: Json = False,
) -> None:
    """Make the plots and the report of a run, a comparison, a study or a benchmark again."""
    from hexapod_cosim.cosim.cli.terminal import show_files, show_json
    from hexapod_cosim.cosim.report.writing import REPORT
    from hexapod_cosim.cosim.results.folder import damage_reported, read_facts

    facts = read_facts(folder)
    with damage_reported(folder):
        files = _report_again(folder, facts)
    if json:
        show_json({"report": str(folder / REPORT), "files": [str(file) for file in files]})
    else:
        show_files(files)


def _report_again(folder: Path, facts: Mapping[str, Any]) -> list[Path]:
    """Writes the report of a folder again; `facts` are those of its run.json."""
    from hexapod_cosim.cosim.cli.extension import loaded, report_functions
    from hexapod_cosim.cosim.cli.terminal import warn
    from hexapod_cosim.cosim.report.writing import write_report
    from hexapod_cosim.cosim.results.folder import read_result
    from hexapod_cosim.models import HexapodError

    kind, reports = facts.get("kind"), report_functions()
    if kind in reports:
        return list(loaded(reports[kind])(folder))
    if kind == "compare":
        return _report_comparison(folder, facts)
    if kind not in ("simulate", None):  # None: a run that has not ended
        raise HexapodError(
            "not a run, whose report can be made again",
            got=f"a folder of `hexapod {kind}`",
            expected=", ".join(["simulate", "compare", *reports]),
            fix=f"run it again: {facts.get('command', '')}",
            where=str(folder),
        )
    run = read_result(folder)
    control = run.facts.control
    accuracies = {control: run.accuracy} if run.accuracy else {}
    return write_report({control: run}, folder, warn=warn, accuracies=accuracies)


def _report_comparison(folder: Path, facts: Mapping[str, Any]) -> list[Path]:
    """Writes the report of a comparison's folder again; `facts` are those of its run.json."""
    from hexapod_cosim.cosim.cli.terminal import warn
    from hexapod_cosim.cosim.common.files import PARTS
    from hexapod_cosim.cosim.report.writing import write_report
    from hexapod_cosim.cosim.results.comparison import SEEDS, read_seeds
    from hexapod_cosim.cosim.results.folder import read_accuracies, read_result, read_scenario
    from hexapod_cosim.cosim.results.uncertainty import WALKS, compare_all

    seeds, labels = read_seeds(folder / SEEDS), facts[PARTS]
    return write_report(
        {label: read_result(folder / label) for label in labels},
        folder,
        warn=warn,
        comparison=compare_all({label: seeds.get(label, []) for label in (*labels, *seeds)}),
        scenario=read_scenario(folder),
        command=facts["command"],
        walks=facts[WALKS],
        accuracies=read_accuracies(folder),
    )
