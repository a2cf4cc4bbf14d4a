"""Locks a folder against other processes without leaving a file in it."""

from __future__ import annotations

import hashlib
import os
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path

from filelock import FileLock, Timeout

if sys.platform != "win32":
    import fcntl


def lock_folder(folder: Path) -> Callable[[], object] | None:
    """Locks an existing folder; returns what releases it, or None when another process has it.

    The folder itself is locked, so that it does not matter which temporary folder a process uses.
    Where the system cannot do that, a file in the temporary folder is locked instead; where that
    is impossible as well, nothing is. The system releases the lock of a killed process.
    """
    if sys.platform != "win32":
        with suppress(OSError):  # a file system that locks no folders
            handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                os.close(handle)
                return None
            except BaseException:
                os.close(handle)
                raise
            return partial(os.close, handle)
    name = hashlib.sha256(str(folder.resolve()).encode("utf-8", "surrogatepass")).hexdigest()[:32]
    path = Path(tempfile.gettempdir()) / f"hexapod-results-{name}.lock"
    lock = FileLock(path, blocking=False, fallback_to_soft=False, thread_local=False)
    try:
        lock.acquire()
    except Timeout:
        return None
    except OSError:
        pass
    return lock.release
