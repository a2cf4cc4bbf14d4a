"""Runs a recorded walk with other importers and compares their outputs with fmpy's.

usage: python -m tools.importers.compare

All files are in build/importers: the importers' virtual environment, the walk, each importer's
outputs. An importer that cannot be installed is listed with the reason. The exit code is 1 if an
installed importer fails or does not agree.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from hexapod_cosim.cosim.common.plant_files import package_version
from hexapod_cosim.cosim.export.plant import export_fmu
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.models import load_robot
from tools.importers.capabilities import Capability, adjoint, tuned, tuned_by_ipopt, updated
from tools.importers.outcome import (
    Outcome,
    answers,
    last_lines,
    not_installed,
    shortcomings,
    version,
)
from tools.importers.packages import TOOLS, PackageRow, compare_packages
from tools.importers.walk import STEP, ReferenceRun, record

HERE = Path(__file__).resolve().parent
ADAPTERS = HERE / "adapters"
BUILD = HERE.parents[1] / "build" / "importers"
DURATION = 3.0  # s, three and a half gait cycles
# largest difference due to the last bits of communication points; second differences of depths in
# the rise of forces amplify it
ROUND_OFF = 2e-9
SMALL = 1e-3  # SI, scale of outputs that never exceed it, such as residuals
FMI_SIM = "0.7.0"


@dataclass(frozen=True)
class Importer:
    """An importer and its adapter, a program with the arguments FMU INPUTS NAMES OUTPUTS."""

    name: str
    packages: tuple[str, ...]  # on PyPI, its own first; empty: on crates.io
    adapter: str
    given: str  # how it receives inputs


IMPORTERS = (
    Importer(
        "libcosim", ("libcosimpy",), "libcosim_walk.py", "override manipulator, held over the step"
    ),
    Importer("Ecos", ("ecospy", "tbb"), "ecos_walk.py", "set before the step, held over it"),
    Importer(
        "fmi-sim", (), "fmi_sim_walk.py", "CSV read by itself, rows at the communication points"
    ),
)


@dataclass(frozen=True)
class Row:
    """The result of an importer.

    Differences are the largest of all outputs and times, relative to the output's largest value.

    difference: from fmpy.
    own: from fmpy with the importer's communication points, to the last bit.
    missing: whether the importer could not be installed.
    """

    name: str
    version: str
    given: str
    difference: float | None
    own: float | None
    remark: str
    missing: bool = False

    @property
    def agrees(self) -> bool:
        """Whether the importer ran and differs by round-off only."""
        return self.difference is not None and self.difference <= ROUND_OFF


def main() -> int:
    """Runs the comparison and prints the tables; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--duration", type=float, default=DURATION, help="of the walk [s]")
    duration = parser.parse_args().duration
    walk = record(BUILD / "walk", duration=duration)
    python = environment()
    ours = row("hexapod's master", package_version(), "as recorded", walk.recorded, walk)
    missing = install_fmi_sim(python)
    rows = [
        run_importer(importer, walk, python, missing="" if importer.packages else missing)
        for importer in IMPORTERS
    ]
    show([ours, *rows], walk)
    masters, tools = compare_packages(BUILD / "package", python, duration=duration)
    show_packages([*masters, *tools])
    fmu3 = export_fmu(load_robot("athena"), BUILD / "athena3.fmu", fmi=3)
    used = [tuned(walk.fmu, fmu3), updated(fmu3), adjoint(fmu3), tuned_by_ipopt(BUILD / "casadi")]
    show_capabilities(used)
    return verdict(rows, tools, ours=[ours, *masters, *(one for one in used if not one.missing)])


def verdict(
    importers: Sequence[Row], tools: Sequence[PackageRow], *, ours: Sequence[Outcome]
) -> int:
    """Prints the failures and returns the exit code.

    The project's own masters (`ours`) must agree; other tools may be missing.
    """
    wrong = [f"{one.name} does not agree" for one in ours if not one.agrees]
    wrong += shortcomings("importers", importers, wanted=len(IMPORTERS)) + shortcomings(
        "tools for packages", tools, wanted=len(TOOLS)
    )
    for text in wrong:
        print(text, file=sys.stderr)
    return 1 if wrong else 0


def environment() -> Path:
    """Creates or updates the importers' virtual environment; returns its Python."""
    folder, requirements = BUILD / "venv", HERE / "requirements.txt"
    subprocess.run([sys.executable, "-m", "venv", str(folder)], check=True)
    python = folder / "bin" / "python"
    for line in requirements.read_text(encoding="utf-8").splitlines():
        if not line.startswith("#"):
            options = ["--quiet", "--disable-pip-version-check"]
            subprocess.run([str(python), "-m", "pip", "install", *options, line], check=False)
    return python


