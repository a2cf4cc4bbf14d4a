"""Temporary folders that a later process deletes if their own process was killed."""

from __future__ import annotations

import os
import shutil
import tempfile
import time
import weakref
from contextlib import suppress
from pathlib import Path

from filelock import FileLock, Timeout

PREFIX = "hexapod-"
LOCK = ".lock"  # held as long as the folder is in use; the system releases a killed process's
SETTLED = 60.0  # s  a younger folder may not have its lock yet


class TemporaryFolder:
    """A folder in the system's temporary one. Creating it deletes those of killed processes.

    As a context manager it returns the folder's path. What is not closed is deleted when the
    process ends.

    Args:
        use: a word for the folder's name.
    """

    def __init__(self, use: str) -> None:
        sweep()
        self.path = Path(tempfile.mkdtemp(prefix=f"{PREFIX}{use}-"))
        lock = FileLock(
            self.path / LOCK, blocking=False, fallback_to_soft=False, thread_local=False
        )
        with suppress(OSError):  # a file system without locks: the folder is not swept
            lock.acquire()
        self._delete = weakref.finalize(self, _delete, self.path, lock)

    def close(self) -> None:
        """Deletes the folder; may be called twice."""
        self._delete()

    def __enter__(self) -> Path:
        return self.path

    def __exit__(self, *_: object) -> None:
        self.close()


def _delete(folder: Path, lock: FileLock) -> None:
    """Releases a folder's lock, because Windows deletes no open file, and deletes the folder."""
    lock.release()
    shutil.rmtree(folder, ignore_errors=True)


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
