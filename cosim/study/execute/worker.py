"""Runs the orders of a study in any process; the job is unpacked once for all of them."""

from __future__ import annotations

import re
import traceback
from collections import OrderedDict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from tempfile import gettempdir
from threading import Lock
from time import perf_counter
from typing import Any

from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.common.temporary import TemporaryFolder
from hexapod_cosim.cosim.master.loop import FAILED, INTERRUPTED, Progress
from hexapod_cosim.cosim.results.metrics import METRICS
from hexapod_cosim.cosim.results.summary import NO_FIGURES, REFUSED, Summary
from hexapod_cosim.cosim.run.preparation import chosen_gains
from hexapod_cosim.cosim.scenario.controls import (
    PYTHON,
    control_of,
    split_walk,
    table_with_control,
)
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.cosim.scenario.scenario import scenario_from_table
from hexapod_cosim.cosim.scenario.tables import with_values
from hexapod_cosim.cosim.study.execute.engines import Engine, find_engine
from hexapod_cosim.cosim.study.execute.job import Job, environment
from hexapod_cosim.cosim.study.plan.identity import canonical, settings_of
from hexapod_cosim.cosim.study.plan.records import (
    GAINS,
    SCENARIO_FACTOR,
    Factor,
    Order,
    StudyError,
    Value,
)
from hexapod_cosim.cosim.study.store.run_result import RunResult
from hexapod_cosim.models import HexapodError

MAX_KNOWN = 4096  # summaries that a worker keeps: some 10 MB
MAX_TEXT = 400  # characters of an exception's text
ADDRESS = re.compile(r"0x[0-9a-fA-F]+")  # of an object in memory, which differs each time


class JobContext:
    """A job that is unpacked in this process.

    Raises StudyError when the process has other versions or the disk is full.
    """

    def __init__(self, job: Job) -> None:
        _check_environment(job)
        self._job, self._folder = job, _folder()
        self._files = {
            name: self._unpack(f"robot{k}", Path(name).suffix, data)
            for k, (name, data) in enumerate(job.robots.items())
        }
        self._fmus = {
            name: self._unpack(f"fmu{k}", ".fmu", data)
            for k, (name, data) in enumerate(job.fmus.items())
        }
        self._controls = {label: self._local(label, text) for label, text in job.controls.items()}
        self._controller = self._unpack("controller", ".fmu", job.controller)
        self._engines: dict[str, Engine] = {}
        self._known: OrderedDict[bytes, Summary] = OrderedDict()

    def _unpack(self, name: str, suffix: str, content: bytes) -> Path:
        path = self._folder.path / f"{name}{suffix}"
        try:
            path.write_bytes(content)
        except OSError as error:
            raise _no_room(error, str(self._folder.path)) from error
        return path

    def _local(self, label: str, text: str) -> str:
        """Returns the text of a control with a path that holds its file on this machine.

        This is the path of the study where it has the same content, else an unpacked copy.
        """
        control, content = control_of(text), self._job.laws.get(label)
        if control.path is None or content is None:
            return text
        if control.path.is_file() and control.path.read_bytes() == content:
            return text
        folder = self._folder.path / f"law{len(list(self._folder.path.iterdir()))}"
        folder.mkdir()
        copy = self._unpack(
            str(Path(folder.name) / control.path.stem), control.path.suffix, content
        )
        at = split_walk(control.text)[1]
        return f"{label}={copy}:{control.name}{at}" if control.kind == PYTHON else f"{label}={copy}"

    def run(self, orders: Sequence[Order], progress: Progress) -> Iterator[RunResult]:
        """Yields the result of each order.

        The iterator ends early when `progress` raises KeyboardInterrupt within a run.
        """
        for order in orders:
            begin = perf_counter()
            summary = self._summary(order, progress)
            if summary.status == INTERRUPTED:
                return
            yield RunResult(order, summary, perf_counter() - begin)

    def _summary(self, order: Order, progress: Progress) -> Summary:
        """Returns the summary of an order's run, whatever happens in it.

        A run with equal settings is not repeated: its summary is kept.
        """
        key = effective_settings(order, self._job.factors)
        if key in self._known:
            self._known.move_to_end(key)
            return self._known[key]
        try:
            summary = checked(self._run(order, progress))
        except HexapodError as error:
            return self._portable(summary_without_figures(order, str(error)))
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # an error in an engine ends this run, not the study
            self._close_engines()
            reason = describe_exception(error)
            return self._portable(summary_without_figures(order, reason, status=FAILED))
        if summary.status != INTERRUPTED:
            self._known[key] = self._portable(summary)
            if len(self._known) > MAX_KNOWN:
                self._known.popitem(last=False)
        return self._portable(summary)

    def _run(self, order: Order, progress: Progress) -> Summary:
        scenario = self._scenario(order)
        robot = scenario.robot
        scenario = replace(scenario, robot=str(self._files.get(robot, robot)))
        return self._engine(robot).summary(
            scenario, gains=self._gains(scenario, order), progress=progress
        )

    def _portable(self, summary: Summary) -> Summary:
        """Returns the summary without the path of this process' folder in its reason."""
        place = str(self._folder.path / " ").rstrip()
        return (
            replace(summary, reason=summary.reason.replace(place, ""))
            if place in summary.reason
            else summary
        )

    def _scenario(self, order: Order) -> Scenario:
        """Returns the scenario of an order, with the values of the factors."""
        case = self._job.cases[order.case]
        settings = {
            factor.name: factor.setting(value)
            for factor, value in settings_of(order, self._job.factors)
            if factor.name != SCENARIO_FACTOR and not factor.name.startswith(GAINS)
        }
        table = with_values(case.table, settings)
        return scenario_from_table(
            {**table_with_control(table, self._controls[order.control]), "seed": order.seed},
            where=case.where,
            given=list(settings),
        )

    def _gains(self, scenario: Scenario, order: Order) -> Gains | None:
        """Returns the gains of an order, with the values of the factors."""
        gains = chosen_gains(scenario, self._job.gains)
        if gains is None:
            return None
        return changed_gains(gains, settings_of(order, self._job.factors))

    def _engine(self, robot: str) -> Engine:
        if robot not in self._engines:
            self._engines[robot] = find_engine(self._job.engine)(
                self._fmus[robot], self._controller
            )
        return self._engines[robot]

    def _close_engines(self) -> None:
        """Closes all engines, whose state is unknown after an exception; new ones are made."""
        for engine in self._engines.values():
            with suppress(Exception):
                engine.close()
        self._engines.clear()

    def close(self) -> None:
        """Closes the engines and removes the unpacked files."""
        self._close_engines()
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


