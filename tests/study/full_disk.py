"""Runs `hexapod` on a simulated disk that is full after FILES flushes. The tests run it."""

from __future__ import annotations

import errno
import os
import sys

from hexapod_cosim.cosim.cli import main

FILES = 8  # flushes: of three files and a part, each with its folder
flush, count = os.fsync, [0]


def flush_or_fail(file: int) -> None:
    count[0] += 1
    if count[0] > FILES:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    flush(file)


if __name__ == "__main__":
    os.fsync = flush_or_fail  # type: ignore[assignment]
    sys.exit(main(sys.argv[1:]))
