"""Keeps designed gains and stances in the user's cache, by the content of all they depend on.

The name of a file holds a hash of the robot, the period or gait, the plant's binary, the sources of
design and models, and the numerical libraries: designs of the same hash have the same bits. A
damaged file is replaced; a cache that cannot be written is left alone.
"""

from __future__ import annotations

import hashlib
import json
import math
import platform
from collections.abc import Callable
from contextlib import suppress
from functools import cache, lru_cache
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import TypeVar

from hexapod_cosim.controller import Gains, GainsError, Gait, load_gains, save_gains
from hexapod_cosim.cosim.common.components import PLANT
from hexapod_cosim.cosim.common.files import atomic_path
from hexapod_cosim.cosim.common.plant_files import binary, fmi2_platform
from hexapod_cosim.cosim.design.stance import StanceChange
from hexapod_cosim.cosim.export.cross_build import user_cache
from hexapod_cosim.models import HexapodError, Robot

# whose sources make designs
PACKAGES = ("hexapod_cosim.controller", "hexapod_cosim.cosim.design", "hexapod_cosim.models")
MAX_DESIGNS = 64  # sets of gains that a process keeps; the least recently used one goes first
Design = TypeVar("Design")


@lru_cache(maxsize=MAX_DESIGNS)
def designed_gains(robot: Robot, period: float) -> Gains:
    """Returns the gains of a robot and a controller period [s].

    They are designed once and kept in the user's cache. Raises GainsError when no gains can be
    designed.
    """
    return kept_gains(robot, period, _design)


def _design(robot: Robot, period: float) -> Gains:
    # imported only where gains are designed: python-control takes a second
    from hexapod_cosim.cosim.design.gains import design_for  # noqa: PLC0415

    return design_for(robot, period)


def kept_gains(
    robot: Robot, period: float, make: Callable[[Robot, float], Gains], folder: Path | None = None
) -> Gains:
    """Returns the gains of a robot and a controller period [s], from the cache if they are there.

    folder: of the cache; by default the user's. Raises what `make` raises.
    """
    path = _path("gains", robot, period, folder).with_suffix(".toml")
    return _kept(path, _read_gains, lambda: make(robot, period), save_gains)


def kept_stance(
    robot: Robot,
    gait: Gait,
    make: Callable[[Robot, Gait], StanceChange],
    folder: Path | None = None,
) -> StanceChange:
    """Returns the designed stance of a robot and a gait, as kept_gains."""
    path = _path("stances", robot, gait, folder).with_suffix(".json")
    return _kept(path, _read_stance, lambda: make(robot, gait), _write_stance)


def _path(kind: str, robot: Robot, given: object, folder: Path | None) -> Path:
    """Returns the path, without a suffix, of what is designed for a robot and a period or gait."""
    parts = [robot.hash, repr(given), tools_hash()]
    digest = hashlib.sha256("\n".join(parts).encode()).hexdigest()
    return (folder or user_cache()) / kind / f"{robot.name}-{digest[:32]}"


def _kept(
    path: Path,
    read: Callable[[Path], Design | None],
    make: Callable[[], Design],
    write: Callable[[Design, Path], object],
) -> Design:
    """Returns what is in a file of the cache, or else what `make` returns, which is written."""
    found = read(path)
    if found is None:
        found = make()
        with suppress(OSError, HexapodError):
            path.parent.mkdir(parents=True, exist_ok=True)
            with atomic_path(path) as part:
                write(found, part)
    return found


def _read_gains(path: Path) -> Gains | None:
    """Returns gains; None when they are absent, damaged, or of another version."""
    try:
        return load_gains(path)
    except GainsError:
        return None


def _read_stance(path: Path) -> StanceChange | None:
    """Returns a stance; None when it is absent or damaged."""
    try:
        table = json.loads(path.read_text(encoding="utf-8"))
        stance = StanceChange(float(table["outward"]), float(table["deeper"]))
    except (OSError, ValueError, TypeError, KeyError):
        return None
    return stance if all(map(math.isfinite, stance)) else None


def _write_stance(stance: StanceChange, path: Path) -> None:
    path.write_text(json.dumps(stance._asdict()), encoding="utf-8")


@cache
def tools_hash() -> str:
    """Returns a hash of the plant's binary, the sources and the libraries that make designs."""
    digest = hashlib.sha256(binary(fmi2_platform(), PLANT).read_bytes())
    for package in PACKAGES:
        spec = find_spec(package)
        for place in (spec and spec.submodule_search_locations) or ():
            for source in sorted(Path(place).rglob("*.py")):
                digest.update(source.read_bytes())
    names = ("numpy", "scipy", "control")
    digest.update(" ".join([platform.python_version(), *map(version, names)]).encode())
    return digest.hexdigest()
