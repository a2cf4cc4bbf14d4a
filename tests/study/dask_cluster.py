"""A Dask cluster on loopback: a scheduler and workers in processes that end with the test."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HELPERS = os.pathsep.join(str(ROOT / "tests" / room) for room in ("support", "study"))
TIMEOUT = 180.0  # s    for what takes some seconds on an idle machine
COMMON = ("--host", "127.0.0.1", "--no-dashboard")
ONE_THREAD = ("--nthreads", "1")


@contextmanager
def running(*words: str, cwd: Path) -> Iterator[subprocess.Popen[bytes]]:
    """Runs a Python module as a process, killed with its children when the block ends."""
    process = subprocess.Popen(
        [sys.executable, "-m", *words],
        cwd=cwd,
        env={**os.environ, "PYTHONPATH": HELPERS},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        yield process
    finally:
        kill(process)


def kill(process: subprocess.Popen[bytes]) -> None:
    """Kills a process with its children."""
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


@contextmanager
def dask_scheduler(folder: Path) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """Starts a scheduler without workers; yields its address and its process."""
    file = folder / "scheduler.json"
    with running(
        "distributed.cli.dask_scheduler",
        "--port",
        "0",
        *COMMON,
        "--scheduler-file",
        str(file),
        cwd=folder,
    ) as process:
        deadline = time.monotonic() + TIMEOUT
        while (
            not (file.exists() and file.read_text().rstrip().endswith("}"))
            and time.monotonic() < deadline
        ):
            time.sleep(0.05)
        yield str(json.loads(file.read_text())["address"]), process


@contextmanager
def restarting_workers(address: str, count: int, folder: Path) -> Iterator[None]:
    """Starts workers that are restarted when they die."""
    with running(
        "distributed.cli.dask_worker",
        address,
        "--nworkers",
        str(count),
        *ONE_THREAD,
        *COMMON,
        cwd=folder,
    ):
        yield


@contextmanager
def mortal_workers(
    address: str, count: int, folder: Path
) -> Iterator[list[subprocess.Popen[bytes]]]:
    """Starts workers that are not restarted when they die; yields a process for each."""
    with ExitStack() as opened:
        words = ("distributed.cli.dask_worker", address, "--no-nanny", *ONE_THREAD, *COMMON)
        yield [opened.enter_context(running(*words, cwd=folder)) for _ in range(count)]
