"""A study's runs in whatever process: the job unpacked once, then orders turned into rows."""

from __future__ import annotations

import re
import traceback
from collections import OrderedDict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory, gettempdir
from threading import Lock
from time import perf_counter
from typing import Any

from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.master.loop import FAILED, INTERRUPTED, Progress
from hexapod_cosim.cosim.results.metrics import METRICS
from hexapod_cosim.cosim.results.summary import NO_FIGURES, REFUSED, Summary
from hexapod_cosim.cosim.run.run import chosen_gains, known_robot
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.cosim.scenario.scenario import scenario_from_table, with_values
from hexapod_cosim.cosim.study.execute.engines import Engine, engine_named
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
from hexapod_cosim.cosim.study.store.done import Done
from hexapod_cosim.models import HexapodError

MOST_DESIGNS = 64  # sets of gains a worker keeps
MOST_KNOWN = 4096  # summaries a worker keeps: some 10 MB
MOST_TEXT = 400  # characters of what an exception says
ADDRESS = re.compile(r"0x[0-9a-fA-F]+")  # of an object in memory: another one each time


class Workshop:
    """A job unpacked in this process; `close` takes its files away."""

    def __init__(self, job: Job) -> None:
        differences = [
            f"{name} {job.environment[name]}, here {have}"
            for name, have in environment().items()
            if job.environment[name] != have
        ]
        if differences:
            fix = "install the same versions on all machines of the cluster"
            raise StudyError(
                "this worker is not like the machine that sends the study",
                got="; ".join(differences),
                fix=fix,
            )
        self._job, self._folder = job, _folder()
        self._files = {
            name: self._unpack(f"robot{k}", Path(name).suffix, data)
            for k, (name, data) in enumerate(job.robots.items())
        }
        self._fmus = {
            name: self._unpack(f"fmu{k}", ".fmu", data)
            for k, (name, data) in enumerate(job.fmus.items())
        }
        self._controller = self._unpack("controller", ".fmu", job.controller)
        self._engines: dict[str, Engine] = {}
        self._designs: OrderedDict[tuple[str, float], Gains] = OrderedDict()
        self._known: OrderedDict[bytes, Summary] = OrderedDict()

    def _unpack(self, name: str, suffix: str, content: bytes) -> Path:
        path = Path(self._folder.name) / f"{name}{suffix}"
        try:
            path.write_bytes(content)
        except OSError as error:
            raise _no_room(error, self._folder.name) from error
        return path

    def run(self, orders: Sequence[Order], progress: Progress) -> Iterator[Done]:
        """Each order's run; ends early when `progress` raises KeyboardInterrupt within one."""
        for order in orders:
            begin = perf_counter()
            summary = self._summary(order, progress)
            if summary.status == INTERRUPTED:
                return
            yield Done(order, summary, perf_counter() - begin)

    def _summary(self, order: Order, progress: Progress) -> Summary:
        """What a run came to, whatever happens; a run that was made before is not made again."""
        key = effective(order, self._job.factors)
        if key in self._known:
            self._known.move_to_end(key)
            return self._known[key]
        try:
            summary = checked(self._walked(order, progress))
        except HexapodError as error:
            return self._portable(failed(order, str(error)))
        except KeyboardInterrupt:
            raise
        except (
            BaseException
        ) as error:  # a mistake in an engine, or no memory: this run's result, not the study's end
            self._drop_engines()
            return self._portable(failed(order, told(error), status=FAILED))
        if summary.status != INTERRUPTED:
            self._known[key] = self._portable(summary)
            if len(self._known) > MOST_KNOWN:
                self._known.popitem(last=False)
        return self._portable(summary)

    def _walked(self, order: Order, progress: Progress) -> Summary:
        scenario = self._scenario(order)
        robot = scenario.robot
        scenario = replace(scenario, robot=str(self._files.get(robot, robot)))
        return self._engine(robot).summary(
            scenario, gains=self._gains(scenario, order), progress=progress
        )

    def _portable(self, summary: Summary) -> Summary:
        """Without the place where this process unpacked the job."""
        place = str(Path(self._folder.name) / " ").rstrip()
        return (
            replace(summary, reason=summary.reason.replace(place, ""))
            if place in summary.reason
            else summary
        )

    def _scenario(self, order: Order) -> Scenario:
        case = self._job.cases[order.case]
        settings = {
            factor.name: factor.setting(value)
            for factor, value in settings_of(order, self._job.factors)
            if factor.name != SCENARIO_FACTOR and not factor.name.startswith(GAINS)
        }
        table = with_values(case.table, settings)
        return scenario_from_table(
            {**table, "seed": order.seed, "control": order.control},
            where=case.where,
            given=list(settings),
        )

    def _gains(self, scenario: Scenario, order: Order) -> Gains | None:
        if order.control == "kinematic":
            return None
        gains = self._job.gains or self._designed(scenario)
        return changed_gains(gains, settings_of(order, self._job.factors))

    def _designed(self, scenario: Scenario) -> Gains:
        key = (known_robot(scenario).hash, scenario.macro_step)
        if key not in self._designs:
            gains = chosen_gains(scenario)
            assert gains is not None  # compliant
            self._designs[key] = gains
            if len(self._designs) > MOST_DESIGNS:
                self._designs.popitem(last=False)
        return self._designs[key]

    def _engine(self, robot: str) -> Engine:
        if robot not in self._engines:
            self._engines[robot] = engine_named(self._job.engine)(
                self._fmus[robot], self._controller
            )
        return self._engines[robot]

    def _drop_engines(self) -> None:
        """They begin anew: who knows how an exception left them."""
        for engine in self._engines.values():
            with suppress(Exception):
                engine.close()
        self._engines.clear()

    def close(self) -> None:
        """Takes away what was unpacked."""
        self._drop_engines()
        self._folder.cleanup()


