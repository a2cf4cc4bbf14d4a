"""Runs a package with other tools and compares it with the Python master, with present measurements
and with those of one period before.
"""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hexapod_cosim.controller import DEFAULT_PERIOD
from hexapod_cosim.cosim.common.plant_files import package_version
from hexapod_cosim.cosim.export.robot_package import CONTROLLER, PLANT, export_package
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.run.plan import make_setup
from hexapod_cosim.models import load_robot
from tools.importers.delayed import walk
from tools.importers.outcome import answers, not_installed, version
from tools.importers.package import run

ADAPTERS = Path(__file__).resolve().parent / "adapters"
# largest relative difference due to the last bits of the commands, which stiff servos and the
# ground amplify
ROUND_OFF = 1e-9
SMALL = 1e-3  # SI, scale of outputs that never exceed it
# outputs without direct feed-through, since tools read outputs before or after they set inputs
COMPARED = (
    "torso.position",
    "torso.quaternion",
    "torso.velocity",
    ".angle",
    ".speed",
    "foot.force",
    "foot.normal_force",
)
TOOLS = (
    ("libcosim", ("libcosimpy",), "libcosim_package.py"),
    ("Ecos", ("ecospy", "tbb"), "ecos_package.py"),
)


@dataclass(frozen=True)
class PackageRow:
    """The result of a tool: largest differences of all compared outputs and times, relative to the
    output's largest value.

    on_time: from the Python master with present measurements.
    late: from the Python master with measurements of one period before.
    """

    name: str
    version: str
    on_time: float | None
    late: float | None
    trouble: str = ""
    missing: bool = False  # whether it could not be installed

    @property
    def agrees(self) -> bool:
        """Whether the tool ran and gave one of the two walks."""
        return any(
            difference is not None and difference <= ROUND_OFF
            for difference in (self.on_time, self.late)
        )


def compare_packages(
    folder: Path, python: Path, *, duration: float
) -> tuple[list[PackageRow], list[PackageRow]]:
    """Exports the compliant walk and runs it with the minimal master and with other tools.

    python: of the tools' virtual environment.
    """
    folder.mkdir(parents=True, exist_ok=True)
    setup = make_setup(load_robot("athena"), control="compliant", period=DEFAULT_PERIOD)
    steps = round(duration / DEFAULT_PERIOD)
    package = export_package(setup, folder / "athena.ssp", stop=duration)
    with zipfile.ZipFile(package) as archive:
        plant = Path(archive.extract("resources/plant.fmu", folder))
    masters = [
        walk(setup, plant, duration=duration, overrides=[], late=late) for late in (False, True)
    ]
    with Fmu(plant) as fmu:
        outputs = fmu.names("output")
    names = [name for name in outputs if any(part in name for part in COMPARED)]
    wanted = folder / "names.txt"
    wanted.write_text("\n".join(f"{PLANT}.{name}" for name in names), encoding="utf-8")
    rows = []
    for name, in_order in (
        ("plain master, plant before controller", True),
        ("plain master, both at once", False),
    ):
        found = run(
            package,
            wanted.read_text().split("\n"),
            step=DEFAULT_PERIOD,
            steps=steps,
            order=(PLANT, CONTROLLER),
            in_order=in_order,
        )
        rows.append(PackageRow(name, package_version(), *largest_difference(found, masters, names)))
    tools = []
    for name, needs, adapter in TOOLS:
        answered = folder / f"{name}.csv"
        command: list[str | Path] = [
            python,
            ADAPTERS / adapter,
            package,
            wanted,
            answered,
            str(steps),
        ]
        tools.append(run_tool(name, needs, command, answered, masters, names))
    return rows, tools


def run_tool(
    name: str,
    needs: Sequence[str],
    command: Sequence[str | Path],
    outputs: Path,
    masters: Sequence[Recording],
    names: Sequence[str],
) -> PackageRow:
    """Runs a package with one tool and compares the outputs.

    Args:
        name: of the tool.
        needs: packages on PyPI, the tool's own first.
        command: Python of the environment, the adapter and its arguments.
        outputs: the file that the adapter writes.
        masters: recordings of the Python master, on time and late.
        names: of the compared outputs.
    """
    python = Path(command[0])
    missing = not_installed(needs, python)
    if missing:
        return PackageRow(name, "", None, None, missing, missing=True)
    release = version(needs[0], python)
    found, said = answers(command, outputs)
    if found is None:
        return PackageRow(name, release, None, None, said)
    return PackageRow(name, release, *largest_difference(found, masters, names))


def largest_difference(
    found: Recording, masters: Sequence[Recording], names: Sequence[str]
) -> tuple[float, float]:
    """Returns the largest relative difference from each master; infinite for missing outputs."""
    wanted = [f"{PLANT}.{name}" for name in names]
    if not set(wanted) <= set(found.names) or len(found.time) != len(masters[0].time):
        return np.inf, np.inf
    theirs, ours = found.columns(wanted), [master.columns(names) for master in masters]
    on_time, late = (
        float((np.abs(theirs - one).max(axis=0) / np.maximum(np.abs(one).max(axis=0), SMALL)).max())
        for one in ours
    )
    return on_time, late  # NaN does not agree
