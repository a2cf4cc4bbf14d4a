"""Parts shared by `hexapod simulate` and `compare`: options, runs into folders, metric tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from hexapod_cosim.controller import Gains, load_gains
from hexapod_cosim.cosim.cli.options import ENGINES, command_line
from hexapod_cosim.cosim.cli.terminal import counting_bar, progress_bar, show_table, waiting, warn
from hexapod_cosim.cosim.control.controllers import check_control
from hexapod_cosim.cosim.master.interrupts import deferred_interrupts
from hexapod_cosim.cosim.master.loop import INTERRUPTED
from hexapod_cosim.cosim.results.accuracy import Accuracy, compare_accuracy, reference_scenario
from hexapod_cosim.cosim.results.facts import Result
from hexapod_cosim.cosim.results.folder import ResultsFolder, write_result
from hexapod_cosim.cosim.results.recordings import check_formats
from hexapod_cosim.cosim.results.summary import Summary
from hexapod_cosim.cosim.run.batch import run_batch
from hexapod_cosim.cosim.run.runner import Runner
from hexapod_cosim.cosim.run.single_run import simulate as run_scenario
from hexapod_cosim.cosim.scenario.controls import Control, control_of, parse_controls
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.models import HexapodError, unknown_name

UNTITLED = (
    "control=",
    "control.",
    "seed=",
    "outputs.",
    "duration=",
)  # settings that keep the title


class RunError(HexapodError):
    """A run started and did not complete."""


@dataclass(frozen=True, kw_only=True)
class RunOptions:
    """The user's choices for all runs of a command."""

    fmu: Path | None  # None: exported for the robot
    gains: Gains | None  # None: designed
    engine: str  # one of ENGINES

    @classmethod
    def read(
        cls, *, fmu: Path | None, gains: Path | None, engine: str | None, runs: int
    ) -> RunOptions:
        """Reads the gains of a file, and chooses the engine for a number of runs of each control.

        Raises HexapodError for a bad file and an unknown engine.
        """
        return cls(fmu=fmu, gains=given_gains(gains), engine=checked_engine(engine, runs=runs))


@dataclass(frozen=True)
class Words:
    """What was written on the command line, for the command that repeats a run."""

    controls: list[str] | None
    settings: list[str]
    engine: str | None = None
    fmu: Path | None = None
    gains: Path | None = None
    seeds: int | None = None
    accuracy: bool = False

    def command(self, name: str, scenario: str) -> str:
        """Returns the command `name` that repeats the run of a scenario."""
        return command_line(
            name, scenario, control=self.controls, set=self.settings, seeds=self.seeds,
            engine=self.engine, fmu=self.fmu, gains=self.gains, check_accuracy=self.accuracy,
        )  # fmt: skip


def checked_engine(name: str | None, *, runs: int) -> str:
    """Returns the engine; by default Python for one run and compiled for several.

    Raises HexapodError for a name that is not in ENGINES.
    """
    if name is None:
        return "python" if runs == 1 else "compiled"
    if name not in ENGINES:
        raise unknown_name("engine", name, ENGINES, where="--engine")
    return name


def titled(plan: Scenario, settings: Sequence[str]) -> Scenario:
    """Returns the scenario with the settings that distinguish its walk added to its title."""
    if any(text.startswith("title") for text in settings):
        return plan
    shown = [text.replace(" ", "") for text in settings if not text.startswith(UNTITLED)]
    return replace(plan, title=f"{plan.title}, {', '.join(shown)}") if shown else plan


