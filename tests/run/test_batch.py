"""Batches of runs: figures do not depend on the processes, and no run or process is left over."""

from __future__ import annotations

import json
import math
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from contextlib import closing, suppress
from dataclasses import replace
from pathlib import Path

import pytest
from command import COMMAND, settings

from hexapod_cosim.cosim.master.loop import COMPLETED, FAILED
from hexapod_cosim.cosim.results.summary import REFUSED, Summary, summarise
from hexapod_cosim.cosim.run.batch import run_batch
from hexapod_cosim.cosim.run.single_run import simulate
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.cosim.scenario.variation import STANDARD
from hexapod_cosim.models import HexapodError

TIMEOUT = 180.0  # s    for what takes a second or two on an idle machine


def short(*changes: str) -> Scenario:
    scenario = load_scenario("walk_flat", overrides=["duration=1.2", "gait.period=0.4", *changes])
    return replace(scenario, variation=STANDARD)


def steady(summary: Summary) -> Summary:
    """Returns the summary without the realtime factor, which depends on the machine, and NaNs."""
    figures = {
        name: value
        for name, value in summary.metrics.items()
        if name != "realtime_factor" and math.isfinite(value)
    }
    return replace(summary, metrics=figures)


def test_runs_come_in_order_and_do_not_depend_on_the_processes(plant_build: Path) -> None:
    kinds = (
        (2, "kinematic", "athena"),
        (0, "compliant", "athena"),
        (1, "kinematic", "phantomx_mk4"),
    )
    plans = [
        replace(short(f"control={control}", f"robot={robot}"), seed=seed)
        for seed, control, robot in kinds
    ]
    serial, parallel = (
        list(run_batch(plans, workers=workers, compiled=True)) for workers in (1, 2)
    )
    assert [(run.seed, run.control) for run in serial] == [
        (plan.seed, plan.control) for plan in plans
    ]
    assert list(map(steady, serial)) == list(map(steady, parallel))
    assert all(run.walked for run in serial)
    assert serial[0].metrics["slip_per_metre"] != serial[1].metrics["slip_per_metre"]
    (single,) = run_batch(plans[:1], workers=1)
    assert steady(single) == steady(summarise(simulate(plans[0])))


def test_a_run_that_fails_or_cannot_begin_says_why_and_the_others_go_on(plant_build: Path) -> None:
    endless = "events=[{time=0.1, duration=0.1, force=[1e8, 1e8, 1e8], torque=[1e8, 1e8, 1e8]}]"
    plans = [
        short(),
        short("command.vx=10"),
        short("robot=nowhere.toml"),
        short("solver.method=dp54", "solver.step=0.002", endless),
        short(),
    ]
    runs = list(run_batch(plans, workers=2))
    assert [run.status for run in runs] == [COMPLETED, REFUSED, REFUSED, FAILED, COMPLETED]
    assert "do not reach" in runs[1].reason
    assert "nowhere.toml" in runs[2].reason
    assert "not finite" in runs[3].reason
    assert not any(run.walked for run in runs[1:4])
    assert steady(runs[0]) == steady(runs[4])


# a control whose walk of a minute takes ten minutes, and no processor time
SLOW = """
import time

class Slow:
    def step(self, t, command, measurement):
        time.sleep(0.05)
        return measurement.angle.copy()
"""


def test_leaving_a_batch_early_ends_the_runs_under_way(plant_build: Path, tmp_path: Path) -> None:
    law = tmp_path / "law.py"
    law.write_text(SLOW)
    plans = [short(), *[short(f"control={law}:Slow", "duration=60")] * 400]
    with closing(run_batch(plans, workers=2)) as runs:
        assert next(runs).walked
    assert multiprocessing.active_children() == []


def alive(group: int) -> bool:
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


def _enable_interrupts() -> None:
    """Undoes that a test run in the background ignores interrupts, as its children do then."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def start_comparison(folder: Path) -> subprocess.Popen[str]:
    """Starts a comparison in a process group of its own and waits until its batch runs."""
    long = "duration=20"  # 400 such runs take minutes
    plain = settings(long, "gait.period=0.4", "outputs.csv=['torso.roll']")
    command = [*COMMAND, "compare", "walk_flat", "-o", str(folder), "--seeds", "200", *plain]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
        preexec_fn=_enable_interrupts,  # noqa: PLW1509  no other thread runs here
    )  # fmt: skip
    deadline = time.monotonic() + TIMEOUT
    done = folder / "compliant" / "run.json"
    while time.monotonic() < deadline and not (
        done.exists() and json.loads(done.read_text())["status"] == COMPLETED
    ):
        time.sleep(0.05)
    while time.monotonic() < deadline and not is_in_batch(process.pid):
        time.sleep(0.05)
    return process


def is_in_batch(group: int) -> bool:
    """Tells whether a worker has used a second of processor time: it has imported the package and
    runs walks.
    """
    ticks = os.sysconf("SC_CLK_TCK")
    for file in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):  # the process has ended meanwhile
            fields = file.read_text().rpartition(")")[2].split()
            used = int(fields[11]) + int(fields[12])  # in user and system mode
            if int(fields[2]) == group and int(file.parent.name) != group and used > ticks:
                return True
    return False


def assert_none_left(group: int) -> None:
    deadline = time.monotonic() + TIMEOUT
    while alive(group) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not alive(group)


def test_an_interrupted_comparison_keeps_whole_runs_and_leaves_no_process(
    plant_build: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "out"
    process = start_comparison(folder)
    try:
        os.killpg(process.pid, signal.SIGINT)
        out, err = process.communicate(timeout=TIMEOUT)
        assert_none_left(process.pid)
    finally:
        process.kill()
    assert (process.returncode, out) == (130, "")
    assert "Traceback" not in err
    assert json.loads((folder / "run.json").read_text())["status"] == "interrupted"
    assert (folder / "kinematic" / "results.csv").is_file()
    assert not (folder / "seeds.csv").exists()


@pytest.mark.skipif(sys.platform == "win32", reason="no such signal")
def test_a_worker_that_dies_each_time_is_reported_with_its_run(
    plant_build: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hexapod_cosim.cosim.run.worker_pool.TRIES", 1)
    plans = [replace(short(), seed=7), *[replace(short(), duration=60.0, seed=8)] * 5]
    with closing(run_batch(plans, workers=2)) as runs:
        assert next(runs).walked
        for child in multiprocessing.active_children():
            child.kill()
        with pytest.raises(HexapodError, match=r"worker process of the batch.*seed 8, kinematic"):
            list(runs)
    assert multiprocessing.active_children() == []
