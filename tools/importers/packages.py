"""The same package through tools that no one here wrote, against the Python master: on time, and
with measurements a period late.
"""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hexapod_cosim.cosim.common.plant_files import package_version
from hexapod_cosim.cosim.export.robot_package import CONTROLLER, PLANT, export_package
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.run.controller_setup import make_setup
from hexapod_cosim.models import load_robot
from tools.importers.late import walk
from tools.importers.outcome import answers, not_installed, version
from tools.importers.package import run

ADAPTERS = Path(__file__).resolve().parent / "adapters"
PERIOD = 0.005  # s
# the controllers' last bits, which the servos' stiffness and the ground's turn into forces
SAME = 1e-9
SMALL = 1e-3  # SI    an output that never gets larger is judged by this
# that inputs do not reach at once: some tools show outputs before they set the next inputs, some
# after
JUDGED = (
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
    """What came of a tool: the largest difference of all judged outputs and times, each of its
    largest value, from either order.
    """

    name: str
    version: str
    prompt: float | None
    late: float | None
    trouble: str = ""
    missing: bool = False  # it could not be installed

    @property
    def agrees(self) -> bool:
        """It ran, and gave the walk of one of the orders."""
        return any(
            difference is not None and difference <= SAME for difference in (self.prompt, self.late)
        )


def compare_packages(
    folder: Path, python: Path, *, duration: float
) -> tuple[list[PackageRow], list[PackageRow]]:
    """Packs the compliant walk and runs it through plain masters and foreign tools; `python`: of
    the tools' environment.
    """
    folder.mkdir(parents=True, exist_ok=True)
    setup, steps = (
        make_setup(load_robot("athena"), control="compliant", period=PERIOD),
        round(duration / PERIOD),
    )
    package = export_package(setup, folder / "athena.ssp", stop=duration)
    with zipfile.ZipFile(package) as archive:
        plant = Path(archive.extract("resources/plant.fmu", folder))
    masters = [
        walk(setup, plant, duration=duration, overrides=[], late=late) for late in (False, True)
    ]
    with Fmu(plant) as fmu:
        outputs = fmu.names("output")
    names = [name for name in outputs if any(part in name for part in JUDGED)]
    wanted = folder / "names.txt"
    wanted.write_text("\n".join(f"{PLANT}.{name}" for name in names), encoding="utf-8")
    rows = []
    for name, at_once in (
        ("plain master, plant before controller", True),
        ("plain master, both at once", False),
    ):
        found = run(
            package,
            wanted.read_text().split("\n"),
            step=PERIOD,
            steps=steps,
            order=(PLANT, CONTROLLER),
            at_once=at_once,
        )
        rows.append(PackageRow(name, package_version(), *judged(found, masters, names)))
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
        tools.append(through(name, needs, command, answered, masters, names))
    return rows, tools


def through(
    name: str,
    needs: Sequence[str],
    command: Sequence[str | Path],
    outputs: Path,
    masters: Sequence[Recording],
    names: Sequence[str],
) -> PackageRow:
    """A package through one tool, judged. needs: packages of PyPI, itself first; command: its
    adapter's, after the environment's Python.
    """
    python = Path(command[0])
    missing = not_installed(needs, python)
    if missing:
        return PackageRow(name, "", None, None, missing, missing=True)
    release = version(needs[0], python)
    found, said = answers(command, outputs)
    if found is None:
        return PackageRow(name, release, None, None, said)
    return PackageRow(name, release, *judged(found, masters, names))


def judged(
    found: Recording, masters: Sequence[Recording], names: Sequence[str]
) -> tuple[float, float]:
    """The largest difference from each master, of the output's largest value; none there is:
    infinite.
    """
    wanted = [f"{PLANT}.{name}" for name in names]
    if not set(wanted) <= set(found.names) or len(found.time) != len(masters[0].time):
        return np.inf, np.inf
    theirs, ours = found.columns(wanted), [master.columns(names) for master in masters]
    on_time, late = (
        float((np.abs(theirs - one).max(axis=0) / np.maximum(np.abs(one).max(axis=0), SMALL)).max())
        for one in ours
    )
    return on_time, late  # NaN, of values that are none, agrees with nothing
