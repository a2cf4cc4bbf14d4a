"""`python -m tools.importers.compare`: the same recorded walk through importers that no one here wrote, and how far each is from fmpy.

Everything lies in build/importers: an environment of the importers' own, the walk, each importer's answers. An importer that cannot be
had on this machine is named with the reason; the exit code says whether those that ran agree.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from hexapod_cosim.cosim.plant_files import package_version
from hexapod_cosim.cosim.recorder import Recording, read_csv
from tools.importers.packages import PackageRow, compare_packages, version
from tools.importers.walk import STEP, Walk, record

HERE = Path(__file__).resolve().parent
BUILD = HERE.parents[1] / "build" / "importers"
DURATION = 3.0  # s    three gait cycles and a half
ROUND_OFF = 1e-10  # a last bit in when a step ends, carried through a walk whose servo torques and reactions jump at every touch-down
SMALL = 1e-3  # SI     an output that never gets larger is judged by this: residuals are themselves round-off
LAST_LINES = 3
FMI_SIM = "0.7.0"


@dataclass(frozen=True)
class Importer:
    """A program that walks: `adapter` FMU INPUTS NAMES OUTPUTS."""

    name: str
    package: str  # "": of crates.io
    adapter: str
    given: str  # how it takes inputs


IMPORTERS = (
    Importer("libcosim", "libcosimpy", "libcosim_walk.py", "override manipulator, held over the step"),
    Importer("Ecos", "ecospy", "ecos_walk.py", "set before the step, held over it"),
    Importer("fmi-sim", "", "fmi_sim_walk.py", "CSV read by itself, rows at the communication points"),
)


@dataclass(frozen=True)
class Row:
    """What came of an importer. Differences are the largest of all outputs and times, each of its output's largest value.

    difference: from fmpy;  own: from fmpy told the importer's own times, to the last bit.
    """

    name: str
    version: str
    given: str
    difference: float | None
    own: float | None
    remark: str


def main() -> int:
    """Prints the table; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--duration", type=float, default=DURATION, help="of the walk [s]")
    duration = parser.parse_args().duration
    walk = record(BUILD / "walk", duration=duration)
    python = environment()
    rows = [row("hexapod's master", package_version(), "as recorded", walk.recorded, walk)]
    missing = install_fmi_sim(python)
    for importer in IMPORTERS:
        if not importer.package and missing:
            rows.append(Row(importer.name, "", importer.given, None, None, missing))
        else:
            rows.append(through(importer, walk, python))
    show(rows, walk)
    packages = compare_packages(BUILD / "package", python, duration=duration)
    show_packages(packages)
    agree = [one.difference is None or one.difference <= ROUND_OFF for one in rows]
    return 0 if all([*agree, *(one.agrees for one in packages)]) else 1


def environment() -> Path:
    """Python of the importers' environment, made or brought up to date."""
    folder, requirements = BUILD / "venv", HERE / "requirements.txt"
    subprocess.run([sys.executable, str(HERE.parent / "make_venv.py"), str(folder)], check=True)
    python = folder / "bin" / "python"
    for line in requirements.read_text(encoding="utf-8").splitlines():
        if not line.startswith("#"):
            subprocess.run([str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", line], check=False)
    return python


def install_fmi_sim(python: Path) -> str:
    """fmi-sim from crates.io; returns "", or why it cannot be had. To build it takes libclang, which PyPI has, and gcc's headers."""
    folder = BUILD / "cargo"
    if (folder / "bin" / "fmi-sim").exists():
        return ""
    if shutil.which("cargo") is None:
        return "cargo (Rust) is not installed"
    headers = subprocess.run(["gcc", "-print-file-name=include"], capture_output=True, text=True, check=False).stdout.strip()
    libclang = next(python.parents[1].glob("lib/python3*/site-packages/clang/native"), Path())
    environment = os.environ | {"LIBCLANG_PATH": str(libclang), "BINDGEN_EXTRA_CLANG_ARGS": f"-I{headers}"}
    command = [
        "cargo",
        "install",
        "fmi-sim",
        "--version",
        FMI_SIM,
        "--locked",
        "--root",
        str(folder),
        "--target-dir",
        str(folder / "target"),
    ]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    return "" if done.returncode == 0 else " / ".join(done.stderr.strip().splitlines()[-LAST_LINES:])


def through(importer: Importer, walk: Walk, python: Path) -> Row:
    """The walk through one importer."""
    outputs = walk.folder / f"{importer.name}.csv"
    outputs.unlink(missing_ok=True)
    arguments = map(str, (python, HERE / "adapters" / importer.adapter, walk.fmu, walk.inputs, walk.wanted, outputs))
    done = subprocess.run(list(arguments), capture_output=True, text=True, check=False)
    if done.returncode:
        said = " / ".join((done.stderr or done.stdout).strip().splitlines()[-LAST_LINES:])
        return Row(importer.name, "", importer.given, None, None, said)
    return row(importer.name, version(importer.package, python) if importer.package else FMI_SIM, importer.given, read_csv(outputs), walk)


def row(name: str, release: str, given: str, found: Recording, walk: Walk) -> Row:
    """An importer's answers, judged."""
    difference, worst = judged(found, walk.reference)
    lengths = (np.full(len(found.time), STEP), np.diff(found.time, prepend=0.0))  # importers pass h, or the difference of their times
    whole = len(found.time) == len(walk.reference.time)
    own = min(judged(found, walk.replay(found.time, steps))[0] for steps in lengths) if whole else None
    return Row(name, release, given, difference, own, worst)


def judged(found: Recording, reference: Recording) -> tuple[float, str]:
    """The largest difference of all outputs and times, of the output's largest value, and where."""
    names = reference.names[1:]
    ours, theirs = reference.columns(names), found.columns(names)
    if ours.shape != theirs.shape:
        return np.inf, f"{len(theirs)} rows, expected {len(ours)}"
    relative = np.abs(theirs - ours).max(axis=0) / np.maximum(np.abs(ours).max(axis=0), SMALL)
    relative[np.isnan(relative)] = np.inf
    worst = int(relative.argmax())
    return float(relative[worst]), "" if np.array_equal(ours, theirs) else f"worst: {names[worst]}"


def show(rows: list[Row], walk: Walk) -> None:
    """Prints the table."""
    count = walk.reference.data.shape[0] * (walk.reference.data.shape[1] - 1)
    title = f"{len(walk.reference.time)} steps of {STEP:g} s, {count} values, against fmpy"
    table = Table("importer", "version", "inputs", "largest difference", "told its own times", "remark", title=title)
    for one in rows:
        table.add_row(one.name, one.version, one.given, shown(one.difference), shown(one.own), one.remark)
    Console(width=max(150, shutil.get_terminal_size().columns)).print(table)


def show_packages(rows: list[PackageRow]) -> None:
    """Prints the table of packages."""
    title = "plant and controller in a package, against the Python master with the Python controller"
    table = Table("tool", "version", "on time", "measurements a period late", title=title)
    for one in rows:
        table.add_row(one.name, one.version, shown(one.prompt), shown(one.late) if not one.trouble else one.trouble)
    Console(width=max(150, shutil.get_terminal_size().columns)).print(table)


def shown(difference: float | None) -> str:
    """A difference, or what stands for it."""
    return "not run" if difference is None else f"{difference:.1e}" if difference else "none, to the last bit"


if __name__ == "__main__":
    sys.exit(main())