def run_into(
    plan: Scenario, folders: Sequence[ResultsFolder], command: str, options: RunOptions
) -> tuple[Result, list[Path]]:
    """Runs a scenario and writes its results into the last of the folders.

    All folders are cleared once the run begins. An interrupt ends the run, but waits until the
    files are written. Raises RunError or KeyboardInterrupt when the run does not complete; its
    recording until then is written.
    """
    check_formats(plan.outputs.formats, start=plan.start, where=f"{plan.where}: outputs.formats")
    with ExitStack() as stack:

        def begin() -> None:
            stack.enter_context(deferred_interrupts())
            for folder in folders:
                folder.begin()

        label = control_of(plan.control).label
        with progress_bar(label, plan.duration) as progress:
            run = partial(run_scenario, plan)
            if options.engine == "compiled":
                run = partial(stack.enter_context(Runner(everything=True)).simulate, plan)
            result = run(fmu=options.fmu, gains=options.gains, progress=progress, begin=begin)
        result = replace(result, facts=replace(result.facts, command=command))
        with waiting("writing the results"):
            files = write_result(result, folders[-1].path)
    for warning in result.facts.warnings:
        warn(f"{label}: {warning}")
    outcome = result.outcome
    if outcome.status == INTERRUPTED:
        warn(f"stopped at {outcome.simulated:.3f} s; recorded so far: {files[1]}")
        raise KeyboardInterrupt
    if not result.completed:
        what = f"the run ended at {outcome.simulated:.3f} s of {plan.duration:g} s"
        fix = f"what was recorded until then is in {files[1]}"
        raise RunError(f"{what}: {outcome.reason}", fix=fix) from outcome.cause
    return result, files


def given_gains(path: Path | None) -> Gains | None:
    """Reads the gains of a file, if one is given. Raises GainsError."""
    return None if path is None else load_gains(path)


def default_folder(scenario: str) -> Path:
    """Returns the folder for results without -o."""
    return Path("out") / Path(scenario).stem


def show_rows(
    rows: Sequence[Mapping[str, Any]], controls: Sequence[str], compared: Sequence[str] = ()
) -> None:
    """Prints the rows of a report's table without its empty columns.

    compared: the headings of the changes.
    """
    columns = {"metric": [row["name"] for row in rows], "unit": [row["unit"] for row in rows]}
    columns |= {control: [row["values"][k] for row in rows] for k, control in enumerate(controls)}
    for k, title in enumerate(compared):
        changes = [row["changes"][k] for row in rows]
        if len(compared) == 1:
            columns["change"] = [one["change"] for one in changes]
            columns["95 % interval"] = [one["interval"] for one in changes]
            columns[""] = [one["verdict"] for one in changes]
        else:  # of more controls, metrics.json and the report have the intervals
            columns[title] = [f"{one['change']} {one['verdict']}".strip() for one in changes]
    shown = {name: texts for name, texts in columns.items() if any(texts)}
    left = {"metric", "unit", ""}
    right = [k for k, name in enumerate(shown) if name not in left]
    show_table(list(shown), zip(*shown.values(), strict=True), right=right)


def chosen_controls(texts: Sequence[str], plan: Scenario) -> tuple[Control, ...]:
    """Returns the controls of a command, whose files are checked. Raises HexapodError."""
    controls = parse_controls(texts, where="--control")
    check_control(plan, controls)
    return controls


def run_all(
    label: str, plans: Sequence[Scenario], options: RunOptions, done: Sequence[Summary] = ()
) -> list[Summary]:
    """Runs scenarios, shows how many have run; returns `done` and the summaries of the others."""
    compiled, found = options.engine == "compiled", list(done)
    batch = run_batch(plans, fmu=options.fmu, gains=options.gains, compiled=compiled)
    with counting_bar(label, len(done) + len(plans)) as report_count, closing(batch) as runs:
        report_count(len(found))
        for summary in runs:
            found.append(summary)
            report_count(len(found))
    return found


def check_accuracy(
    plans: Sequence[Scenario], runs: Sequence[Summary], options: RunOptions
) -> Accuracy:
    """Returns the accuracy of runs of one control, whose results are in a folder already.

    Args:
        plans: the scenarios of the runs.
        runs: their summaries.
        options: those of the runs.
    """
    fine = [reference_scenario(plan) for plan in plans]
    found = compare_accuracy(plans[0], runs, run_all("accuracy", fine, options))
    for text in found.notes:
        warn(f"accuracy: {text}")
    return found
