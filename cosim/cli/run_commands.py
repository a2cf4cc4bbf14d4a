"""`hexapod simulate`, `compare` and `report`."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from hexapod_cosim.controller import Gains, load_gains
from hexapod_cosim.cosim.cli.terminal import Json, progress_bar, show_files, show_json, show_table, warn
from hexapod_cosim.cosim.files import RUN_FILE, read_json, write_json, write_text
from hexapod_cosim.cosim.interrupts import held_interrupts
from hexapod_cosim.cosim.master import COMPLETED, INTERRUPTED
from hexapod_cosim.cosim.report import REPORT, metric_rows, write_report
from hexapod_cosim.cosim.results import METRICS_FILE, SCENARIO, Folder, Stored, read_result, results_folder, stored, write_result
from hexapod_cosim.cosim.run import Result
from hexapod_cosim.cosim.run import simulate as run_scenario
from hexapod_cosim.cosim.scenario import load_scenario
from hexapod_cosim.cosim.scenario_records import CONTROLS, Scenario
from hexapod_cosim.cosim.toml_text import to_toml
from hexapod_cosim.models import HexapodError

Name = Annotated[str, typer.Argument(metavar="SCENARIO", help="A scenario file, or a name of `hexapod list scenarios`.")]
Settings = Annotated[
    list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="Set a key of the scenario (gait.period=0.8) or an FMU parameter.")
]
FolderName = Annotated[Path | None, typer.Option("-o", "--output", metavar="DIR", help="Where to write; default out/SCENARIO.")]
FmuFile = Annotated[Path | None, typer.Option("--fmu", metavar="FILE", help="Use this FMU instead of exporting the robot's own.")]
GainsFile = Annotated[
    Path | None, typer.Option("--gains", metavar="FILE", help="Gains from `hexapod design` instead of designing them now.")
]
Control = Annotated[str | None, typer.Option("--control", metavar="|".join(CONTROLS), help="Overrides the scenario's control.")]


class RunError(HexapodError):
    """A run that started and did not complete."""


def simulate(
    scenario: Name = "walk_flat", control: Control = None, settings: Settings = None, output: FolderName = None,
    fmu: FmuFile = None, gains: GainsFile = None, json: Json = False,
) -> None:  # fmt: skip
    """Run one co-simulation: results, metrics, plots."""
    plan = load_scenario(scenario, overrides=[*(settings or []), *([f"control={control}"] if control else [])])
    ready = _load_gains(gains)
    with results_folder(output or _default_folder(scenario)) as folder:
        command = _command_line("simulate", scenario, control=control, settings=settings, fmu=fmu, gains=gains)
        result, files = _run(plan, [folder], command, fmu=fmu, gains=ready)
        if plan.outputs.plots:
            with _drawing(folder.path):
                files += write_report({plan.control: stored(result)}, folder.path, tell=warn)
    if json:
        show_json(_summary(result, folder.path, files))
        return
    _show_metrics({plan.control: result.metrics})
    show_files(files)


def compare(
    scenario: Name = "walk_flat",
    settings: Settings = None,
    output: FolderName = None,
    fmu: FmuFile = None,
    gains: GainsFile = None,
    json: Json = False,
) -> None:
    """Run a walk under kinematic and under compliant control; report."""
    plan = load_scenario(scenario, overrides=settings or [])
    ready = _load_gains(gains)
    command = _command_line("compare", scenario, settings=settings, fmu=fmu, gains=gains)
    runs: dict[str, Stored] = {}
    files: list[Path] = []
    with results_folder(output or _default_folder(scenario)) as folder:
        for control in CONTROLS:
            with results_folder(folder.path / control) as part:
                result, written = _run(replace(plan, control=control), [folder, part], command, fmu=fmu, gains=ready)
            runs[control] = stored(result)
            files += written
        with _drawing(folder.path):
            files += _finish_compare(plan, runs, folder.path, command)
    metrics = {control: run.metrics for control, run in runs.items()}
    if json:
        show_json({**metrics, "report": str(folder.path / REPORT)})
        return
    _show_metrics(metrics)
    show_files(files)
    print(f"report: {folder.path / REPORT}")


def _finish_compare(plan: Scenario, runs: Mapping[str, Stored], folder: Path, command: str) -> list[Path]:
    text = to_toml({key: value for key, value in plan.to_table().items() if key != "control"})  # both were run
    write_text(folder / SCENARIO, text)
    write_json(folder / METRICS_FILE, {control: run.metrics for control, run in runs.items()})
    write_json(folder / RUN_FILE, {"kind": "compare", "status": COMPLETED, "title": plan.title, "command": command})
    files = write_report(runs, folder, tell=warn, scenario=text, command=command)
    return [folder / SCENARIO, folder / METRICS_FILE, folder / RUN_FILE, *files]


def report(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A folder written by `hexapod simulate` or `compare`.")], json: Json = False
) -> None:
    """Make the plots and the report of a run or a comparison again."""
    facts = read_json(folder / RUN_FILE)
    if facts.get("kind") == "compare":
        runs = {control: read_result(folder / control) for control in CONTROLS}
        text = (folder / SCENARIO).read_text(encoding="utf-8")
        files = write_report(runs, folder, tell=warn, scenario=text, command=facts.get("command", ""))
    else:
        run = read_result(folder)
        files = write_report({run.facts["control"]: run}, folder, tell=warn)
    if json:
        show_json({"report": str(folder / REPORT), "files": [str(file) for file in files]})
        return
    show_files(files)


def _command_line(
    name: str, scenario: str, *, settings: list[str] | None, fmu: Path | None, gains: Path | None, control: str | None = None
) -> str:
    """The command that does the same again."""
    options = [("--set", text) for text in settings or []]
    options += [(key, str(value)) for key, value in (("--control", control), ("--fmu", fmu), ("--gains", gains)) if value is not None]
    return shlex.join(["hexapod", name, scenario, *(word for option in options for word in option)])


def _run(plan: Scenario, folders: Sequence[Folder], command: str, *, fmu: Path | None, gains: Gains | None) -> tuple[Result, list[Path]]:
    """Runs, and writes into the last folder, clearing all of them once the run begins; an interrupt waits for what is being written.

    Raises RunError, or KeyboardInterrupt, with what was recorded on disk when the run does not complete.
    """
    with ExitStack() as whole:

        def begin() -> None:
            whole.enter_context(held_interrupts())
            for folder in folders:
                folder.begin()

        with progress_bar(plan.control, plan.duration) as progress:
            result = run_scenario(plan, fmu=fmu, gains=gains, progress=progress, begin=begin)
        result = replace(result, facts={**result.facts, "command": command})
        files = write_result(result, folders[-1].path)
    for warning in result.facts["warnings"]:
        warn(f"{plan.control}: {warning}")
    outcome = result.outcome
    if outcome.status == INTERRUPTED:
        warn(f"stopped at {outcome.simulated:.3f} s; recorded so far: {files[1]}")
        raise KeyboardInterrupt
    if not result.completed:
        what = f"the run ended at {outcome.simulated:.3f} s of {plan.duration:g} s: {outcome.reason}"
        raise RunError(what, fix=f"what was recorded until then is in {files[1]}") from outcome.cause
    return result, files


@contextmanager
def _drawing(folder: Path) -> Iterator[None]:
    """Says on an interrupt what is there and what is not."""
    try:
        yield
    except KeyboardInterrupt:
        warn(f"the results in {folder} are whole, the figures are not: `hexapod report {folder}` draws them")
        raise


def _load_gains(path: Path | None) -> Gains | None:
    return None if path is None else load_gains(path)


def _default_folder(scenario: str) -> Path:
    return Path("out") / Path(scenario).stem


def _summary(result: Result, folder: Path, files: list[Path]) -> dict[str, Any]:
    names = {"control": result.scenario.control, "directory": str(folder), "files": [str(file) for file in files]}
    shown = {key: result.facts[key] for key in ("robot", "walk", "warnings")}
    return {"metrics": dict(result.metrics), **names, **shown, "status": result.outcome.status}


def _show_metrics(metrics: Mapping[str, Mapping[str, float | None]]) -> None:
    rows = metric_rows(metrics)
    several = len(metrics) > 1
    columns = ["metric", "unit", *metrics, *(["change", ""] if several else [])]
    show_table(columns, [_cells(row, several) for row in rows], right=range(2, 2 + len(metrics) + several))


def _cells(row: Mapping[str, Any], several: bool) -> list[str]:
    return [row["name"], row["unit"], *row["values"], *([row["change"], row["verdict"]] if several else [])]
