"""The public call: runs a scenario under any controller and writes its report.

import hexapod_cosim

result = hexapod_cosim.simulate("walk_flat", controller="compliant")
print(result.metrics["slip_per_metre"])
hexapod_cosim.report(result, "out/walk")
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import NoneType
from typing import Any
from warnings import warn

from hexapod_cosim.controller import Gains, load_gains
from hexapod_cosim.cosim.control.controllers import check_control
from hexapod_cosim.cosim.master.loop import FAILED, Progress
from hexapod_cosim.cosim.report.writing import write_report
from hexapod_cosim.cosim.results.facts import Result, gait_differences
from hexapod_cosim.cosim.results.folder import (
    ResultsFolder,
    read_scenario,
    results_folder,
    stored_result,
    write_result,
)
from hexapod_cosim.cosim.results.side_by_side import (
    SEEDS,
    compare_all,
    write_comparison,
    write_seeds,
)
from hexapod_cosim.cosim.results.summary import summarise
from hexapod_cosim.cosim.run.single_run import simulate as run_scenario
from hexapod_cosim.cosim.scenario.controls import (
    Control,
    control_of,
    distinct_controls,
    parse_control,
    table_with_control,
)
from hexapod_cosim.cosim.scenario.reading import scenario_from_table
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.cosim.scenario.tables import read_tables, with_values
from hexapod_cosim.models.errors import check_type


def simulate(
    scenario: str | Path | Scenario = "walk_flat",
    controller: Any = None,
    *,
    settings: Mapping[str, Any] | None = None,
    label: str | None = None,
    fmu: str | Path | None = None,
    gains: str | Path | Gains | None = None,
    progress: Progress | None = None,
) -> Result:
    """Runs one co-simulation and returns its recording, metrics and facts.

    Args:
        scenario: a name of `hexapod list scenarios`, a scenario file, or a `Scenario`.
        controller: a control's text ("compliant", "law.py:Class", "controller.fmu"), a `Control`, a
            class with the method `step(t, command, measurement)`, or an object of such a class; by
            default the scenario's control.
        settings: keys of the scenario or parameters of the FMU, as `--set` of the commands:
            {"duration": 4, "gait.period": 0.8, "control.amplitude": 0.2}.
        label: the name of the run in tables and figures; by default the name of the controller.
        fmu: the plant; by default it is exported for the scenario's robot.
        gains: of compliant control, or their file; by default they are designed for the robot.
        progress: called now and then with the simulated time [s].

    Raises:
        HexapodError: the run cannot start. A run that has started always returns, and
            `Result.outcome` tells how it ended.

    Warns:
        RuntimeWarning: the run ended early, with the reason: its metrics are NaN.
    """
    check_type(scenario, (str, Path, Scenario), "a name, a path or a Scenario", where="scenario")
    check_type(settings, (Mapping, NoneType), "a dict of values by name", where="settings")
    check_type(label, (str, NoneType), "a name", where="label")
    check_type(fmu, (str, Path, NoneType), "the path of an FMU", where="fmu")
    text = controller.text if isinstance(controller, Control) else controller
    law = None if isinstance(text, str) else controller
    plan = _scenario(scenario, settings or {}, text if law is None else None)
    if label is not None and law is None:
        plain = plan.control.rpartition("=")[2]
        plan = replace(plan, control=parse_control(f"{label}={plain}", where="label").text)
    if law is None:
        check_control(plan, [control_of(plan.control)])
    place = None if fmu is None else Path(fmu)
    loaded = load_gains(gains) if isinstance(gains, str | Path) else gains
    result = run_scenario(plan, fmu=place, gains=loaded, progress=progress, law=law, label=label)
    if result.outcome.status == FAILED:
        reason = f"the run ended early, without metrics: {result.outcome.reason}"
        warn(reason, RuntimeWarning, stacklevel=2)
    return result


def _scenario(
    scenario: str | Path | Scenario, settings: Mapping[str, Any], text: str | None
) -> Scenario:
    """Returns the scenario with settings and a control's text applied. Raises ScenarioError."""
    if isinstance(scenario, Scenario):
        table, where = scenario.to_table(), scenario.where
    else:
        table, where = read_tables(scenario)
    if text is not None:
        table = table_with_control(table, parse_control(text, where="controller").text)
    changed = with_values(table, settings, "settings")
    return scenario_from_table(changed, where=where, given=settings, option="settings: ")


def report(results: Result | Sequence[Result], folder: str | Path) -> Path:
    """Writes runs and their report into a folder and returns the path of report.html.

    Several runs are compared with the first one; each has a folder of its own, named by its label.
    An earlier run's files in the folder are replaced. Raises HexapodError when a run did not
    complete, when two runs have one label, and when the folder cannot be used.
    """
    expected = "a result of simulate(), or several"
    check_type(folder, (str, Path), "the path of a folder", where="folder")
    given: Any = results
    several = isinstance(given, Sequence) and not isinstance(given, str)
    runs: list[Any] = list(given) if several else [given]
    for run in runs or [None]:
        check_type(run, Result, expected, where="results")
    labels = [
        control.label
        for control in distinct_controls(
            [control_of(run.scenario.control) for run in runs], where="report"
        )
    ]
    path = Path(folder)
    if len(runs) == 1:
        with results_folder(path) as place:
            place.begin()
            write_result(runs[0], path)
            files = write_report({labels[0]: stored_result(runs[0])}, path, warn=warn)
        return files[-1]
    with results_folder(path, labels) as place:
        place.begin()
        for label, run in zip(labels, runs, strict=True):
            part = ResultsFolder(path / label)
            part.begin()
            write_result(run, part.path)
        by_label = dict(zip(labels, runs, strict=True))
        comparison = compare_all({label: [summarise(run)] for label, run in by_label.items()})
        write_seeds(path / SEEDS, [summarise(run) for run in runs])
        walks = gait_differences({label: run.facts.walking for label, run in by_label.items()})
        write_comparison(path, runs[0].scenario, comparison, labels=labels, walks=walks)
        files = write_report(
            {label: stored_result(run) for label, run in by_label.items()},
            path,
            warn=warn,
            comparison=comparison,
            walks=walks,
            scenario=read_scenario(path),
        )
    return files[-1]
