"""Runs the orders of a study in any process; FMUs are opened once for all of them."""

from __future__ import annotations

import re
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from threading import RLock
from time import perf_counter

from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.master.loop import FAILED, INTERRUPTED
from hexapod_cosim.cosim.results.summary import NO_FIGURES, REFUSED, Summary
from hexapod_cosim.cosim.run.plan import chosen_gains
from hexapod_cosim.cosim.run.runner import Runner
from hexapod_cosim.cosim.run.worker_pool import raise_if_stopped
from hexapod_cosim.cosim.scenario.controls import table_with_control
from hexapod_cosim.cosim.scenario.reading import scenario_from_table
from hexapod_cosim.cosim.scenario.tables import with_values
from hexapod_cosim.extensions.study.job import Job, environment
from hexapod_cosim.extensions.study.records import (
    GAINS,
    SCENARIO_FACTOR,
    Factor,
    Order,
    RunResult,
    StudyError,
    Value,
)
from hexapod_cosim.models import HexapodError

MAX_TEXT = 400  # characters of an exception's text
ADDRESS = re.compile(r"0x[0-9a-fA-F]+")  # of an object in memory, which differs each time

# the runner of this process by the name of its job; a worker of a cluster may get another job
_runners: dict[str, Runner] = {}
# a cluster's worker may have threads, and the loader of an FMU changes the working directory
_one_at_a_time = RLock()


def run_orders(job: Job, orders: Sequence[Order]) -> list[RunResult]:
    """Runs orders in this process and returns their results.

    Raises KeyboardInterrupt when a run was interrupted, StudyError when this process cannot run
    the job.
    """
    with _one_at_a_time:
        raise_if_stopped(0.0)
        if job.name not in _runners:
            _check_environment(job)
            close_runners()
        return [_run(job, order) for order in orders]


def close_runners() -> None:
    """Closes the FMUs that this process has opened."""
    with _one_at_a_time:
        while _runners:
            _runners.popitem()[1].close()


def _check_environment(job: Job) -> None:
    """Raises StudyError when this process has other versions or files than the job's maker."""
    differences = [
        f"{name} {job.environment[name]}, here {have}"
        for name, have in environment(job.files).items()
        if job.environment[name] != have
    ]
    if differences:
        raise StudyError(
            "this worker differs from the machine that sends the study",
            got="; ".join(differences),
            fix="install the same versions, and put the study's files, on all machines",
        )


def _run(job: Job, order: Order) -> RunResult:
    """Returns the result of an order. Raises KeyboardInterrupt when it is interrupted."""
    begin = perf_counter()
    summary = _summary(job, order)
    if summary.status == INTERRUPTED:
        raise KeyboardInterrupt
    return RunResult(order, summary, perf_counter() - begin)


def _summary(job: Job, order: Order) -> Summary:
    """Returns the summary of an order's run, whatever happens in it."""
    try:
        return _simulated(job, order)
    except HexapodError as error:
        return summary_without_figures(order, str(error))
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # an error in a control ends this run, not the study
        close_runners()  # their state is unknown
        return summary_without_figures(order, describe_exception(error), status=FAILED)


def _simulated(job: Job, order: Order) -> Summary:
    """Runs the scenario of an order, with the values of the factors."""
    values = {
        factor: value
        for factor, value in zip(job.study.factors, order.values, strict=True)
        if value is not None and factor.name != SCENARIO_FACTOR
    }
    settings = {
        factor.name: factor.setting(value)
        for factor, value in values.items()
        if not factor.name.startswith(GAINS)
    }
    case = job.study.cases[order.case]
    law = job.study.laws[job.study.controls.index(order.control)]
    table = table_with_control(with_values(case.table, settings), law.text)
    table["seed"] = order.seed
    scenario = scenario_from_table(table, where=case.where, given=list(settings))
    gains = chosen_gains(scenario, job.gains)
    if gains is not None:
        gains = changed_gains(gains, values)
    if job.name not in _runners:
        _runners[job.name] = job.runner(fmu=job.fmu)
    return _runners[job.name].summary(scenario, gains=gains, progress=raise_if_stopped)


def describe_exception(error: BaseException) -> str:
    """Returns an exception's kind, text and place, the same on every machine."""
    *_, last = traceback.extract_tb(error.__traceback__)
    place = f"{Path(last.filename).name}, line {last.lineno}"
    return f"{type(error).__name__}: {ADDRESS.sub('0x...', str(error))[:MAX_TEXT]} ({place})"


def changed_gains(gains: Gains, values: Mapping[Factor, Value]) -> Gains:
    """Returns gains changed by the values of the factors; relative factors scale them."""
    for factor, value in values.items():
        if factor.name.startswith(GAINS):
            part, _, name = factor.name.removeprefix(GAINS).partition(".")
            table = getattr(gains, part)
            scale = getattr(table, name) if factor.relative else 1.0
            gains = replace(gains, **{part: replace(table, **{name: float(value) * scale})})
    return gains


def summary_without_figures(order: Order, reason: str, *, status: str = REFUSED) -> Summary:
    """Returns the summary of a run that has no figures."""
    return Summary(
        control=order.control, seed=order.seed, status=status, reason=reason, metrics=NO_FIGURES
    )
