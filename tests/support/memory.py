"""Measures this process's memory."""

from __future__ import annotations

import gc
import os
import resource
from pathlib import Path

STATM = Path("/proc/self/statm")


def resident() -> int:
    """Returns the resident memory [bytes]; its maximum so far where the system does not report the
    present value.
    """
    gc.collect()
    if STATM.exists():
        return int(STATM.read_text(encoding="ascii").split()[1]) * os.sysconf("SC_PAGE_SIZE")
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
