"""Keeps designed gains in the user's cache, by the content of all that they depend on."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Callable
from functools import cache
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

from hexapod_cosim.controller import Gains, GainsError, load_gains, save_gains
from hexapod_cosim.cosim.common.components import PLANT
from hexapod_cosim.cosim.common.files import atomic_path
from hexapod_cosim.cosim.common.plant_files import binary, fmi2_platform
from hexapod_cosim.cosim.export.cross_build import user_cache
from hexapod_cosim.models import HexapodError, Robot

# whose sources make designs
PACKAGES = ("hexapod_cosim.controller", "hexapod_cosim.cosim.design", "hexapod_cosim.models")


def kept_gains(
    robot: Robot,
    period: float,
    make: Callable[[Robot, float], Gains],
    folder: Path | None = None,
) -> Gains:
    """Returns the gains of a robot and a controller period [s], from the cache if they are there.

    Otherwise `make` designs them, and they are written to the cache; a cache that cannot be written
    is left alone. The name of a file holds a hash of the robot, the period, the plant's binary, the
    sources of design and models, and the numerical libraries: gains of the same hash have the same
    bits. Raises what `make` raises.

    folder: of the cache; by default the user's.
    """
    path = (folder or user_cache()) / "gains" / f"{design_name(robot, period)}.toml"
    try:
        return load_gains(path)
    except GainsError:  # absent, damaged, or of another version
        gains = make(robot, period)
    keep(path, lambda part: save_gains(gains, part))
    return gains


def design_name(robot: Robot, given: object) -> str:
    """Returns the name of what is designed for a robot and a period or gait: the robot's, and a
    hash of all that the design depends on.
    """
    parts = [robot.hash, repr(given), tools_hash()]
    digest = hashlib.sha256("\n".join(parts).encode()).hexdigest()
    return f"{robot.name}-{digest[:32]}"


def keep(path: Path, write: Callable[[Path], object]) -> None:
    """Lets `write` make a file of the cache; a cache that cannot be written is left alone."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_path(path) as part:
            write(part)
    except (OSError, HexapodError):
        pass


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
