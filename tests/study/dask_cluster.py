"""A Dask cluster on loopback: a scheduler and workers, each a process of its own group, gone
when the test is.
"""

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
PATIENCE = 180.0  # s    for what takes a few on an idle machine
COMMON = ("--host", "127.0.0.1", "--no-dashboard")
ONE_THREAD = ("--nthreads", "1")


@contextmanager
def running(*words: str, cwd: Path) -> Iterator[subprocess.Popen[bytes]]:
    """A Python module as a process, killed with all its children when the block ends."""
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
    """With its children."""
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


@contextmanager
def scheduling(folder: Path) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """The address of a scheduler without workers, and its process."""
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
        deadline = time.monotonic() + PATIENCE
        while (
            not (file.exists() and file.read_text().rstrip().endswith("}"))
            and time.monotonic() < deadline
        ):
            time.sleep(0.05)
        yield str(json.loads(file.read_text())["address"]), process


@contextmanager
def lasting_workers(address: str, count: int, folder: Path) -> Iterator[None]:
    """Workers that are begun anew when they die."""
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
    """Workers that stay dead; a process each."""
    with ExitStack() as opened:
        words = ("distributed.cli.dask_worker", address, "--no-nanny", *ONE_THREAD, *COMMON)
        yield [opened.enter_context(running(*words, cwd=folder)) for _ in range(count)]