def _folder() -> TemporaryFolder:
    try:
        return TemporaryFolder("job")
    except OSError as error:
        raise _no_room(error, gettempdir()) from error


def _no_room(error: OSError, where: str) -> StudyError:
    fix = "make room there, or name another folder with TMPDIR"
    return StudyError(
        "a worker cannot unpack its job",
        got=error.strerror,
        expected="room for temporary files",
        fix=fix,
        where=where,
    )


def effective_settings(order: Order, factors: Sequence[Factor]) -> bytes:
    """Returns the key of all that a run depends on. Kinematic control has no gains."""
    settings = {
        factor.name: value
        for factor, value in settings_of(order, factors)
        if order.control != "kinematic" or not factor.name.startswith(GAINS)
    }
    return canonical([order.case, settings, order.seed, order.control])


def checked(summary: Summary) -> Summary:
    """Converts an engine's summary to plain types, so that it can be stored.

    Raises TypeError, ValueError or KeyError when it is not a complete summary.
    """
    if not isinstance(summary, Summary):
        raise TypeError(f"the engine gave {type(summary).__name__}, expected a Summary")
    fallback = None if summary.fallback is None else float(summary.fallback)
    return replace(
        summary,
        status=str(summary.status),
        reason=str(summary.reason),
        upright=bool(summary.upright),
        fallback=fallback,
        warnings=tuple(map(str, summary.warnings)),
        metrics={name: float(summary.metrics[name]) for name in METRICS},
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
            changed: Mapping[str, Any] = {
                name: float(value) * (getattr(table, name) if factor.relative else 1.0)
            }
            gains = replace(gains, **{part: replace(table, **changed)})
    return gains


def summary_without_figures(order: Order, reason: str, *, status: str = REFUSED) -> Summary:
    """Returns the summary of a run that has no figures."""
    return Summary(
        control=order.control, seed=order.seed, status=status, reason=reason, metrics=NO_FIGURES
    )


# by the name of their job: a cluster's worker may serve several studies
_contexts: dict[str, JobContext] = {}
# a cluster's worker may have threads, and the loader of an FMU changes the working directory
_one_at_a_time = Lock()


def close_job_context(job: str) -> None:
    """Closes the context of a job in this process, given by its name, between two chunks."""
    with _one_at_a_time:
        context = _contexts.pop(job, None)
        if context is not None:
            context.close()


def run_orders(job: Job, orders: Sequence[Order], progress: Progress) -> list[RunResult]:
    """Runs orders in this process.

    Returns their results, fewer than orders when `progress` raises KeyboardInterrupt.
    """
    with _one_at_a_time:
        try:
            progress(0.0)
        except KeyboardInterrupt:
            return []
        if job.name not in _contexts:
            _contexts[job.name] = JobContext(job)
        return list(_contexts[job.name].run(orders, progress))
