"""Measures a study: overhead per run, scaling to two workers, bytes and memory per run.

usage: python -m benchmarks.study

Writes benchmarks/results/<machine>/study.csv.
"""

from __future__ import annotations

import csv
import json
import os
import resource
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

import numpy as np

from benchmarks import RESULTS, machine
from benchmarks.instant import Instant
from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.common.files import atomic_text, write_text
from hexapod_cosim.cosim.export.plant_export import export_fmu
from hexapod_cosim.cosim.run.preparation import chosen_gains
from hexapod_cosim.cosim.run.walker import Walker
from hexapod_cosim.cosim.scenario.scenario import load_scenario
from hexapod_cosim.cosim.scenario.variation import STANDARD
from hexapod_cosim.extensions.study import dispatch
from hexapod_cosim.extensions.study.folder import RESULTS as RESULTS_FILE
from hexapod_cosim.extensions.study.reading import study_from_table
from hexapod_cosim.extensions.study.report.page import write_study_report
from hexapod_cosim.extensions.study.study import Options, run_study
from hexapod_cosim.extensions.study.summary import read_results
from hexapod_cosim.models import load_robot

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "studies.md"
BOTH = ("kinematic", "compliant")
RUNS, LARGE, BY_DASK, TASKS, FEW, WALKS, REPEATS = 20_000, 50_000, 2000, 600, 20, 360, 3
DEFAULT: dict[str, Any] = {}
# settings of the solver by name: docs/studies.md says what they cost in accuracy
SOLVERS: dict[str, dict[str, Any]] = {
    "": {"solver.method": "ros2", "solver.tolerance": 3e-3},
    "_coarse": {"solver.method": "ros2", "solver.tolerance": 1e-2},
    "_default": DEFAULT,
}
SOLVER_NAMES = {"": "ros2 at 3e-3", "_coarse": "ros2 at 1e-2", "_default": "the default solver"}
# name -> unit, what it is
MEANINGS = {
    **{
        f"rate{key}": (
            "1/min",
            f"walks of 10 s, both controls, two processes, {name}: best of {REPEATS}",
        )
        for key, name in SOLVER_NAMES.items()
    },
    "rate_median": ("1/min", "the median of those of the first row"),
    **{
        f"walk_{control}{key}": (
            "ms",
            f"of a processor, for a walk of 10 s under {control} control, all in, {name}",
        )
        for key, name in SOLVER_NAMES.items()
        for control in BOTH
    },
    "scaling": ("1", "two workers' rate over twice one's"),
    "scaling_free": ("1", "two programs without any study over twice one: what the machine gives"),
    "overhead": (
        "ms",
        "of a processor, for a run that takes no time: its scenario made, sent, checked and stored",
    ),
    "handed_out": (
        "1/s",
        "runs that take no time, handed out and stored by one program with two workers",
    ),
    "overhead_dask": (
        "ms",
        "of a processor, for a run that takes no time,"
        " through a Dask scheduler with two workers, in chunks",
    ),
    "task_dask": ("ms", "of a processor, for a task of one such run: client, scheduler and worker"),
    "finish": (
        "ms",
        "of a processor, for each run when all are there: put in order, read, added up, reported",
    ),
    "bytes": ("B", "a run in results.parquet"),
    "memory": ("B", f"peak memory of the program, for each run from {RUNS} to {LARGE}"),
}
AIMS = {
    "rate": "3,000",
    "rate_coarse": "3,000",
    "scaling": "0.9",
    "overhead": "< 5 ms",
    "overhead_dask": "< 5 ms",
}
# all other figures are the overhead of the study
Figures = dict[str, tuple[float, str, str]]  # by name: value, unit, what it is


class Timed:
    """Runs a study in a temporary folder and measures it."""

    def __init__(
        self,
        runs: int,
        *,
        controls: tuple[str, ...] = ("kinematic",),
        settings: Mapping[str, Any] = DEFAULT,
        report: bool = False,
        **options: Any,
    ) -> None:
        table = {
            "seeds": runs // len(controls),
            "controls": list(controls),
            "variation": True,
            "set": dict(settings),
        }
        self.runs, self._stamps = runs, list[tuple[float, int]]()
        with TemporaryDirectory(prefix="hexapod-bench-") as folder:
            begin = processor_time()
            run_study(
                study_from_table(table, where="bench"),
                Path(folder),
                options=Options(**options),
                start=self._begun,
            )
            # s    of this process and the workers it waited for
            self.processor = processor_time() - begin
            self.bytes = (Path(folder) / RESULTS_FILE).stat().st_size / runs
            if report:
                write_study_report(read_results(Path(folder)), Path(folder))
            self.reported = processor_time() - begin  # s    the report included

    def _begun(self, _total: int, _done: int) -> Any:
        self._stamps.append((time.perf_counter(), 0))
        return lambda more, _lost: self._stamps.append((time.perf_counter(), more))

    @property
    def rate(self) -> float:
        """Runs per second between the first and the last tenth, because workers need time to
        start.
        """
        times, counts = np.array(self._stamps).T
        done = np.cumsum(counts)
        first, last = np.searchsorted(done, [0.1 * self.runs, 0.9 * self.runs])
        return float((done[last] - done[first]) / (times[last] - times[first]))


