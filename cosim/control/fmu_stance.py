"""Reads the stance of a controller FMU from its model description."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from hexapod_cosim.cosim.interface.descriptions import open_description
from hexapod_cosim.models import JOINT_NAMES, LEG_NAMES
from hexapod_cosim.models.records import Array

ARRAY = "stance"  # of FMI 3: six legs by three joints
NAMES = [f"{leg}.{joint}.{ARRAY}" for leg in LEG_NAMES for joint in JOINT_NAMES]
SHAPE = (len(LEG_NAMES), len(JOINT_NAMES))
MAX_READ = 32  # files that are kept; the least recently used one goes first


def stance_of_fmu(path: Path) -> Array | None:
    """Returns the joint angles (6, 3) [rad] of a controller FMU's stance; None without them.

    They are the start values of its parameters `{leg}.{joint}.stance`, or of the array `stance` of
    an FMU of FMI 3.0. Raises FmuError for a file that is no FMU.
    """
    status = path.stat() if path.is_file() else None
    key = (0, 0) if status is None else (status.st_mtime_ns, status.st_size)
    angles = _read(path, *key)
    return None if angles is None else np.array(angles).reshape(SHAPE)


@lru_cache(maxsize=MAX_READ)
def _read(path: Path, _changed: int, _size: int) -> tuple[float, ...] | None:
    """Returns the 18 angles of a file that was changed at that time [ns]."""
    parameters = {
        variable.name: variable.start
        for variable in open_description(path).modelVariables
        if variable.causality == "parameter"
    }
    if set(NAMES) <= set(parameters):
        return _numbers([parameters[name] for name in NAMES])
    if ARRAY in parameters:
        return _numbers(str(parameters[ARRAY]).split())
    return None


def _numbers(texts: list[Any]) -> tuple[float, ...] | None:
    """Returns 18 finite numbers from their texts; None for anything else."""
    try:
        numbers = tuple(float(text) for text in texts)
    except (TypeError, ValueError):
        return None
    return numbers if len(numbers) == len(NAMES) and np.isfinite(numbers).all() else None