def _folder() -> TemporaryDirectory[str]:
    try:
        return TemporaryDirectory(prefix="hexapod-job-")
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


def effective(order: Order, factors: Sequence[Factor]) -> bytes:
    """All that a run depends on: kinematic control has no gains."""
    settings = {
        factor.name: value
        for factor, value in settings_of(order, factors)
        if order.control != "kinematic" or not factor.name.startswith(GAINS)
    }
    return canonical([order.case, settings, order.seed, order.control])


def checked(summary: Summary) -> Summary:
    """What an engine gave, if it can be stored. Raises TypeError, ValueError, KeyError."""
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


def told(error: BaseException) -> str:
    """An exception's kind, text and place, the same on every machine."""
    try:
        text = ADDRESS.sub("0x...", str(error))
    except Exception:
        text = "it cannot say what"
    *_, last = traceback.extract_tb(error.__traceback__)
    return f"{type(error).__name__}: {text[:MOST_TEXT]} ({Path(last.filename).name}, line {last.lineno})"


def changed_gains(gains: Gains, settings: Sequence[tuple[Factor, Value]]) -> Gains:
    """Gains with those that are factors in their place, or times them."""
    for factor, value in settings:
        if factor.name.startswith(GAINS):
            part, _, name = factor.name.removeprefix(GAINS).partition(".")
            table = getattr(gains, part)
            changed: Mapping[str, Any] = {
                name: float(value) * (getattr(table, name) if factor.relative else 1.0)
            }
            gains = replace(gains, **{part: replace(table, **changed)})
    return gains


def failed(order: Order, reason: str, *, status: str = REFUSED) -> Summary:
    """A run without figures."""
    return Summary(
        control=order.control, seed=order.seed, status=status, reason=reason, metrics=NO_FIGURES
    )


_shops: dict[
    str, Workshop
] = {}  # of this process, by the name of their job; a cluster's worker may serve several studies
_one_at_a_time = (
    Lock()
)  # a cluster's worker may have threads; the FMU's loader changes the process' folder


def close_workshop(job: str) -> None:
    """Takes this process' workshop of a job away, when nothing is being run."""
    with _one_at_a_time:
        shop = _shops.pop(job, None)
        if shop is not None:
            shop.close()


def work(job: Job, orders: Sequence[Order], progress: Progress) -> list[Done]:
    """Runs orders in this process; fewer come back when it is told to stop."""
    with _one_at_a_time:
        try:
            progress(0.0)
        except KeyboardInterrupt:
            return []
        if job.name not in _shops:
            _shops[job.name] = Workshop(job)
        return list(_shops[job.name].run(orders, progress))