def install_fmi_sim(python: Path) -> str:
    """Builds fmi-sim from crates.io, with libclang from PyPI and gcc's headers.

    Returns "", or the reason why it cannot be installed.
    """
    folder = BUILD / "cargo"
    if (folder / "bin" / "fmi-sim").exists():
        return ""
    if shutil.which("cargo") is None:
        return "cargo (Rust) is not installed"
    headers = subprocess.run(
        ["gcc", "-print-file-name=include"], capture_output=True, text=True, check=False
    ).stdout.strip()
    libclang = next(python.parents[1].glob("lib/python3*/site-packages/clang/native"), Path())
    environment = os.environ | {
        "LIBCLANG_PATH": str(libclang),
        "BINDGEN_EXTRA_CLANG_ARGS": f"-I{headers}",
    }
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
    return "" if done.returncode == 0 else last_lines(done.stderr)


def run_importer(importer: Importer, walk: ReferenceRun, python: Path, *, missing: str = "") -> Row:
    """Runs the walk with one importer; `missing`: why it could not be installed, if known."""
    missing = missing or not_installed(importer.packages, python)
    if missing:
        return Row(importer.name, "", importer.given, None, None, missing, missing=True)
    outputs = walk.folder / f"{importer.name}.csv"
    found, said = answers(
        [python, ADAPTERS / importer.adapter, walk.fmu, walk.inputs, walk.wanted, outputs], outputs
    )
    release = version(importer.packages[0], python) if importer.packages else FMI_SIM
    if found is None:
        return Row(importer.name, release, importer.given, None, None, said)
    return row(importer.name, release, importer.given, found, walk)


def row(name: str, release: str, given: str, found: Recording, walk: ReferenceRun) -> Row:
    """Compares an importer's outputs with fmpy's."""
    difference, worst = largest_difference(found, walk.reference)
    # importers pass the step size, or the difference of their times
    lengths = (np.full(len(found.time), STEP), np.diff(found.time, prepend=0.0))
    complete = len(found.time) == len(walk.reference.time)
    own = (
        min(largest_difference(found, walk.replay(found.time, steps))[0] for steps in lengths)
        if complete and np.isfinite(found.time).all()
        else None
    )
    return Row(name, release, given, difference, own, worst)


def largest_difference(found: Recording, reference: Recording) -> tuple[float, str]:
    """Returns the largest relative difference of all outputs and times, and the output's name."""
    names = reference.names[1:]
    lacking = set(names).difference(found.names)
    if lacking:
        return np.inf, f"without {min(lacking)}"
    ours, theirs = reference.columns(names), found.columns(names)
    if ours.shape != theirs.shape:
        return np.inf, f"{len(theirs)} rows, expected {len(ours)}"
    relative = np.abs(theirs - ours).max(axis=0) / np.maximum(np.abs(ours).max(axis=0), SMALL)
    relative[np.isnan(relative)] = np.inf
    worst = int(relative.argmax())
    return float(relative[worst]), "" if np.array_equal(ours, theirs) else f"worst: {names[worst]}"


def show(rows: list[Row], walk: ReferenceRun) -> None:
    """Prints the table of importers."""
    count = walk.reference.data.shape[0] * (walk.reference.data.shape[1] - 1)
    title = f"{len(walk.reference.time)} steps of {STEP:g} s, {count} values, against fmpy"
    table = Table(
        "importer",
        "version",
        "inputs",
        "largest difference",
        "told its own times",
        "remark",
        title=title,
    )
    for one in rows:
        table.add_row(
            one.name,
            one.version,
            one.given,
            format_difference(one.difference),
            format_difference(one.own),
            one.remark,
        )
    Console(width=max(150, shutil.get_terminal_size().columns)).print(table)


def show_packages(rows: list[PackageRow]) -> None:
    """Prints the table of packages."""
    title = (
        "plant and controller in a package, against the Python master with the Python controller"
    )
    table = Table("tool", "version", "on time", "measurements a period late", title=title)
    for one in rows:
        table.add_row(
            one.name,
            one.version,
            format_difference(one.on_time),
            format_difference(one.late) if not one.trouble else one.trouble,
        )
    Console(width=max(150, shutil.get_terminal_size().columns)).print(table)


def show_capabilities(rows: Sequence[Capability]) -> None:
    """Prints the table of further capabilities."""
    table = Table("capability", "tool", "difference", title="what few importers use")
    for one in rows:
        missing = "could not be installed" if one.missing else format_difference(one.difference)
        table.add_row(one.name, one.tool, missing)
    Console(width=max(150, shutil.get_terminal_size().columns)).print(table)


def format_difference(difference: float | None) -> str:
    """Formats a difference."""
    return (
        "not run"
        if difference is None
        else f"{difference:.1e}"
        if difference
        else "none, to the last bit"
    )


if __name__ == "__main__":
    sys.exit(main())
