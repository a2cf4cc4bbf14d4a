"""`hexapod simulate`, `compare` and `report`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from hexapod_cosim.controller import Gains, load_gains
from hexapod_cosim.cosim.cli.terminal import Json, progress_bar, show_files, show_json, show_table, warn
from hexapod_cosim.cosim.files import RUN_FILE, read_json, write_json, write_text
from hexapod_cosim.cosim.master import COMPLETED, INTERRUPTED
from hexapod_cosim.cosim.report import REPORT, metric_rows, write_report
from hexapod_cosim.cosim.results import METRICS_FILE, SCENARIO, Stored, read_result, results_folder, stored, write_result
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
Folder = Annotated[Path | None, typer.Option("-o", "--output", metavar="DIR", help="Where to write; default out/SCENARIO.")]
FmuFile = Annotated[Path | None, typer.Option("--fmu", metavar="FILE", help="Use this FMU instead of exporting the robot's own.")]
GainsFile = Annotated[
    Path | None, typer.Option("--gains", metavar="FILE", help="Gains from `hexapod design` instead of designing them now.")
]
Control = Annotated[str | None, typer.Option("--control", metavar="|".join(CONTROLS), help="Overrides the scenario's control.")]


class RunError(HexapodError):
    """A run that started and did not complete."""


def simulate(
    scenario: Name = "walk_flat", control: Control = None, settings: Settings = None, output: Folder = None,
    fmu: FmuFile = None, gains: GainsFile = None, json: Json = False,
) -> None:  # fmt: skip
    """Run one co-simulation: results, metrics, plots."""
    plan = load_scenario(scenario, overrides=[*(settings or []), *([f"control={control}"] if control else [])])
    ready = _load_gains(gains)
    with results_folder(output or _default_folder(scenario)) as folder:
        result, files = _run(plan, folder, fmu=fmu, gains=ready)
        if plan.outputs.plots:
            files += write_report({plan.control: stored(result)}, folder)
    if json:
        show_json(_summary(result, folder, files))
        return
    _show_metrics({plan.control: result.metrics})
    show_files(files)


def compare(
    scenario: Name = "walk_flat",
    settings: Settings = None,
    output: Folder = None,
    fmu: FmuFile = None,
    gains: GainsFile = None,
    json: Json = False,
) -> None:
    """Run a walk under kinematic and under compliant control; report."""
    plan = load_scenario(scenario, overrides=settings or [])
    ready = _load_gains(gains)
    runs: dict[str, Stored] = {}
    files: list[Path] = []
    with results_folder(output or _default_folder(scenario)) as folder:
        for control in CONTROLS:
            with results_folder(folder / control) as part:
                result, written = _run(replace(plan, control=control), part, fmu=fmu, gains=ready)
            runs[control] = stored(result)
            files += written
        files += _finish_compare(plan, runs, folder)
    metrics = {control: run.metrics for control, run in runs.items()}
    if json:
        show_json({**metrics, "report": str(folder / REPORT)})
        return
    _show_metrics(metrics)
    show_files(files)
    print(f"report: {folder / REPORT}")


def _finish_compare(plan: Scenario, runs: Mapping[str, Stored], folder: Path) -> list[Path]:
    write_text(folder / SCENARIO, to_toml(plan.to_table()))
    write_json(folder / METRICS_FILE, {control: run.metrics for control, run in runs.items()})
    files = write_report(runs, folder)
    write_json(folder / RUN_FILE, {"kind": "compare", "status": COMPLETED, "title": plan.title})
    return [folder / SCENARIO, folder / METRICS_FILE, folder / RUN_FILE, *files]


def report(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A folder written by `hexapod simulate` or `compare`.")], json: Json = False
) -> None:
    """Make the plots and the report of a run or a comparison again."""
    kind = read_json(folder / RUN_FILE).get("kind")
    if kind == "compare":
        runs = {control: read_result(folder / control) for control in CONTROLS}
    else:
        run = read_result(folder)
        runs = {run.facts["control"]: run}
    files = write_report(runs, folder)
    if json:
        show_json({"report": str(folder / REPORT), "files": [str(file) for file in files]})
        return
    show_files(files)


def _run(plan: Scenario, folder: Path, *, fmu: Path | None, gains: Gains | None) -> tuple[Result, list[Path]]:
    """Runs and writes. Raises RunError, or KeyboardInterrupt, with what was recorded on disk when the run does not complete."""
    with progress_bar(plan.control, plan.duration) as progress:
        result = run_scenario(plan, fmu=fmu, gains=gains, progress=progress)
    for warning in result.facts["warnings"]:
        warn(f"{plan.control}: {warning}")
    files = write_result(result, folder)
    outcome = result.outcome
    if outcome.status == INTERRUPTED:
        warn(f"stopped at {outcome.simulated:.3f} s; recorded so far: {files[1]}")
        raise KeyboardInterrupt
    if not result.completed:
        what = f"the run ended at {outcome.simulated:.3f} s of {plan.duration:g} s: {outcome.reason}"
        raise RunError(what, fix=f"what was recorded until then is in {files[1]}")
    return result, files


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
