"""The temporary folder of a study's worker processes, which is removed when the study ends.

When the program is killed, its workers remove the folder before they end. When they are killed as
well, the next study removes it.
"""

from __future__ import annotations

import pickle
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from filelock import FileLock

from hexapod_cosim.cosim.common.files import not_writable
from hexapod_cosim.cosim.study.execute.job import Job

PREFIX, LOCK, JOB = "hexapod-workers-", "lock", "job"


@contextmanager
def scratch_folder(job: Job) -> Iterator[Path]:
    """Makes a folder that holds the job and is locked while it is in use.

    Raises HexapodError when the disk has no room for it.
    """
    remove_stale_folders()
    with tempfile.TemporaryDirectory(prefix=PREFIX, ignore_cleanup_errors=True) as name:
        folder = Path(name)
        lock = _lock_of(folder)
        with suppress(OSError):  # a file system without locks: no folder counts as stale there
            lock.acquire()
        try:
            (folder / JOB).write_bytes(pickle.dumps(job))
        except OSError as error:
            raise not_writable(folder, error) from error
        try:
            yield folder
        finally:
            lock.release()


def read_job(folder: Path) -> Job:
    """Reads the job from a folder that the parent of this process has written."""
    job: Job = pickle.loads((folder / JOB).read_bytes())
    return job


def remove_stale_folders() -> None:
    """Removes the folders of programs that have ended.

    A folder without a lock file is left alone: another program may just have made it.
    """
    for folder in Path(tempfile.gettempdir()).glob(f"{PREFIX}*"):
        if (folder / LOCK).exists():
            with suppress(OSError):  # of which Timeout is one: the lock is held
                with _lock_of(folder):
                    pass
                shutil.rmtree(folder, ignore_errors=True)


def _lock_of(folder: Path) -> FileLock:
    """Returns the lock of a folder, which the system releases when its process is killed."""
    return FileLock(folder / LOCK, blocking=False, fallback_to_soft=False)
