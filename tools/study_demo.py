"""Shows for `make study-demo` that a study gives the same rows however it is executed.

A study of 500 runs is killed twice and completed, run without interruption, and run on a Dask
cluster.

usage: python -m tools.study_demo FOLDER
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pyarrow.parquet as pq

STUDY = """title = "500 walks, killed twice"
scenario = "walk_flat"
seeds = 10
[set]
duration = 4.0
[factors]
friction.mu = [0.3, 0.45, 0.6, 0.75, 0.9]
command.vx = { linspace = [4, 12, 5], unit = "cm/s" }
"""
KILLED_AT = (100, 300)  # stored runs


def main() -> int:
    """Returns 0 when all three results are the same, 2 for wrong usage."""
    if len(sys.argv) != 2:
        print(__doc__, file=sys.stderr)
        return 2
    folder = Path(sys.argv[1])
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    (folder / "study.toml").write_text(STUDY, encoding="utf-8")
    for least in KILLED_AT:
        kill_at(folder, least)
    finish(folder, "killed")
    finish(folder, "uninterrupted")
    with cluster(folder) as address:
        finish(folder, "cluster", "--scheduler", address)
    names = ("killed", "uninterrupted", "cluster")
    found = [pq.read_table(folder / name / "results.parquet") for name in names]
    same = all(table.equals(found[0]) for table in found)
    print(f"{', '.join(names)}: {'the same rows' if same else 'NOT the same rows'}")
    print(f"report: {folder}/killed/report.html")
    return 0 if same else 1


def command(folder: Path, name: str, *more: str) -> list[str]:
    """Returns the command that runs the study into a folder within the given one."""
    return [
        sys.executable,
        "-m",
        "hexapod_cosim.cosim.cli",
        "study",
        str(folder / "study.toml"),
        "-o",
        str(folder / name),
        *more,
    ]


def kill_at(folder: Path, least: int) -> None:
    """Starts the study and kills it with its workers when `least` runs are stored."""
    process = subprocess.Popen(
        command(folder, "killed"),
        start_new_session=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    while stored(folder) < least and process.poll() is None:
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    print(f"killed with {stored(folder)} of 500 runs stored", flush=True)


def stored(folder: Path) -> int:
    """Returns the number of stored runs of the study that is killed."""
    file = folder / "killed" / "runs.sqlite"
    if not file.exists():
        return 0
    with closing(sqlite3.connect(file, timeout=60.0)) as database:
        try:
            return int(database.execute("SELECT count(*) FROM runs").fetchone()[0])
        except sqlite3.OperationalError:  # the table is not there yet
            return 0


def finish(folder: Path, name: str, *more: str) -> None:
    """Runs a study to its end and prints its duration."""
    begin = time.monotonic()
    done = subprocess.run(
        command(folder, name, "--json", *more), check=True, stdout=subprocess.PIPE
    )
    summary = json.loads(done.stdout)
    duration = time.monotonic() - begin
    print(
        f"{name}: {summary['runs']} runs, walked {summary['walked']}, in {duration:.0f} s",
        flush=True,
    )


@contextmanager
def cluster(folder: Path) -> Iterator[str]:
    """Starts a Dask scheduler and two workers on loopback; yields the scheduler's address."""
    file = (folder / "scheduler.json").resolve()
    common = ["--host", "127.0.0.1", "--no-dashboard", "--scheduler-file", str(file)]
    starts = (
        ["dask_scheduler", "--port", "0"],
        ["dask_worker", "--nworkers", "2", "--nthreads", "1"],
    )
    processes = [
        subprocess.Popen(
            [sys.executable, "-m", f"distributed.cli.{name}", *words, *common],
            cwd=folder,
            start_new_session=True,
            stderr=subprocess.DEVNULL,
        )
        for name, *words in starts
    ]
    try:
        while not file.exists():
            time.sleep(0.1)
        yield str(json.loads(file.read_text(encoding="utf-8"))["address"])
    finally:
        for process in processes:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


if __name__ == "__main__":
    sys.exit(main())
