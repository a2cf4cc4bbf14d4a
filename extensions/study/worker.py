"""Runs the orders of a study in any process; the job is unpacked once for all of them."""

from __future__ import annotations

import pickle
import re
import traceback
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from threading import Lock
from time import perf_counter

from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.common.temporary import TemporaryFolder
from hexapod_cosim.cosim.master.loop import FAILED, INTERRUPTED
from hexapod_cosim.cosim.results.summary import NO_FIGURES, REFUSED, Summary
from hexapod_cosim.cosim.run.plan import chosen_gains
from hexapod_cosim.cosim.run.worker_pool import raise_if_stopped
from hexapod_cosim.cosim.scenario.controls import PYTHON, control_of, split_walk, table_with_control
from hexapod_cosim.cosim.scenario.reading import scenario_from_table
from hexapod_cosim.cosim.scenario.records import Scenario
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
from hexapod_cosim.extensions.study.runs import settings_of
from hexapod_cosim.models import HexapodError

MAX_TEXT = 400  # characters of an exception's text
ADDRESS = re.compile(r"0x[0-9a-fA-F]+")  # of an object in memory, which differs each time

# the job that is unpacked in this process, if any; a worker of a cluster may get another one
_contexts: list[_JobContext] = []
# a cluster's worker may have threads, and the loader of an FMU changes the working directory
_one_at_a_time = Lock()


def run_orders(job: Job | Path, orders: Sequence[Order]) -> list[RunResult]:
    """Runs orders in this process and returns their results. `job` may be the file that holds it.

    Raises KeyboardInterrupt when a run was interrupted, StudyError when this process cannot run
    the job.
    """
    if isinstance(job, Path):
        job = _read_job(job)
    with _one_at_a_time:
        raise_if_stopped(0.0)
        if not _contexts or _contexts[0].job.name != job.name:
            _close_contexts()
            _contexts.append(_JobContext(job))
        return [_contexts[0].run(order) for order in orders]


def unpack_job(content: bytes) -> Job:
    """Returns a job from its bytes: the task by which Dask sends it to workers."""
    job: Job = pickle.loads(content)
    return job


@cache
def _read_job(file: Path) -> Job:
    return unpack_job(file.read_bytes())


def close_job_context() -> None:
    """Closes what this process has unpacked."""
    with _one_at_a_time:
        _close_contexts()


def _close_contexts() -> None:
    while _contexts:
        _contexts.pop().close()


class _JobContext:
    """A job that is unpacked in this process.

    Raises StudyError when the process has other versions.
    """

    def __init__(self, job: Job) -> None:
        _check_environment(job)
        self.job, self._folder = job, TemporaryFolder("job")
        self._files = {
            name: self._unpack(f"robot{k}{Path(name).suffix}", data)
            for k, (name, data) in enumerate(job.robots.items())
        }
        self._fmus = {
            name: self._unpack(f"fmu{k}.fmu", data)
            for k, (name, data) in enumerate(job.fmus.items())
        }
        self._controls = {
            label: self._local(f"law{k}", label, text)
            for k, (label, text) in enumerate(job.study.texts.items())
        }
        self._controller = self._unpack("controller.fmu", job.controller)
        self._runner = job.runner(controller=self._controller)

    def _unpack(self, name: str, content: bytes) -> Path:
        path = self._folder.path / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(content)
        return path

    def _local(self, folder: str, label: str, text: str) -> str:
        """Returns the text of a control with a path that holds its file on this machine.

        This is the path of the study where it has the same content, else an unpacked copy.
        """
        control, content = control_of(text), self.job.laws.get(label)
        if control.path is None or content is None:
            return text
        if control.path.is_file() and control.path.read_bytes() == content:
            return text
        copy = self._unpack(f"{folder}/{control.path.name}", content)
        at = split_walk(control.text)[1]
        return f"{label}={copy}:{control.name}{at}" if control.kind == PYTHON else f"{label}={copy}"

    def run(self, order: Order) -> RunResult:
        """Returns the result of an order. Raises KeyboardInterrupt when it is interrupted."""
        begin = perf_counter()
        summary = self._summary(order)
        if summary.status == INTERRUPTED:
            raise KeyboardInterrupt
        place = str(self._folder.path)  # of this process, and so no part of a result
        summary = replace(summary, reason=summary.reason.replace(place, ""))
        return RunResult(order, summary, perf_counter() - begin)

    def _summary(self, order: Order) -> Summary:
        """Returns the summary of an order's run, whatever happens in it."""
        try:
            return self._run(order)
        except HexapodError as error:
            return summary_without_figures(order, str(error))
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # an error in a control ends this run, not the study
            self._runner.close()  # its state is unknown
            self._runner = self.job.runner(controller=self._controller)
            return summary_without_figures(order, describe_exception(error), status=FAILED)

    def _run(self, order: Order) -> Summary:
        scenario = self._scenario(order)
        name, gains = scenario.robot, chosen_gains(scenario, self.job.gains)
        if gains is not None:
            gains = changed_gains(gains, settings_of(order, self.job.study.factors))
        scenario = replace(scenario, robot=str(self._files.get(name, name)))
        return self._runner.summary(
            scenario, fmu=self._fmus[name], gains=gains, progress=raise_if_stopped
        )

    def _scenario(self, order: Order) -> Scenario:
        """Returns the scenario of an order, with the values of the factors."""
        case = self.job.study.cases[order.case]
        settings = {
            factor.name: factor.setting(value)
            for factor, value in settings_of(order, self.job.study.factors)
            if factor.name != SCENARIO_FACTOR and not factor.name.startswith(GAINS)
        }
        table = table_with_control(with_values(case.table, settings), self._controls[order.control])
        return scenario_from_table(
            {**table, "seed": order.seed}, where=case.where, given=list(settings)
        )

    def close(self) -> None:
        """Closes the FMUs and removes the unpacked files."""
        self._runner.close()
        self._folder.close()


def _check_environment(job: Job) -> None:
    """Raises StudyError when this process has other versions than the job was made with."""
    differences = [
        f"{name} {job.environment[name]}, here {have}"
        for name, have in environment().items()
        if job.environment[name] != have
    ]
    if differences:
        raise StudyError(
            "this worker differs from the machine that sends the study",
            got="; ".join(differences),
            fix="install the same versions on all machines of the cluster",
        )


def describe_exception(error: BaseException) -> str:
    """Returns an exception's kind, text and place, the same on every machine."""
    try:
        text = ADDRESS.sub("0x...", str(error))
    except Exception:
        text = "its text cannot be read"
    *_, last = traceback.extract_tb(error.__traceback__)
    place = f"{Path(last.filename).name}, line {last.lineno}"
    return f"{type(error).__name__}: {text[:MAX_TEXT]} ({place})"


def changed_gains(gains: Gains, settings: Sequence[tuple[Factor, Value]]) -> Gains:
    """Returns gains changed by the values of the factors; relative factors scale them."""
    for factor, value in settings:
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
