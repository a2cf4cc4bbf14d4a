"""Writes pictures and reference results of the default robot's FMU to plant_fmu/generated/.

usage: python tools/generate_extras.py [--check]

--check writes nothing and exits with 1 if a file is not up to date. It compares numbers and pixels
with tolerances, since other libraries and compilers may change the last digits. The program needs
the installed plant.
"""

from __future__ import annotations

import argparse
import io
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from PIL import Image

from hexapod_cosim.cosim.export.extras import pictures
from hexapod_cosim.cosim.export.plant_export import export_fmu
from hexapod_cosim.cosim.export.reference import TOLERANCE, read_csv, reference_members
from hexapod_cosim.cosim.interface.plant_interface import load_interface
from hexapod_cosim.models.robot import load_robot

GENERATED = Path(__file__).resolve().parents[1] / "plant_fmu" / "generated"
DEFAULT_ROBOT = "athena"
GREY_LEVELS = 2.0  # largest mean difference between pictures that look the same


def main() -> int:
    """Writes or checks the files; returns the exit code."""
    parser = argparse.ArgumentParser(
        description="Generates the pictures and reference results in plant_fmu/generated/."
    )
    parser.add_argument(
        "--check", action="store_true", help="write nothing; exit with 1 if a file is stale"
    )
    check = parser.parse_args().check
    stale = {
        path: data
        for path, data in render_all().items()
        if not (path.is_file() and same(path.name, path.read_bytes(), data))
    }
    for path, data in stale.items():
        print(f"{path}: {'stale; run tools/generate_extras.py' if check else 'written'}")
        if not check:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
    return 1 if check and stale else 0


def render_all() -> dict[Path, bytes]:
    """Returns path and content of every file."""
    robot = load_robot(DEFAULT_ROBOT)
    interface = load_interface(robot)
    with TemporaryDirectory() as folder:
        reference = reference_members(interface, export_fmu(robot, Path(folder) / "athena.fmu"))
    files = {GENERATED / Path(name).name: data for name, data in pictures(interface).items()}
    return files | {
        GENERATED / "reference" / Path(name).name: data for name, data in reference.items()
    }


def same(name: str, old: bytes, new: bytes) -> bool:
    """Returns whether two versions of a file are equal within tolerances."""
    if name.endswith(".png"):
        return same_picture(old, new)
    return same_results(old, new) if name.endswith(".csv") else old == new


def same_picture(old: bytes, new: bytes) -> bool:
    """Returns whether two PNGs look the same."""
    first, second = (
        np.asarray(Image.open(io.BytesIO(data)).convert("RGBA"), dtype=float) for data in (old, new)
    )
    return first.shape == second.shape and float(np.abs(first - second).mean()) < GREY_LEVELS


def same_results(old: bytes, new: bytes) -> bool:
    """Returns whether two CSV files have the same columns and equal numbers within TOLERANCE."""
    first, second = read_csv(old), read_csv(new)
    return list(first) == list(second) and all(
        np.allclose(first[name], second[name], rtol=TOLERANCE, atol=TOLERANCE) for name in first
    )


if __name__ == "__main__":
    sys.exit(main())
