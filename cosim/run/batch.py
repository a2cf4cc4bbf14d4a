"""Many runs at once: scenarios in processes of their own, of which only what they come to is
sent back, not their recordings.
"""

from __future__ import annotations

import multiprocessing
import os
from collections import deque
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from functools import cache
from multiprocessing.util import Finalize
from pathlib import Path
from tempfile import TemporaryDirectory

from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.export.export import export_fmu
from hexapod_cosim.cosim.master.interrupts import blocked_interrupts
from hexapod_cosim.cosim.master.loop import INTERRUPTED
from hexapod_cosim.cosim.results.summary import Summary, refused_summary, summarise
from hexapod_cosim.cosim.run.run import chosen_gains, known_robot, simulate
from hexapod_cosim.cosim.run.walker import Walker
from hexapod_cosim.cosim.run.workers import METHOD, begin_worker, stop_if_told
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.models import HexapodError, load_robot

QUEUED = 8  # runs that wait for each worker


@dataclass(frozen=True)
class _Task:
    scenario: Scenario
    fmu: Path
    gains: Gains | None


def run_batch(
    scenarios: Sequence[Scenario],
    *,
    fmu: Path | None = None,
    gains: Gains | None = None,
    workers: int | None = None,
    compiled: bool = False,
) -> Generator[Summary, None, None]:
    """Runs scenarios and yields what each came to, in their order.

    The figures do not depend on `workers`, but for the wall time. Close the iterator
    (contextlib.closing) where the loop over it may be left early, by an interrupt for one: it ends
    the runs under way. More than one worker needs a main module that can be imported.

    Args:
        fmu: the FMU of all runs; by default one is exported for each robot, and holds for every
            setting.
        gains: of all compliant runs; by default designed, once for each robot and macro-step.
        workers: processes; by default one for each processor, and 1 runs everything in this one.
        compiled: with the controller's FMU instead of the Python controller: some ten times as
            fast, figures equal to its last digits.
    """
    with TemporaryDirectory(prefix="hexapod-batch-") as folder:
        tasks = _prepare(scenarios, Path(folder), fmu=fmu, gains=gains)
        count = min(processors() if workers is None else workers, len(tasks))
        yield from (
            _run_here(tasks, compiled=compiled)
            if count <= 1
            else _run_in_processes(tasks, count, compiled=compiled)
        )


def processors() -> int:
    """How many this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _prepare(
    scenarios: Sequence[Scenario], folder: Path, *, fmu: Path | None, gains: Gains | None
) -> list[_Task | Summary]:
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
                fmus[scenario.robot] = export_fmu(
                    load_robot(scenario.robot), folder / f"{len(fmus)}.fmu"
                )
        except HexapodError as error:
            tasks.append(refused_summary(scenario, error))
        else:
            tasks.append(
                _Task(scenario, fmus[scenario.robot] if fmu is None else fmu, designs[key])
            )
    return tasks


def _run(task: _Task | Summary, walker: Walker | None) -> Summary:
    """A run in whatever process; an interrupted one says so by its status."""
    if isinstance(task, Summary):
        return task
    if walker is not None:
        return walker.summary(task.scenario, fmu=task.fmu, gains=task.gains, progress=stop_if_told)
    try:
        return summarise(
            simulate(task.scenario, fmu=task.fmu, gains=task.gains, progress=stop_if_told)
        )
    except HexapodError as error:
        return refused_summary(task.scenario, error)


def _run_here(tasks: Sequence[_Task | Summary], *, compiled: bool) -> Iterator[Summary]:
    with Walker() if compiled else nullcontext() as walker:
        for task in tasks:
            summary = _run(task, walker)
            if summary.status == INTERRUPTED:
                raise KeyboardInterrupt
            yield summary


def _run_in_processes(
    tasks: Sequence[_Task | Summary], count: int, *, compiled: bool
) -> Iterator[Summary]:
    with _pool(count) as pool:
        waiting: deque[Future[Summary]] = deque()
        for task in tasks:
            with (
                blocked_interrupts()
            ):  # the workers; they are told by us, and begin when a run is handed in
                waiting.append(pool.submit(_work, task, compiled))
            if len(waiting) > QUEUED * count:
                yield _result(waiting.popleft())
        while waiting:
            yield _result(waiting.popleft())


def _work(task: _Task | Summary, compiled: bool) -> Summary:
    """A run in a worker."""
    return _run(task, _own_walker() if compiled else None)


@cache
def _own_walker() -> Walker:
    """This worker's, freed when it ends."""
    walker = Walker()
    Finalize(walker, walker.close, exitpriority=1)
    return walker


@contextmanager
def _pool(count: int) -> Iterator[ProcessPoolExecutor]:
    """Worker processes that are gone when the block ends, however it ends."""
    context = multiprocessing.get_context(METHOD)
    stop = context.Event()
    pool = ProcessPoolExecutor(
        count, mp_context=context, initializer=begin_worker, initargs=(stop,)
    )
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
