"""Locks on files, by which processes see of each other that they are there."""

from __future__ import annotations

import errno
import sys
from typing import TextIO

HELD = (errno.EACCES, errno.EAGAIN, errno.EDEADLK)  # what asking for a lock says that another has


def lock_file(file: TextIO) -> None:
    """Until the file is closed or the process ends. Raises OSError: one of HELD when another has
    it, others where there are no locks.
    """
    if sys.platform == "win32":
        import msvcrt  # noqa: PLC0415

        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
    else:
        import fcntl  # noqa: PLC0415

        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
