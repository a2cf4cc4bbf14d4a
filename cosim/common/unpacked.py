"""Temporary folders that a later process deletes if their own process was killed."""

from __future__ import annotations

import os
import shutil
import tempfile
import time
from contextlib import suppress
from pathlib import Path

from filelock import FileLock, Timeout

PREFIX = "hexapod-fmu-"
LOCK = ".lock"  # held as long as the folder is in use; the system releases a killed process's
SETTLED = 60.0  # s  a younger folder may not have its lock yet


class UnpackedFolder:
    """A folder in the system's temporary one. Creating it deletes those of killed processes."""

    def __init__(self) -> None:
        sweep()
        self.path = Path(tempfile.mkdtemp(prefix=PREFIX))
        self._lock = FileLock(self.path / LOCK, blocking=False, fallback_to_soft=False)
        with suppress(OSError, Timeout):  # a file system without locks: the folder is not swept
            self._lock.acquire()

    def close(self) -> None:
        """Deletes the folder; may be called twice."""
        self._lock.release()
        shutil.rmtree(self.path, ignore_errors=True)


def sweep(*, now: float | None = None) -> list[Path]:
    """Deletes the folders whose process has ended without doing so, and returns them.

    now: seconds since the epoch, for tests.
    """
    deleted = []
    present = time.time() if now is None else now
    for folder in Path(tempfile.gettempdir()).glob(f"{PREFIX}*"):
        if _is_abandoned(folder, present):
            shutil.rmtree(folder, ignore_errors=True)
            deleted.append(folder)
    return deleted


def _is_abandoned(folder: Path, now: float) -> bool:
    """Returns whether a folder is this user's, has a lock, and no process holds it."""
    try:
        facts = folder.lstat()
        own = not hasattr(os, "getuid") or facts.st_uid == os.getuid()
        lock = folder / LOCK
        if folder.is_symlink() or not own or not lock.is_file() or now - facts.st_mtime < SETTLED:
            return False
        with FileLock(lock, blocking=False, fallback_to_soft=False):
            return True
    except (OSError, Timeout):  # in use, or deleted by another process
        return False
