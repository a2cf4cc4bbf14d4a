"""Defines the command `hexapod report`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from hexapod_cosim.cosim.cli.options import Json
from hexapod_cosim.cosim.cli.terminal import show_files, show_json, warn
from hexapod_cosim.models.errors import HexapodError


def report(
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="DIR", help="A folder that a command of `hexapod` wrote, such as compare."
        ),
    ],
    json: Json = False,
) -> None:
    """Make the report of a folder of results again, with figures as PNG too."""
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
    from hexapod_cosim.cosim.report.writing import ALL_FORMATS, write_report
    from hexapod_cosim.cosim.results.folder import read_result

    kind, reports = facts.get("kind"), report_functions()
    if kind in reports:
        return list(loaded(reports[kind])(folder))
    if kind == "compare":
        return _report_comparison(folder, facts)
    if kind not in ("simulate", None):  # None: a run that has not ended
        raise HexapodError(
            "no installed command writes this report again",
            got=f"a folder of `hexapod {kind}`",
            expected=f"one of {', '.join(['simulate', 'compare', *reports])}",
            fix="run it again, or install the extension that wrote it",
            where=str(folder),
        )
    run = read_result(folder)
    control = run.facts.control
    accuracies = {control: run.accuracy} if run.accuracy else {}
    return write_report(
        {control: run}, folder, warn=warn, accuracies=accuracies, formats=ALL_FORMATS
    )


def _report_comparison(folder: Path, facts: Mapping[str, Any]) -> list[Path]:
    """Writes the report of a comparison's folder again; `facts` are those of its run.json."""
    from hexapod_cosim.cosim.common.files import PARTS
    from hexapod_cosim.cosim.report.writing import ALL_FORMATS, write_report
    from hexapod_cosim.cosim.results.folder import read_accuracies, read_result, read_scenario
    from hexapod_cosim.cosim.results.side_by_side import SEEDS, WALKS, compare_all, read_seeds

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
        formats=ALL_FORMATS,
    )
