"""The same package through tools that no one here wrote, against the Python master: on time, and with measurements a period late."""

from __future__ import annotations

import subprocess
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hexapod_cosim.cosim.controller_export import make_setup
from hexapod_cosim.cosim.fmu import Fmu
from hexapod_cosim.cosim.plant_files import package_version
from hexapod_cosim.cosim.recorder import Recording, read_csv
from hexapod_cosim.cosim.robot_package import CONTROLLER, PLANT, export_package
from hexapod_cosim.models import load_robot
from tools.importers.late import walk
from tools.importers.package import run

HERE = Path(__file__).resolve().parent
PERIOD = 0.005  # s
SAME = 1e-9  # the controllers' last bits, which the servos' stiffness and the ground's turn into forces
SMALL = 1e-3  # SI    an output that never gets larger is judged by this
LAST_LINES = 3
# that inputs do not reach at once: some tools show outputs before they set the next inputs, some after
JUDGED = ("torso.position", "torso.quaternion", "torso.velocity", ".angle", ".speed", "foot.force", "foot.normal_force")
TOOLS = (("libcosim", "libcosimpy", "libcosim_package.py"), ("Ecos", "ecospy", "ecos_package.py"))


@dataclass(frozen=True)
class PackageRow:
    """What came of a tool: the largest difference of all judged outputs and times, each of its largest value, from either order."""

    name: str
    version: str
    prompt: float | None
    late: float | None
    trouble: str = ""

    @property
    def agrees(self) -> bool:
        """With one of the orders, or not to be had here."""
        return bool(self.trouble) or min(self.prompt or 0.0, self.late or 0.0) <= SAME


def compare_packages(folder: Path, python: Path, *, duration: float) -> list[PackageRow]:
    """Packs the compliant walk and runs it; `python`: of the tools' environment."""
    folder.mkdir(parents=True, exist_ok=True)
    setup, steps = make_setup(load_robot("athena"), control="compliant", period=PERIOD), round(duration / PERIOD)
    package = export_package(setup, folder / "athena.ssp", stop=duration)
    with zipfile.ZipFile(package) as archive:
        plant = Path(archive.extract("resources/plant.fmu", folder))
    masters = [walk(setup, plant, duration=duration, overrides=[], late=late) for late in (False, True)]
    with Fmu(plant) as fmu:
        outputs = fmu.names("output")
    names = [name for name in outputs if any(part in name for part in JUDGED)]
    wanted = folder / "names.txt"
    wanted.write_text("\n".join(f"{PLANT}.{name}" for name in names), encoding="utf-8")
    rows = []
    for name, at_once in (("plain master, plant before controller", True), ("plain master, both at once", False)):
        found = run(package, wanted.read_text().split("\n"), step=PERIOD, steps=steps, order=(PLANT, CONTROLLER), at_once=at_once)
        rows.append(PackageRow(name, package_version(), *judged(found, masters, names)))
    for name, distribution, adapter in TOOLS:
        arguments = [
            str(python),
            str(HERE / "adapters" / adapter),
            str(package),
            str(wanted),
            str(folder / f"{distribution}.csv"),
            str(steps),
        ]
        done = subprocess.run(arguments, capture_output=True, text=True, check=False)
        if done.returncode:
            said = " / ".join((done.stderr or done.stdout).strip().splitlines()[-LAST_LINES:])
            rows.append(PackageRow(name, "", None, None, said))
            continue
        rows.append(PackageRow(name, version(distribution, python), *judged(read_csv(folder / f"{distribution}.csv"), masters, names)))
    return rows


def judged(found: Recording, masters: Sequence[Recording], names: Sequence[str]) -> tuple[float, float]:
    """The largest difference from each master."""
    theirs = found.columns([f"{PLANT}.{name}" for name in names])
    ours = [master.columns(names) for master in masters]
    on_time, late = (float((np.abs(theirs - one).max(axis=0) / np.maximum(np.abs(one).max(axis=0), SMALL)).max()) for one in ours)
    return on_time, late


def version(distribution: str, python: Path) -> str:
    """Of a package in the tools' environment."""
    code = f"from importlib.metadata import version; print(version({distribution!r}))"
    return subprocess.run([str(python), "-c", code], capture_output=True, text=True, check=True).stdout.strip()
