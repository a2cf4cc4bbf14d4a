"""Keeps designed stances in the user's cache, by the content of all that they depend on."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from hexapod_cosim.controller import Gait
from hexapod_cosim.cosim.export.cross_build import user_cache
from hexapod_cosim.cosim.run.kept_gains import design_name, keep
from hexapod_cosim.models import Robot


class Stance(NamedTuple):
    """By how much a robot's feet are moved from its own stance."""

    outward: float  # m    further out from the hips
    deeper: float  # m    below them


def kept_stance(
    robot: Robot,
    gait: Gait,
    make: Callable[[Robot, Gait], Stance],
    folder: Path | None = None,
) -> Stance:
    """Returns the designed stance of a robot and a gait, from the cache if it is there.

    Otherwise `make` designs it, and it is written to the cache; a cache that cannot be written is
    left alone. The name of a file holds a hash of the robot, the gait and of what makes designs
    (`design_name`): stances of the same hash have the same bits. Raises what `make` raises.

    folder: of the cache; by default the user's.
    """
    path = (folder or user_cache()) / "stances" / f"{design_name(robot, gait)}.json"
    found = _read(path)
    if found is not None:
        return found
    stance = make(robot, gait)
    keep(path, lambda part: part.write_text(json.dumps(stance._asdict()), encoding="utf-8"))
    return stance


def _read(path: Path) -> Stance | None:
    """Returns the stance in a file; None when it is absent or damaged."""
    try:
        table = json.loads(path.read_text(encoding="utf-8"))
        stance = Stance(float(table["outward"]), float(table["deeper"]))
    except (OSError, ValueError, TypeError, KeyError):
        return None
    return stance if math.isfinite(stance.outward) and math.isfinite(stance.deeper) else None
