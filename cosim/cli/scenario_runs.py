"""Runs a scenario or a package under one or several controls, for `hexapod simulate`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from hexapod_cosim.cosim.cli.failures import FELL, SUCCESS
from hexapod_cosim.cosim.cli.package import Package
from hexapod_cosim.cosim.cli.runs import (
    RunOptions,
    Words,
    check_accuracy,
    chosen_controls,
    default_folder,
    run_into,
    show_rows,
    titled,
)
from hexapod_cosim.cosim.cli.terminal import show_files, show_json, show_text, waiting, warn
from hexapod_cosim.cosim.report.tables import about_accuracy, metric_rows, with_errors
from hexapod_cosim.cosim.results.accuracy import Accuracy
from hexapod_cosim.cosim.results.facts import Result
from hexapod_cosim.cosim.results.folder import (
    ACCURACY,
    results_folder,
    stored_result,
    write_accuracy,
)
from hexapod_cosim.cosim.results.metric_table import has_net_slip
from hexapod_cosim.cosim.results.summary import summarise
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.cosim.scenario.records import Scenario

OF_PACKAGES = "walk_flat"  # scenario that a package's settings change


@dataclass(frozen=True)
class Simulated:
    """A run that was simulated, with the files that it wrote and its accuracy, if checked."""

    result: Result
    folder: Path
    files: list[Path]
    accuracy: Accuracy | None

    def as_table(self) -> dict[str, Any]:
        """Returns what --json prints."""
        facts = self.result.facts.as_table()
        kept = ("control", "robot", "walk", "walking", "warnings", "status")
        table = {
            "metrics": dict(self.result.metrics),
            "directory": str(self.folder),
            "files": [str(file) for file in self.files],
            **{key: facts[key] for key in kept},
        }
        return table if self.accuracy is None else {**table, ACCURACY: self.accuracy.as_table()}

    def show(self) -> None:
        """Prints metrics, their accuracy if it was checked, the walk and the written files."""
        facts = self.result.facts
        metrics = {facts.control: self.result.metrics}
        checked = {} if self.accuracy is None else {facts.control: self.accuracy}
        rows = metric_rows(metrics, net_slip=has_net_slip(self.result.parameters))
        show_rows(with_errors(rows, checked), [facts.control])
        if checked:
            show_text(about_accuracy(checked))
        show_text(f"walk: {facts.walking.text}")
        show_files(self.files)


def simulate_each(
    name: str,
    words: Words,
    options: RunOptions,
    *,
    output: Path | None,
    as_json: bool,
    package: Package | None = None,
) -> int:
    """Runs a scenario under each control and prints the results; returns the exit code.

    name: of the scenario; words: of the command line; output: the folder, by default out/NAME;
    package: that is run instead of a scenario. Several controls have a folder of their own each.
    Raises HexapodError.
    """
    scenario, settings = (name, []) if package is None else (OF_PACKAGES, package.settings)
    plan = load_scenario(scenario, overrides=[*settings, *words.settings])
    plan = titled(plan, words.settings)
    controls = chosen_controls(words.controls or [plan.control], plan)
    folder, done = output or default_folder(name), dict[str, Simulated]()
    command = words.command("simulate", name)
    for control in controls:
        place = folder
        if len(controls) > 1:
            place = folder / control.label
            folder.mkdir(parents=True, exist_ok=True)
        run = replace(plan, control=control.text)
        one = _simulate(run, command, options, place, check=words.accuracy)
        done[control.label] = one
        if not as_json:
            one.show()
    if as_json:
        tables = {label: one.as_table() for label, one in done.items()}
        show_json(tables if len(done) > 1 else next(iter(tables.values())))
    return SUCCESS if all(one.result.facts.walk.upright for one in done.values()) else FELL


def _simulate(
    plan: Scenario, command: str, options: RunOptions, path: Path, *, check: bool
) -> Simulated:
    """Simulates a run into a folder. Raises HexapodError."""
    accuracies: Mapping[str, Accuracy] = {}
    with results_folder(path) as folder:
        result, files = run_into(plan, [folder], command, options)
        label = result.facts.control
        if check:
            found = check_accuracy([plan], [summarise(result)], options)
            write_accuracy(folder.path, found.as_table())
            accuracies = {label: found}
        if plan.outputs.plots:
            from hexapod_cosim.cosim.report.writing import write_report

            with waiting("drawing figures and report"):
                runs = {label: stored_result(result)}
                files += write_report(runs, folder.path, warn=warn, accuracies=accuracies)
    return Simulated(result, path, files, accuracies.get(label))