def processor_time() -> float:
    """Returns the processor time of this process and of its finished child processes [s]."""
    return float(
        sum(
            sum(resource.getrusage(who)[:2])
            for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
        )
    )


def measured(fmu: Path, gains: Gains) -> Figures:
    """Returns all figures: processor times, which other programs hardly change, and rates."""
    common: dict[str, Any] = {"fmu": fmu, "gains": gains}
    found = _own_costs(common) | _walk_costs(common) | _rates(common)
    return {name: (found[name], *MEANINGS[name]) for name in MEANINGS}


def _own_costs(common: dict[str, Any]) -> dict[str, float]:
    """Returns the overhead of a study, from the difference between many and few runs of no
    duration.
    """
    many, small, large, most = *_measured_memory(RUNS, common), *_measured_memory(LARGE, common)
    by_dask = [through_cluster(runs, common) for runs in (FEW, BY_DASK)]
    with patch.object(dispatch, "CHUNK_TIME", 0.0):  # chunks of one run
        tasks = [through_cluster(runs, common) for runs in (FEW, TASKS)]
    report = [item.reported - item.processor for item in (many, large)]
    return {
        "overhead": 1e3 * (large.processor - many.processor) / (LARGE - RUNS),
        "handed_out": large.rate,
        "overhead_dask": 1e3 * (by_dask[1] - by_dask[0]) / (BY_DASK - FEW),
        "task_dask": 1e3 * (tasks[1] - tasks[0]) / (TASKS - FEW),
        "finish": 1e3 * (report[1] - report[0]) / (LARGE - RUNS),
        "bytes": many.bytes,
        "memory": (most - small) / (LARGE - RUNS),
    }


