"""The worker pool: results of all tasks, and the task of a worker that dies."""

from __future__ import annotations

import multiprocessing
import os
import time
from pathlib import Path

import pytest

from hexapod_cosim.cosim.run.worker_pool import (
    DIED,
    Finished,
    InProcessExecutor,
    TaskExecutor,
    raise_if_stopped,
    worker_pool,
)

DEADLY = 5  # the task that ends its process


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


def read_environment(_task: int) -> tuple[str, str]:
    import tempfile  # noqa: PLC0415

    return os.environ["HEXAPOD_TEST_POOL"], tempfile.gettempdir()


def run_all(executor: TaskExecutor[int, int], tasks: list[int]) -> list[Finished[int, int]]:
    """Runs tasks and returns them in the order of the tasks."""
    for task in tasks:
        executor.submit(task)
    finished: list[Finished[int, int]] = []
    while len(finished) < len(tasks):
        finished += executor.wait()
    return sorted(finished, key=lambda item: item.task)


def test_all_executors_return_the_same_results() -> None:
    tasks = [0, 1, 2, 3, 4]
    expected = [Finished(0, 0), Finished(1, 1), Finished(2, 4), Finished(3, 9), Finished(4, 16)]
    assert run_all(InProcessExecutor(square), tasks) == expected
    for size in (1, 2):
        with worker_pool(size, square) as pool:
            assert run_all(pool, tasks) == expected
    assert multiprocessing.active_children() == []


def test_the_task_of_a_dead_worker_is_named_and_the_others_are_finished() -> None:
    with worker_pool(1, square) as pool:
        finished = run_all(pool, [4, DEADLY, 6, 7])
    deaths = [item for item in finished if item.death]
    assert deaths == [Finished(DEADLY, None, death=DIED)]
    assert [item.result for item in finished if not item.death] == [16, 36, 49]


def test_closing_a_pool_stops_its_tasks() -> None:
    with worker_pool(1, wait_for_stop) as pool:
        pool.submit(0)
    assert multiprocessing.active_children() == []


def test_workers_are_initialised_and_use_the_scratch_folder(tmp_path: Path) -> None:
    with worker_pool(1, read_environment, initialise=set_variable, scratch=tmp_path) as pool:
        pool.submit(0)
        (finished,) = pool.wait()
    assert finished.result == ("initialised", str(tmp_path))
    assert "HEXAPOD_TEST_POOL" not in os.environ


def test_an_error_in_a_task_is_raised_by_wait() -> None:
    with worker_pool(1, int) as pool:
        pool.submit("seven")
        with pytest.raises(ValueError, match="seven"):
            pool.wait()
