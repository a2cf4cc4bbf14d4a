"""Defines the short commands: report, validate, terrain, examples and controller new."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from hexapod_cosim.cosim.cli import completion
from hexapod_cosim.cosim.cli.options import Json, RobotName
from hexapod_cosim.cosim.cli.terminal import show_files, show_json, show_text, warn
from hexapod_cosim.models.errors import HexapodError

app = typer.Typer(
    no_args_is_help=True, rich_markup_mode=None, help="Write a controller of your own."
)
PACKAGE = Path(__file__).resolve().parents[2]
UNWANTED = shutil.ignore_patterns("__pycache__", ".*")


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


def validate(
    fmu: Annotated[Path, typer.Argument(metavar="FILE.fmu", help="The FMU to check.")],
    json: Json = False,
) -> None:
    """Check an FMU of ours and say what is wrong."""
    from hexapod_cosim.cosim.export.validation import UnsoundFmuError, find_problems

    problems = find_problems(fmu)
    if problems:
        if not json:
            print("\n".join(problems))
        raise UnsoundFmuError(fmu, problems)
    if json:
        show_json({"fmu": str(fmu), "valid": True, "problems": []})
    else:
        print(f"{fmu}: no problems found")


def terrain(
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME",
            help="A surface of `hexapod list terrains`.",
            autocompletion=completion.surface,
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE", help="Draw the surface as PNG or SVG."),
    ] = None,
    values: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="KEY=VALUE", help="Set a parameter of the surface: step_height=30mm."
        ),
    ] = None,
    robot: RobotName = "athena",
    json: Json = False,
) -> None:
    """Show a surface: its size and parameters, and its picture beside a robot."""
    from hexapod_cosim.cosim.cli.terrains import show_terrain, surface_from

    show_terrain(surface_from(name, values or []), robot=robot, picture=output, as_json=json)


def examples(
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="New folder for the examples.")
    ] = Path("hexapod-examples"),
    json: Json = False,
) -> None:
    """Copy the example programs and notebooks into a folder, to run and to change."""
    files = copy_examples(output)
    if json:
        show_json({"files": [str(file) for file in files]})
    else:
        show_files(files)


def copy_examples(folder: Path) -> list[Path]:
    """Copies programs and controllers into a folder, and notebooks into its folder notebooks.

    Returns the copied files, sorted. Raises HexapodError when the folder exists and is not empty,
    or cannot be written.
    """
    from hexapod_cosim.cosim.common.files import writing_into
    from hexapod_cosim.cosim.common.plant_files import in_source_tree

    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise HexapodError(
            "the examples need a folder of their own",
            got=f"{folder}, which exists",
            expected="a new or an empty folder",
            fix="choose another one with -o",
        )
    notebooks = PACKAGE / ("docs/notebooks" if in_source_tree() else "notebooks")
    with writing_into(folder):
        shutil.copytree(PACKAGE / "examples", folder, dirs_exist_ok=True, ignore=UNWANTED)
        shutil.copytree(notebooks, folder / "notebooks", ignore=UNWANTED)
    return sorted(path for path in folder.rglob("*") if path.is_file())


@app.callback()
def controller() -> None:
    """Write a controller of your own."""


@app.command("new")
def new(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the controller: my_walk.")],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Folder; default this one.")
    ] = Path(),
    json: Json = False,
) -> None:
    """Write NAME.py, a controller that walks, its test, and a line of README.md."""
    from hexapod_cosim.cosim.control.new_law import class_name, write_law

    files = write_law(name, output)
    if json:
        show_json({"class": class_name(name), "files": [str(file) for file in files]})
        return
    show_files(files)
    show_text(f"hexapod simulate walk_flat --control {files[0]}:{class_name(name)}")
