"""`hexapod` on a disk that is full after some files: FILES are flushed to it, and then nothing
more. Run by the tests.
"""

from __future__ import annotations

import errno
import os
import sys

from hexapod_cosim.cosim.cli import main

FILES = 6  # two of the folder, each with its name, and a part
flush, flushed = os.fsync, [0]


def filling(file: int) -> None:
    flushed[0] += 1
    if flushed[0] > FILES:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    flush(file)


if __name__ == "__main__":
    os.fsync = filling  # type: ignore[assignment]
    sys.exit(main(sys.argv[1:]))
