"""Runs many scenarios in worker processes, which return summaries instead of recordings."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from concurrent.futures import Future
from contextlib import nullcontext
from dataclasses import dataclass
from functools import cache
from multiprocessing.util import Finalize
from pathlib import Path

from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.common.temporary import TemporaryFolder
from hexapod_cosim.cosim.master.loop import INTERRUPTED
from hexapod_cosim.cosim.results.summary import Summary, refused_summary, summarise
from hexapod_cosim.cosim.run.plan import check_arguments, chosen_gains
from hexapod_cosim.cosim.run.plant import PlantFmus
from hexapod_cosim.cosim.run.runner import Runner
from hexapod_cosim.cosim.run.single_run import simulate
from hexapod_cosim.cosim.run.worker_pool import (
    WorkerDiedError,
    WorkerPool,
    processor_count,
    raise_if_stopped,
)
from hexapod_cosim.cosim.scenario.controls import control_of
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.models import HexapodError
from hexapod_cosim.models.errors import check_type


@dataclass(frozen=True)
class _Task:
    scenario: Scenario
    fmu: Path | None = None
    gains: Gains | None = None
    refusal: Summary | None = None  # of a scenario that cannot be run


def run_batch(
    scenarios: Sequence[Scenario],
    *,
    fmu: Path | None = None,
    gains: Gains | None = None,
    workers: int | None = None,
    compiled: bool = False,
) -> Generator[Summary, None, None]:
    """Runs scenarios and yields their summaries in the order of the scenarios.

    The figures do not depend on `workers`, except for the wall time. Close the iterator
    (contextlib.closing) where the loop over it may be left early, for instance by an interrupt:
    this ends the runs under way. More than one worker needs a main module that can be imported.
    Raises HexapodError for an argument of another type, and when a worker process dies.

    Args:
        fmu: the plant FMU of all runs; by default one is exported for each robot.
        gains: gains of all compliant runs; by default they are designed, once for each robot and
            macro-step.
        workers: number of processes; by default one for each processor. 1 runs everything in the
            calling process.
        compiled: whether the controller FMU replaces the Python controller. It is some ten times
            as fast, and the figures agree to its last digits.
    """
    check_type(scenarios, Sequence, "a list of Scenario objects", where="scenarios")
    for scenario in scenarios:
        check_arguments(scenario, fmu, gains)
    with TemporaryFolder("batch") as folder:
        fmus = PlantFmus(folder, given=fmu)
        tasks = [_prepare(scenario, fmus, gains) for scenario in scenarios]
        count = min(processor_count() if workers is None else workers, len(tasks))
        if count <= 1:
            with Runner() if compiled else nullcontext() as runner:
                for task in tasks:
                    yield _completed(_run(task, runner))
        else:
            with WorkerPool(count) as pool:
                run = _run_compiled if compiled else _run
                futures = [pool.submit(run, task) for task in tasks]
                for task, future in zip(tasks, futures, strict=True):
                    yield _completed(_summary_of(task, future))


def _prepare(scenario: Scenario, fmus: PlantFmus, gains: Gains | None) -> _Task:
    """Makes what the run shares with others; a failure to do so refuses the scenario."""
    try:
        chosen = chosen_gains(scenario, gains)
        return _Task(scenario, fmu=fmus.fmu(scenario.robot), gains=chosen)
    except HexapodError as error:
        return _Task(scenario, refusal=refused_summary(scenario, error))


def _summary_of(task: _Task, future: Future[Summary]) -> Summary:
    """Returns the summary of a task. Raises HexapodError when its worker died."""
    try:
        return future.result()
    except WorkerDiedError as error:
        label = control_of(task.scenario.control).label
        raise HexapodError(
            "a worker process of the batch ended by itself",
            got=f"{task.scenario.title}, seed {task.scenario.seed}, {label} control",
            fix="look for what ended it (memory?), or run fewer at once",
        ) from error


def _completed(summary: Summary) -> Summary:
    """Returns the summary of a run. Raises KeyboardInterrupt when the run was interrupted."""
    if summary.status == INTERRUPTED:
        raise KeyboardInterrupt
    return summary


def _run(task: _Task, runner: Runner | None = None) -> Summary:
    """Runs a task in whatever process; an interrupted run has the status INTERRUPTED."""
    if task.refusal is not None:
        return task.refusal
    if runner is not None:
        return runner.summary(
            task.scenario, fmu=task.fmu, gains=task.gains, progress=raise_if_stopped
        )
    try:
        return summarise(
            simulate(task.scenario, fmu=task.fmu, gains=task.gains, progress=raise_if_stopped)
        )
    except HexapodError as error:
        return refused_summary(task.scenario, error)


def _run_compiled(task: _Task) -> Summary:
    """Runs a task in a worker process on the compiled controller."""
    return _run(task, process_runner())


@cache
def process_runner() -> Runner:
    """Returns the runner of this worker process, which is closed when the process ends."""
    runner = Runner()
    Finalize(runner, runner.close, exitpriority=1)
    return runner
