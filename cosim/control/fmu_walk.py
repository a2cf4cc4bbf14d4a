"""Reads the walk of a controller FMU, its stance and gait, from the model description."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from hexapod_cosim.controller import PATTERNS
from hexapod_cosim.cosim.common.files import file_stamp
from hexapod_cosim.cosim.interface.descriptions import open_description
from hexapod_cosim.models import JOINT_NAMES, LEG_NAMES
from hexapod_cosim.models.records import Vector3

ARRAY = "stance"  # of FMI 3: six legs by three joints
NAMES = [f"{leg}.{joint}.{ARRAY}" for leg in LEG_NAMES for joint in JOINT_NAMES]
TIMING = ("gait.pattern", "gait.period", "gait.duty")
MAX_READ = 32  # files that are kept; the least recently used one goes first


@dataclass(frozen=True)
class FmuWalk:
    """Stance and gait of a controller FMU."""

    stance: tuple[Vector3, ...] | None  # rad  by leg and joint; None: it has none
    gait: Mapping[str, Any]  # arguments of make_gait(); empty: it has none


def walk_of_fmu(path: Path) -> FmuWalk:
    """Returns the walk of a controller FMU.

    The angles of the stance are the start values of its parameters `{leg}.{joint}.stance`, or of
    the array `stance` of an FMU of FMI 3.0. The gait is read from those of gait.pattern,
    gait.period and gait.duty. Raises FmuError for a file that is no FMU.
    """
    return _read(path, *(file_stamp(path) if path.is_file() else (0, 0)))


@lru_cache(maxsize=MAX_READ)
def _read(path: Path, _changed: int, _size: int) -> FmuWalk:
    """Returns the walk of a file with this stamp."""
    starts = {
        variable.name: variable.start
        for variable in open_description(path).modelVariables
        if variable.causality == "parameter"
    }
    named = [starts.get(name) for name in NAMES]
    angles = _numbers(named) or _numbers(str(starts.get(ARRAY)).split())
    stance = None
    if len(angles) == len(NAMES):
        stance = tuple(zip(angles[0::3], angles[1::3], angles[2::3], strict=True))
    return FmuWalk(stance, _gait(_numbers([starts.get(name) for name in TIMING])))


def _gait(timing: tuple[float, ...]) -> dict[str, Any]:
    """Returns the arguments of make_gait() from the numbers of TIMING."""
    if not timing:
        return {}
    number, period, duty = timing
    names = dict(enumerate(PATTERNS, start=1))
    if number not in names or not (period > 0.0 and 0.0 < duty < 1.0):
        return {}  # a pattern of its own, or numbers that are no gait
    return {"name": names[int(number)], "period": period, "duty": duty}


def _numbers(texts: list[Any]) -> tuple[float, ...]:
    """Returns finite numbers from their texts; () if one of them is none."""
    try:
        numbers = tuple(float(text) for text in texts)
    except (TypeError, ValueError):
        return ()
    return numbers if all(map(math.isfinite, numbers)) else ()