def _walk_costs(common: dict[str, Any]) -> dict[str, float]:
    found = {}
    for key, settings in SOLVERS.items():
        for control in BOTH:
            less, more = (
                Timed(runs, workers=1, controls=(control,), settings=settings, **common).processor
                for runs in (FEW, FEW + WALKS // 4)
            )
            found[f"walk_{control}{key}"] = 1e3 * (more - less) / (WALKS // 4)
    return found


def _rates(common: dict[str, Any]) -> dict[str, float]:
    """Returns rates per minute and ratios of rates.

    Rates are the best of all repeats, because noise only lowers them; ratios are medians.
    """
    rates: dict[str, list[float]] = {
        name: [] for name in (*(f"rate{key}" for key in SOLVERS), "scaling", "scaling_free")
    }
    for _ in range(REPEATS):
        for key, settings in SOLVERS.items():
            rates[f"rate{key}"].append(
                60.0 * Timed(WALKS, controls=BOTH, workers=2, settings=settings, **common).rate
            )
        alone = 60.0 * Timed(WALKS, controls=BOTH, workers=1, settings=SOLVERS[""], **common).rate
        rates["scaling"].append(rates["rate"][-1] / (2.0 * alone))
        rates["scaling_free"].append(free_rate(2, common) / (2.0 * free_rate(1, common)))
    best = {name: max(values) for name, values in rates.items() if name.startswith("rate")}
    return (
        {name: statistics.median(values) for name, values in rates.items()}
        | best
        | {"rate_median": statistics.median(rates["rate"])}
    )


def free_rate(count: int, common: dict[str, Any]) -> float:
    """Returns walks per second of `count` independent processes without a study."""
    context = get_context("spawn")
    together = context.Barrier(count)
    with ProcessPoolExecutor(
        count, mp_context=context, initializer=_meet_at, initargs=(together,)
    ) as processes:
        futures = [
            processes.submit(walk_alone, common["fmu"], common["gains"]) for _ in range(count)
        ]
        return sum(future.result() for future in futures)


_together: Any = None  # the barrier at which a process of `free_rate` waits for the others


def _meet_at(barrier: Any) -> None:
    global _together  # noqa: PLW0603  an initializer cannot pass it otherwise
    _together = barrier


def walk_alone(fmu: Path, gains: Gains) -> float:
    """Returns walks per second of this process."""
    settings = [f"{name}={value}" for name, value in SOLVERS[""].items()]
    plans = [
        load_scenario("walk_flat", overrides=[f"control={control}", *settings]) for control in BOTH
    ]
    with Walker(fmu=fmu) as walker:
        for plan in plans:
            walker.summary(plan, gains=gains)
        _together.wait()
        begin = time.perf_counter()
        for seed in range(WALKS // 8):
            for plan in plans:
                walker.summary(replace(plan, seed=seed, variation=STANDARD), gains=gains)
        return 2 * (WALKS // 8) / (time.perf_counter() - begin)


def _measured_memory(runs: int, common: dict[str, Any]) -> tuple[Timed, float]:
    """Measures runs of no duration; returns them and the peak memory after their report [B]."""
    return Timed(runs, runner=Instant, workers=2, report=True, **common), peak_memory()


def through_cluster(runs: int, common: dict[str, Any]) -> float:
    """Returns the processor time of runs of no duration [s].

    It includes program, scheduler and workers, from their start to their end.
    """
    begin = processor_time()
    with cluster() as address:
        Timed(runs, runner=Instant, scheduler=address, **common)
    return processor_time() - begin


def peak_memory() -> float:
    """Returns the peak memory of this process [B]."""
    return 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


@contextmanager
def cluster() -> Iterator[str]:
    """Starts a Dask scheduler with two workers on loopback; yields its address."""
    with TemporaryDirectory(prefix="hexapod-dask-") as folder:
        file = Path(folder) / "scheduler.json"
        common = ["--host", "127.0.0.1", "--no-dashboard", "--scheduler-file", str(file)]
        commands = [
            ["dask_scheduler", "--port", "0"],
            *[["dask_worker", "--nthreads", "1", "--no-nanny"]] * 2,
        ]
        processes = [
            subprocess.Popen(
                [sys.executable, "-m", f"distributed.cli.{name}", *words, *common],
                cwd=folder,
                stderr=subprocess.DEVNULL,
                env={**os.environ, "PYTHONPATH": str(ROOT)},
            )
            for name, *words in commands
        ]
        try:
            while not (file.exists() and file.read_text().rstrip().endswith("}")):
                time.sleep(0.1)
            yield str(json.loads(file.read_text())["address"])
        finally:
            for process in processes:
                process.terminate()
                process.wait()


def write(figures: Figures) -> Path:
    """Writes the CSV file and returns its path."""
    path = RESULTS / machine() / "study.csv"
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_text(path) as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["name", "value", "unit", "meaning"])
        writer.writerows(
            [name, f"{value:.4g}", unit, meaning]
            for name, (value, unit, meaning) in figures.items()
        )
    return path


def put_in_page(contents: Mapping[str, str]) -> None:
    """Replaces parts of docs/studies.md, each between its own marks."""
    text = PAGE.read_text(encoding="utf-8")
    for name, content in contents.items():
        begin, end = f"<!-- {name} -->", f"<!-- /{name} -->"
        head, _, rest = text.partition(begin)
        text = f"{head}{begin}\n\n{content}\n\n{end}{rest.partition(end)[2]}"
    write_text(PAGE, text)


def table(figures: Mapping[str, tuple[float, str, str]], names: Sequence[str]) -> str:
    """Returns a table of figures in Markdown."""
    lines = ["| what | measured | aim |", "|---|---|---|"]
    for name in names:
        value, unit, meaning = figures[name]
        text = f"{value:,.0f}" if abs(value) >= 1000.0 else f"{value:.3g}"
        lines.append(
            f"| {meaning} | {text}{'' if unit == '1' else f' {unit}'} | {AIMS.get(name, '')} |"
        )
    return "\n".join(lines)


def main() -> None:
    """Measures, prints and writes all figures."""
    with TemporaryDirectory(prefix="hexapod-bench-") as folder:
        fmu = export_fmu(load_robot("athena"), Path(folder) / "athena.fmu")
        gains = chosen_gains(load_scenario("walk_flat", overrides=["control=compliant"]))
        assert gains is not None
        figures = measured(fmu, gains)
    print(table(figures, list(MEANINGS)))
    print(f"wrote {write(figures)}")


if __name__ == "__main__":
    main()
