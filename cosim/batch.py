"""Many runs at once: scenarios in processes of their own, of which only what they come to is sent back, not their recordings."""

from __future__ import annotations

import math
import multiprocessing
import os
from collections.abc import Generator, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.connection import wait
from multiprocessing.synchronize import Event
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Thread

from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.export import export_fmu
from hexapod_cosim.cosim.interrupts import deaf_to_interrupts
from hexapod_cosim.cosim.master import COMPLETED, INTERRUPTED
from hexapod_cosim.cosim.metrics import METRICS
from hexapod_cosim.cosim.run import Result, chosen_gains, known_robot, simulate
from hexapod_cosim.cosim.scenario_records import Scenario
from hexapod_cosim.models import HexapodError, load_robot

REFUSED = "refused"  # beside the master's ways to end: the run did not begin
METHOD = "spawn"  # a fork would copy the threads' locks of this process, and numpy's
NO_FIGURES = dict.fromkeys(METRICS, math.nan)


@dataclass(frozen=True, kw_only=True)
class Summary:
    """What a run came to."""

    control: str
    seed: int
    status: str  # COMPLETED, FAILED or REFUSED
    reason: str = ""  # in words, "" when completed
    upright: bool = False  # to the end
    fallback: float | None = None  # share of time in which the controller fell back to kinematic control; None: it does not say
    warnings: tuple[str, ...] = ()
    metrics: Mapping[str, float]  # NaN where there is none; all of them unless completed

    @property
    def walked(self) -> bool:
        """Whether the run came to its end with the robot on its feet."""
        return self.status == COMPLETED and self.upright


@dataclass(frozen=True)
class _Task:
    scenario: Scenario
    fmu: Path
    gains: Gains | None


def summarise(result: Result) -> Summary:
    """A run without its recording."""
    scenario, walk = result.scenario, result.facts["walk"]
    return Summary(
        control=scenario.control, seed=scenario.seed, status=result.outcome.status, reason=result.outcome.reason, upright=walk["upright"],
        fallback=walk.get("fallback"), warnings=tuple(result.facts["warnings"]),
        metrics=dict(result.metrics) if result.completed else NO_FIGURES,
    )  # fmt: skip


def run_batch(
    scenarios: Sequence[Scenario], *, fmu: Path | None = None, gains: Gains | None = None, workers: int | None = None
) -> Generator[Summary, None, None]:
    """Runs scenarios and yields what each came to, in their order.

    The figures do not depend on `workers`, but for the wall time. Close the iterator (contextlib.closing) where the loop over it may
    be left early, by an interrupt for one: it ends the runs under way. More than one worker needs a main module that can be imported.

    Args:
        fmu: the FMU of all runs; by default one is exported for each robot, and holds for every setting.
        gains: of all compliant runs; by default designed, once for each robot and macro-step.
        workers: processes; by default one for each processor, and 1 runs everything in this one.
    """
    with TemporaryDirectory(prefix="hexapod-batch-") as folder:
        tasks = _prepare(scenarios, Path(folder), fmu=fmu, gains=gains)
        count = min(processors() if workers is None else workers, len(tasks))
        yield from map(_run_here, tasks) if count <= 1 else _run_in_processes(tasks, count)


def processors() -> int:
    """How many this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _prepare(scenarios: Sequence[Scenario], folder: Path, *, fmu: Path | None, gains: Gains | None) -> list[_Task | Summary]:
    """What the runs share, made once; a scenario for which it cannot be made is refused at once."""
    fmus: dict[str, Path] = {}
    designs: dict[tuple[str, str, float], Gains | None] = {}
    tasks: list[_Task | Summary] = []
    for scenario in scenarios:
        try:
            key = (known_robot(scenario).hash, scenario.control, scenario.macro_step)
            if key not in designs:
                designs[key] = chosen_gains(scenario, gains)
            if fmu is None and scenario.robot not in fmus:
                fmus[scenario.robot] = export_fmu(load_robot(scenario.robot), folder / f"{len(fmus)}.fmu")
        except HexapodError as error:
            tasks.append(_refused(scenario, error))
        else:
            tasks.append(_Task(scenario, fmus[scenario.robot] if fmu is None else fmu, designs[key]))
    return tasks


def _refused(scenario: Scenario, error: HexapodError) -> Summary:
    return Summary(control=scenario.control, seed=scenario.seed, status=REFUSED, reason=str(error), metrics=NO_FIGURES)


def _run(task: _Task | Summary) -> Summary:
    """A run in whatever process; an interrupted one says so by its status."""
    if isinstance(task, Summary):
        return task
    try:
        return summarise(simulate(task.scenario, fmu=task.fmu, gains=task.gains, progress=_stop_if_told))
    except HexapodError as error:
        return _refused(task.scenario, error)


def _run_here(task: _Task | Summary) -> Summary:
    summary = _run(task)
    if summary.status == INTERRUPTED:
        raise KeyboardInterrupt
    return summary


def _run_in_processes(tasks: Sequence[_Task | Summary], count: int) -> Iterator[Summary]:
    with _pool(count) as pool:
        with deaf_to_interrupts():  # the workers; they are told by us, and begin when a run is handed in
            futures = [pool.submit(_run, task) for task in tasks]
        for future in futures:
            yield _result(future)


@contextmanager
def _pool(count: int) -> Iterator[ProcessPoolExecutor]:
    """Worker processes that are gone when the block ends, however it ends."""
    context = multiprocessing.get_context(METHOD)
    stop = context.Event()
    pool = ProcessPoolExecutor(count, mp_context=context, initializer=_begin_worker, initargs=(stop,))
    try:
        yield pool
    finally:
        stop.set()
        pool.shutdown(wait=True, cancel_futures=True)


def _result(future: Future[Summary]) -> Summary:
    try:
        return future.result()
    except BrokenProcessPool as error:
        fix = "look for what ended it (memory?), or run fewer at once"
        raise HexapodError("a worker process of the batch ended by itself", fix=fix) from error


_stop: Event | None = None  # of this process, when it is a worker


def _begin_worker(stop: Event) -> None:
    global _stop  # noqa: PLW0603  the one thing a worker is told beside its tasks
    _stop = stop
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """A worker whose parent is killed would wait for work for ever."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)


def _stop_if_told(_done: float) -> None:
    """Ends the run under way; called by the master every few steps."""
    if _stop is not None and _stop.is_set():
        raise KeyboardInterrupt
