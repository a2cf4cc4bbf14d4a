"""`python -m benchmarks.study [--page]`: what a study's run costs beside its walk, how two workers scale, bytes and memory per run.

Writes benchmarks/results/<machine>/study.csv; with --page the table in docs/studies.md too.
"""

from __future__ import annotations

import csv
import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pyarrow.parquet as pq

from benchmarks.run import RESULTS, machine
from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.export import export_fmu
from hexapod_cosim.cosim.files import atomic_text, write_text
from hexapod_cosim.cosim.master import COMPLETED, Progress
from hexapod_cosim.cosim.metrics import METRICS
from hexapod_cosim.cosim.run import chosen_gains
from hexapod_cosim.cosim.scenario import load_scenario
from hexapod_cosim.cosim.scenario_records import Scenario
from hexapod_cosim.cosim.study.conduct import CHUNK_TIME
from hexapod_cosim.cosim.study.manifest import RESULTS as RESULTS_FILE
from hexapod_cosim.cosim.study.manifest import TIMES
from hexapod_cosim.cosim.study.reading import study_from_table
from hexapod_cosim.cosim.study.study import Options, run_study
from hexapod_cosim.cosim.summary import Summary
from hexapod_cosim.models import load_robot

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "studies.md"
INSTANT, WAITING = "benchmarks.study:Instant", "benchmarks.study:Waiting"
BOTH = ("kinematic", "compliant")
RUNS, LARGE, BY_DASK, FEW, WALKS, WAITS, REPEATS = 20_000, 50_000, 2000, 20, 60, 100, 1
CORES, MILLION = 100, 1e6  # of the plan
# name -> unit, what it is
MEANINGS = {
    "overhead": ("ms", "of a processor, for a run that takes no time: its scenario made, sent, checked and stored"),
    "overhead_dask": ("ms", "the same through a Dask scheduler with two workers"),
    "walk_kinematic": ("ms", "of a processor, for a walk of 10 s under kinematic control, all in"),
    "walk_compliant": ("ms", "under compliant control"),
    "rate": ("1/min", "walks of 10 s, both controls, two processes, on a machine that others use too"),
    "scaling": ("1", "their rate over twice that of one process, on the same machine"),
    "scaling_waiting": ("1", "the same of runs that wait for 50 ms each: what handing out costs"),
    "bytes": ("B", "a run in results.parquet"),
    "memory": ("B", f"peak memory of the program, for each run from {RUNS} to {LARGE}"),
}
Figures = dict[str, tuple[float, str, str]]  # by name: value, unit, what it is


class Instant:
    """An engine whose walks take no time: what is left is the study's own."""

    def __init__(self, fmu: Path, controller: Path) -> None:
        self._metrics = {name: 0.123456789 * place for place, name in enumerate(METRICS)}

    def summary(self, scenario: Scenario, *, gains: Gains | None, progress: Progress) -> Summary:
        """As Engine says."""
        metrics = {name: value * (1.0 + scenario.seed) for name, value in self._metrics.items()}
        return Summary(control=scenario.control, seed=scenario.seed, status=COMPLETED, upright=True, metrics=metrics)

    def close(self) -> None:
        """Nothing to free."""


class Waiting(Instant):
    """An engine whose walks take the same time on any machine, however busy."""

    def summary(self, scenario: Scenario, *, gains: Gains | None, progress: Progress) -> Summary:
        """As Engine says."""
        time.sleep(0.05)
        return super().summary(scenario, gains=gains, progress=progress)


class Timed:
    """A study, run into a folder that is gone afterwards."""

    def __init__(self, runs: int, *, controls: tuple[str, ...] = ("kinematic",), **options: Any) -> None:
        study = study_from_table({"seeds": runs // len(controls), "controls": list(controls)}, where="bench")
        self.runs, self._stamps = runs, list[tuple[float, int]]()
        with TemporaryDirectory(prefix="hexapod-bench-") as folder:
            begin = processor_time()
            run_study(study, Path(folder), options=Options(**options), begun=self._begun)
            self.processor = processor_time() - begin  # s    of this process and the workers it waited for
            self.bytes = (Path(folder) / RESULTS_FILE).stat().st_size / runs
            self.walls = pq.read_table(Path(folder) / TIMES)["wall"].to_numpy()

    def _begun(self, _total: int, _done: int) -> Any:
        self._stamps.append((time.perf_counter(), 0))
        return lambda more, _lost: self._stamps.append((time.perf_counter(), more))

    @property
    def rate(self) -> float:
        """Runs per second, from when a tenth of them was there: workers take a while to begin."""
        done = np.cumsum([more for _, more in self._stamps])
        first = int(np.searchsorted(done, 0.1 * self.runs))
        return float((done[-1] - done[first]) / (self._stamps[-1][0] - self._stamps[first][0]))


def processor_time() -> float:
    """s    of this process and of those it has waited for"""
    return float(sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)))


