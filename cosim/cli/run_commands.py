"""Defines the commands `hexapod simulate` and `hexapod report`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import typer

from hexapod_cosim.cosim.cli.accuracy_check import CheckAccuracy, check_accuracy, show_accuracy
from hexapod_cosim.cosim.cli.extension import report_functions
from hexapod_cosim.cosim.cli.failures import FELL, SUCCESS
from hexapod_cosim.cosim.cli.running import (
    ControlNames,
    Engine,
    FmuFile,
    FolderName,
    Formats,
    GainsFile,
    Name,
    RunOptions,
    Settings,
    chosen_controls,
    command_line,
    default_folder,
    drawing,
    run_into,
    show_rows,
    titled,
    with_formats,
)
from hexapod_cosim.cosim.cli.terminal import Json, show_files, show_json, show_text, warn
from hexapod_cosim.cosim.common.files import PARTS
from hexapod_cosim.cosim.report.accuracy import with_errors
from hexapod_cosim.cosim.report.report import REPORT, metric_rows, write_report
from hexapod_cosim.cosim.results.accuracy import Accuracy, halved_scenario
from hexapod_cosim.cosim.results.comparison import SEEDS, read_seeds
from hexapod_cosim.cosim.results.comparisons import WALKS, compare_all
from hexapod_cosim.cosim.results.metrics import has_net_slip
from hexapod_cosim.cosim.results.result import Result
from hexapod_cosim.cosim.results.results import (
    ACCURACY,
    damage_reported,
    read_accuracies,
    read_facts,
    read_result,
    read_scenario,
    results_folder,
    stored_result,
    write_accuracy,
)
from hexapod_cosim.cosim.results.summary import summarise
from hexapod_cosim.cosim.scenario.controls import control_of
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.cosim.scenario.scenario import load_scenario
from hexapod_cosim.models import HexapodError

EPILOG = (
    f"Exit code {FELL} when the robot fell: what was recorded and measured is written all the same."
)


def simulate(
    scenario: Name = "walk_flat",
    control: ControlNames = None,
    settings: Settings = None,
    formats: Formats = None,
    output: FolderName = None,
    fmu: FmuFile = None,
    gains: GainsFile = None,
    accuracy: CheckAccuracy = False,
    engine: Engine = None,
    json: Json = False,
) -> int:
    """Run one co-simulation: results, metrics, plots. Several controls: a run of each."""
    settings = with_formats(settings, formats)
    plan = titled(load_scenario(scenario, overrides=settings), settings)
    controls = chosen_controls(control or [plan.control], plan)
    options = RunOptions.read(fmu=fmu, gains=gains, engine=engine, runs=1)
    if accuracy:
        halved_scenario(plan)  # raises errors before anything is run
    command = command_line(
        "simulate",
        scenario,
        controls=control,
        settings=settings,
        engine=engine,
        fmu=fmu,
        gains=gains,
        accuracy=accuracy,
    )
    folder, done = output or default_folder(scenario), {}
    for chosen in controls:
        place = folder
        if len(controls) > 1:
            place = folder / chosen.label
            folder.mkdir(parents=True, exist_ok=True)
        run = _Run(replace(plan, control=chosen.text), command, options, accuracy)
        done[chosen.label] = _simulate_one(run, place, quiet=json)
    if json:
        summaries = {label: one.summary for label, one in done.items()}
        show_json(summaries if len(done) > 1 else next(iter(summaries.values())))
    return SUCCESS if all(one.upright for one in done.values()) else FELL


@dataclass(frozen=True)
class _Run:
    """A run to simulate."""

    plan: Scenario
    command: str  # that repeats it
    options: RunOptions
    accuracy: bool  # whether it is checked


@dataclass(frozen=True)
class _Simulated:
    """A run that was simulated."""

    summary: Mapping[str, Any]  # for --json
    upright: bool


def _simulate_one(run: _Run, path: Path, *, quiet: bool) -> _Simulated:
    """Simulates a run into a folder and prints its metrics unless `quiet`. Raises HexapodError."""
    plan, label = run.plan, control_of(run.plan.control).label
    with results_folder(path) as folder:
        result, files = run_into(plan, [folder], run.command, run.options)
        checked: dict[str, Accuracy] = {}
        if run.accuracy:
            found = check_accuracy([plan], [summarise(result)], folder.path, run.options)
            write_accuracy(folder.path, found.as_table())
            checked[label] = found
        if plan.outputs.plots:
            with drawing(folder.path):
                runs = {label: stored_result(result)}
                files += write_report(runs, folder.path, warn=warn, accuracies=checked)
    if not quiet:
        _show(result, files, checked)
    return _Simulated(_summary(result, folder.path, files, checked), result.facts.walk.upright)


def _show(result: Result, files: Sequence[Path], checked: Mapping[str, Accuracy]) -> None:
    """Prints the metrics of a run, their accuracy if it was checked, and the written files."""
    control = control_of(result.scenario.control).label
    metrics = {control: result.metrics}
    rows = metric_rows(metrics, net_slip=has_net_slip(result.parameters))
    show_rows(with_errors(rows, checked), [control])
    show_accuracy(rows, checked, metrics)
    show_text(f"walk: {result.facts.walking.text}")
    if result.facts.drop is not None:
        show_text(result.facts.drop.text)
    show_files(files)


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
    facts = read_facts(folder)
    with damage_reported(folder):
        files = _report_again(folder, facts)
    if json:
        show_json({"report": str(folder / REPORT), "files": [str(file) for file in files]})
        return
    show_files(files)


def _report_again(folder: Path, facts: Mapping[str, Any]) -> list[Path]:
    """Writes the report of a folder again; `facts` are those of its run.json."""
    kind, reports = facts.get("kind"), report_functions()
    if kind in reports:
        return list(reports[kind](folder))
    if kind == "compare":
        return _report_comparison(folder, facts)
    if kind is not None:
        raise HexapodError(
            "not a run, whose report can be made again",
            got=f"a folder of `hexapod {kind}`",
            expected=" or ".join(["a run", "a comparison", *(f"a {name}" for name in reports)]),
            fix=f"run it again: {facts.get('command', '')}",
            where=str(folder),
        )
    run = read_result(folder)
    control = run.facts.control
    accuracies = {control: run.accuracy} if run.accuracy else {}
    return write_report({control: run}, folder, warn=warn, accuracies=accuracies)


def _report_comparison(folder: Path, facts: Mapping[str, Any]) -> list[Path]:
    """Writes the report of a comparison's folder again; `facts` are those of its run.json."""
    seeds, labels = read_seeds(folder / SEEDS), facts[PARTS]
    return write_report(
        {label: read_result(folder / label) for label in labels},
        folder,
        warn=warn,
        comparison=compare_all({label: seeds.get(label, []) for label in (*labels, *seeds)}),
        scenario=read_scenario(folder),
        command=facts.get("command", ""),
        walks=facts.get(WALKS, ()),
        accuracies=read_accuracies(folder),
    )


def _summary(
    result: Result, folder: Path, files: list[Path], checked: Mapping[str, Accuracy]
) -> dict[str, Any]:
    """Returns what --json prints of a run; `checked` is its accuracy by control, if checked."""
    label = control_of(result.scenario.control).label
    names = {
        "control": label,
        "directory": str(folder),
        "files": [str(file) for file in files],
    }
    facts = result.facts.as_table()
    shown = {key: facts[key] for key in ("robot", "walk", "walking", "warnings", "status")}
    summary = {"metrics": dict(result.metrics), **names, **shown}
    if checked:
        summary[ACCURACY] = checked[label].as_table()
    return summary
