"""Temporary folders, objects that a with statement closes, and locks of folders."""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
import weakref
from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Self

if sys.platform != "win32":
    import fcntl


class Closing(ABC):
    """An object that holds resources until close() or the end of its with statement."""

    @abstractmethod
    def close(self) -> None:
        """Releases the resources."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class TemporaryFolder:
    """A folder in the system's temporary one.

    As a context manager it returns the folder's path. What is not closed is deleted when the
    process ends; the system deletes what a killed process leaves.

    Args:
        use: a word for the folder's name.
    """

    def __init__(self, use: str) -> None:
        self.path = Path(tempfile.mkdtemp(prefix=f"hexapod-{use}-"))
        self._delete = weakref.finalize(self, shutil.rmtree, self.path, ignore_errors=True)

    def close(self) -> None:
        """Deletes the folder; may be called twice."""
        self._delete()

    def __enter__(self) -> Path:
        return self.path

    def __exit__(self, *_: object) -> None:
        self.close()


def lock_folder(folder: Path) -> Callable[[], object] | None:
    """Locks an existing folder; returns what releases it, or None when another process has it.

    The folder itself is locked, so that no file is left in it and the system releases the lock of a
    killed process. Nothing is locked where the system cannot lock a folder, as on Windows.
    """
    if sys.platform == "win32":
        return lambda: None
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(handle)
        return None
    except OSError:  # a file system that locks no folders
        pass
    return partial(os.close, handle)