def measured(fmu: Path, gains: Gains) -> Figures:
    """All figures. Processor time, of which others on the machine take nothing, and rates that were measured side by side."""
    common: dict[str, Any] = {"fmu": fmu, "gains": gains}
    many, small, large, most = *_measured_memory(RUNS, common), *_measured_memory(LARGE, common)
    by_dask = [through_cluster(runs, common) for runs in (FEW, BY_DASK)]
    walks = {control: [Timed(runs, workers=1, controls=(control,), **common) for runs in (FEW, WALKS)] for control in BOTH}
    pairs = [[Timed(WALKS, controls=BOTH, workers=count, **common) for count in (1, 2)] for _ in range(REPEATS)]
    waits = [[Timed(WAITS, engine=WAITING, workers=count, **common).rate for count in (1, 2)] for _ in range(REPEATS)]
    spent = {control: 1e3 * (more.processor - less.processor) / (WALKS - FEW) for control, (less, more) in walks.items()}
    found = {
        "overhead": 1e3 * (large.processor - many.processor) / (LARGE - RUNS),
        "overhead_dask": 1e3 * (by_dask[1] - by_dask[0]) / (BY_DASK - FEW),
        **{f"walk_{control}": value for control, value in spent.items()},
        "rate": 60.0 * max(two.rate for _, two in pairs),
        "scaling": max(two.rate / (2.0 * one.rate) for one, two in pairs),
        "scaling_waiting": max(two / (2.0 * one) for one, two in waits),
        "bytes": many.bytes,
        "memory": (most - small) / (LARGE - RUNS),
    }
    return {name: (value, *MEANINGS[name]) for name, value in found.items()}


def _measured_memory(runs: int, common: dict[str, Any]) -> tuple[Timed, float]:
    """Runs that take no time, and the peak memory after them [B]."""
    return Timed(runs, engine=INSTANT, workers=2, **common), peak_memory()


def through_cluster(runs: int, common: dict[str, Any]) -> float:
    """s    of processor for runs that take no time: program, scheduler and workers, from their start to their end"""
    begin = processor_time()
    with cluster() as address:
        Timed(runs, engine=INSTANT, scheduler=address, **common)
    return processor_time() - begin


def peak_memory() -> float:
    """B    of this process so far"""
    return 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


@contextmanager
def cluster() -> Iterator[str]:
    """A Dask scheduler with two worker processes on loopback; its address."""
    with TemporaryDirectory(prefix="hexapod-dask-") as folder:
        file = Path(folder) / "scheduler.json"
        common = ["--host", "127.0.0.1", "--no-dashboard", "--scheduler-file", str(file)]
        commands = [["dask_scheduler", "--port", "0"], *[["dask_worker", "--nthreads", "1", "--no-nanny"]] * 2]
        processes = [
            subprocess.Popen(
                [sys.executable, "-m", f"distributed.cli.{name}", *words, *common], cwd=folder, stderr=subprocess.DEVNULL,
                env={**os.environ, "PYTHONPATH": str(ROOT)},
            )
            for name, *words in commands
        ]  # fmt: skip
        try:
            while not file.exists():
                time.sleep(0.1)
            yield str(json.loads(file.read_text())["address"])
        finally:
            for process in processes:
                process.terminate()
                process.wait()


def write(figures: Figures, *, page: bool) -> Path:
    """The CSV, and the page's table if wanted."""
    path = RESULTS / machine() / "study.csv"
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_text(path) as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["name", "value", "unit", "meaning"])
        writer.writerows([name, f"{value:.4g}", unit, meaning] for name, (value, unit, meaning) in figures.items())
    if page:
        text = PAGE.read_text(encoding="utf-8")
        for name, content in (("study", table(figures)), ("plan", plan(figures))):
            begin, end = f"<!-- {name} -->", f"<!-- /{name} -->"
            head, _, rest = text.partition(begin)
            text = f"{head}{begin}\n\n{content}\n\n{end}{rest.partition(end)[2]}"
        write_text(PAGE, text)
    return path


def table(figures: Mapping[str, tuple[float, str, str]]) -> str:
    """Markdown."""
    rows = [f"| {meaning} | {value:.3g} {unit} |" for value, unit, meaning in figures.values()]
    return "\n".join(["| what | measured |", "|---|---|", *rows])


def plan(figures: Mapping[str, tuple[float, str, str]]) -> str:
    """What a million walks of 10 s, half of them under either control, come to on a hundred such cores."""
    values = {name: value for name, (value, _, _) in figures.items()}
    walk = 1e-3 * 0.5 * (values["walk_kinematic"] + values["walk_compliant"])  # s
    hours = MILLION * walk / 3600.0
    per_second = CORES / walk
    rows = [
        ("processor time", f"{hours:.0f} core hours"),
        (f"on {CORES} cores", f"{hours / CORES:.1f} h at {per_second:.0f} walks per second"),
        ("of it the study's own", f"{100.0 * values['overhead'] / (1e3 * walk):.1f} %"),
        ("results.parquet", f"{values['bytes'] * MILLION / 1e6:.0f} MB"),
        ("tasks for Dask's scheduler", f"{CORES / CHUNK_TIME:.0f} per second"),
    ]
    return "\n".join([f"| 10⁶ walks of 10 s, {CORES} such cores | |", "|---|---|", *(f"| {name} | {value} |" for name, value in rows)])


def main() -> None:
    """Measures, prints, writes."""
    with TemporaryDirectory(prefix="hexapod-bench-") as folder:
        fmu = export_fmu(load_robot("athena"), Path(folder) / "athena.fmu")
        gains = chosen_gains(load_scenario("walk_flat", overrides=["control=compliant"]))
        assert gains is not None
        figures = measured(fmu, gains)
    print(table(figures))
    print(f"wrote {write(figures, page='--page' in sys.argv[1:])}")


if __name__ == "__main__":
    main()
