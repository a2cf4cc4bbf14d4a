"""Processes that work for this one: begun anew rather than forked, told when to stop, gone when
this one is.
"""

from __future__ import annotations

import multiprocessing
import os
import shutil
from multiprocessing.connection import wait
from multiprocessing.synchronize import Event
from pathlib import Path
from threading import Thread

METHOD = "spawn"  # a fork would copy the threads' locks of this process, and numpy's

_stop: Event | None = None  # of this process, when it is a worker


def begin_worker(stop: Event, scratch: Path | None = None) -> None:
    """Makes this process a worker that ends its run when `stop` is set, and itself when its
    parent is gone, with the folder of both.
    """
    global _stop  # noqa: PLW0603  the one thing a worker is told beside its tasks
    # commands without workers begin sooner without it
    from threadpoolctl import threadpool_limits  # noqa: PLC0415

    _stop = stop
    threadpool_limits(1)  # there is a worker for each processor
    Thread(target=_end_with_parent, args=(scratch,), daemon=True).start()


def _end_with_parent(scratch: Path | None) -> None:
    """A worker whose parent is killed would wait for work for ever."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        if scratch is not None:
            shutil.rmtree(scratch, ignore_errors=True)
        os._exit(1)


def stop_if_told(_done: float) -> None:
    """Ends the run under way; called by the master every few steps."""
    if _stop is not None and _stop.is_set():
        raise KeyboardInterrupt
