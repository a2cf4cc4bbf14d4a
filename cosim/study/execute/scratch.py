"""Where a study's processes on this machine keep what they unpack: one folder, which goes when the
study ends.

Killed processes leave theirs: workers that outlive their program take its folder with them, and
what is left all the same goes when the next study begins.
"""

from __future__ import annotations

import pickle
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from hexapod_cosim.cosim.common.files import not_writable
from hexapod_cosim.cosim.common.locks import lock_file
from hexapod_cosim.cosim.study.execute.job import Job

PREFIX, LOCK, JOB = "hexapod-crew-", "lock", "job"


@contextmanager
def scratch(job: Job) -> Iterator[Path]:
    """A folder that holds the job, locked while it is in use. Raises HexapodError when there is
    no room for it.
    """
    sweep()
    with tempfile.TemporaryDirectory(prefix=PREFIX, ignore_cleanup_errors=True) as name:
        folder = Path(name)
        with (folder / LOCK).open("w", encoding="utf-8") as file:
            with suppress(OSError):  # no locks on this file system: then nothing is swept either
                lock_file(file)
            try:
                (folder / JOB).write_bytes(pickle.dumps(job))
            except OSError as error:
                raise not_writable(folder, error) from error
            yield folder


def job_in(folder: Path) -> Job:
    """The job of a study's folder. Whoever calls this was begun by the process that wrote it."""
    job: Job = pickle.loads((folder / JOB).read_bytes())
    return job


def sweep() -> None:
    """Takes away folders whose program is gone; one without a lock is left alone, for it may
    just be made.
    """
    for folder in Path(tempfile.gettempdir()).glob(f"{PREFIX}*"):
        with suppress(OSError):
            with (folder / LOCK).open("r+", encoding="utf-8") as file:
                lock_file(file)
            shutil.rmtree(folder, ignore_errors=True)
