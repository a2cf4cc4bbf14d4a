"""Tests the executors, which return the results of all tasks, and interrupts, which are neither
lost in callbacks nor handled where they must wait.
"""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from hexapod_cosim.cosim.run.worker_pool import (
    TRIES,
    SerialExecutor,
    WorkerDiedError,
    WorkerPool,
    raise_if_stopped,
)

DEADLY = 5  # the task that ends its process
TASKS = [0, 1, 2, 3, 4]
SQUARES = [0, 1, 4, 9, 16]


def square(task: int) -> int:
    if task == DEADLY:
        os._exit(9)
    return task * task


def wait_for_stop(_task: int) -> bool:
    try:
        while True:
            raise_if_stopped(0.0)
            time.sleep(0.01)
    except KeyboardInterrupt:
        return True


def set_variable() -> None:
    os.environ["HEXAPOD_TEST_POOL"] = "initialised"


def read_environment() -> tuple[str, str]:
    import tempfile  # noqa: PLC0415

    return os.environ["HEXAPOD_TEST_POOL"], tempfile.gettempdir()


def test_all_executors_return_the_same_results() -> None:
    assert list(SerialExecutor().map(square, TASKS)) == SQUARES
    with WorkerPool(2) as pool:
        assert list(pool.map(square, TASKS)) == SQUARES
    assert multiprocessing.active_children() == []


def test_a_script_that_its_worker_processes_would_run_again_is_refused(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    lines = [
        "from hexapod_cosim.cosim.run.worker_pool import WorkerPool",
        "with WorkerPool(2) as pool:",
        "    print(list(pool.map(abs, [-1, 2])))",
    ]
    command = [sys.executable, str(script)]
    script.write_text("\n".join(lines))
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (1, "")
    assert "worker processes would run the script again: got '" in done.stderr
    assert 'expected calls below `if __name__ == "__main__":`' in done.stderr
    lines[1] = f'if __name__ == "__main__":\n  {lines[1]}'
    script.write_text("\n".join(lines))
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == ("[1, 2]\n", "")


def test_a_task_that_ends_every_process_has_an_error_and_the_others_are_finished() -> None:
    with WorkerPool(1) as pool:
        futures = [pool.submit(square, task) for task in (4, DEADLY, 6, 7)]
        with pytest.raises(WorkerDiedError, match="ended by itself"):
            futures.pop(1).result()
        assert [future.result() for future in futures] == [16, 36, 49]
        assert len(pool._processes) == 1 + TRIES


def test_closing_a_pool_stops_its_tasks() -> None:
    with WorkerPool(1) as pool:
        running, waiting = pool.submit(wait_for_stop, 0), pool.submit(wait_for_stop, 1)
        while not running.running():
            time.sleep(0.01)
    assert running.result()
    assert waiting.cancelled()
    assert multiprocessing.active_children() == []


def test_workers_are_initialised_and_use_the_scratch_folder(tmp_path: Path) -> None:
    with WorkerPool(1, initialise=set_variable, scratch=tmp_path) as pool:
        assert pool.submit(read_environment).result() == ("initialised", str(tmp_path))
    assert "HEXAPOD_TEST_POOL" not in os.environ


def test_an_error_in_a_task_is_raised_by_its_future() -> None:
    with WorkerPool(1) as pool:
        for executor in (pool, SerialExecutor()):
            with pytest.raises(ValueError, match="seven"):
                executor.submit(int, "seven").result()
