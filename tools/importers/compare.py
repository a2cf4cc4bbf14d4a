"""`python -m tools.importers.compare`: the same recorded walk through importers that no one here
wrote, and how far each is from fmpy.

Everything lies in build/importers: an environment of the importers' own, the walk, each importer's
answers. An importer that cannot be installed on this machine is named with the reason; one that was
installed has to run and agree, or the exit code says so.
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
from hexapod_cosim.cosim.master.recorder import Recording
from tools.importers.outcome import (
    Outcome,
    answers,
    last_lines,
    not_installed,
    shortcomings,
    version,
)
from tools.importers.packages import TOOLS, PackageRow, compare_packages
from tools.importers.walk import STEP, Walk, record

HERE = Path(__file__).resolve().parent
ADAPTERS = HERE / "adapters"
BUILD = HERE.parents[1] / "build" / "importers"
DURATION = 3.0  # s    three gait cycles and a half
# a last bit in when a step ends, carried through touch-downs; steepest rises of forces hold second
# differences of depths
ROUND_OFF = 2e-9
# SI     an output that never gets larger is judged by this: residuals are themselves round-off
SMALL = 1e-3
FMI_SIM = "0.7.0"


@dataclass(frozen=True)
class Importer:
    """A program that walks: `adapter` FMU INPUTS NAMES OUTPUTS."""

    name: str
    packages: tuple[str, ...]  # of PyPI, itself first; (): of crates.io
    adapter: str
    given: str  # how it takes inputs


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
    """What came of an importer. Differences are the largest of all outputs and times, each of its
    output's largest value.

    difference: from fmpy;  own: from fmpy told the importer's own times, to the last bit;  missing:
    it could not be installed.
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
        """It ran, and what is left is round-off."""
        return self.difference is not None and self.difference <= ROUND_OFF


def main() -> int:
    """Prints the table; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--duration", type=float, default=DURATION, help="of the walk [s]")
    duration = parser.parse_args().duration
    walk = record(BUILD / "walk", duration=duration)
    python = environment()
    ours = row("hexapod's master", package_version(), "as recorded", walk.recorded, walk)
    missing = install_fmi_sim(python)
    rows = [
        through(importer, walk, python, missing="" if importer.packages else missing)
        for importer in IMPORTERS
    ]
    show([ours, *rows], walk)
    masters, tools = compare_packages(BUILD / "package", python, duration=duration)
    show_packages([*masters, *tools])
    return verdict(rows, tools, ours=[ours, *masters])


def verdict(
    importers: Sequence[Row], tools: Sequence[PackageRow], *, ours: Sequence[Outcome]
) -> int:
    """Says what is not good enough, and returns the exit code. Masters of our own (`ours`) have
    to agree, whatever can be installed.
    """
    wrong = [f"{one.name} does not agree" for one in ours if not one.agrees]
    wrong += shortcomings("importers", importers, wanted=len(IMPORTERS)) + shortcomings(
        "tools for packages", tools, wanted=len(TOOLS)
    )
    for text in wrong:
        print(text, file=sys.stderr)
    return 1 if wrong else 0


def environment() -> Path:
    """Python of the importers' environment, made or brought up to date."""
    folder, requirements = BUILD / "venv", HERE / "requirements.txt"
    subprocess.run([sys.executable, "-m", "venv", str(folder)], check=True)
    python = folder / "bin" / "python"
    for line in requirements.read_text(encoding="utf-8").splitlines():
        if not line.startswith("#"):
            subprocess.run(
                [
                    str(python),
                    "-m",
                    "pip",
                    "install",
                    "--quiet",
                    "--disable-pip-version-check",
                    line,
                ],
                check=False,
            )
    return python


def install_fmi_sim(python: Path) -> str:
    """fmi-sim from crates.io; returns "", or why it cannot be had. To build it takes libclang,
    which PyPI has, and gcc's headers.
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


def through(importer: Importer, walk: Walk, python: Path, *, missing: str = "") -> Row:
    """The walk through one importer; `missing`: why it could not be installed, if that is known."""
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


def row(name: str, release: str, given: str, found: Recording, walk: Walk) -> Row:
    """An importer's answers, judged."""
    difference, worst = judged(found, walk.reference)
    lengths = (
        np.full(len(found.time), STEP),
        np.diff(found.time, prepend=0.0),
    )  # importers pass h, or the difference of their times
    whole = len(found.time) == len(walk.reference.time)
    own = (
        min(judged(found, walk.replay(found.time, steps))[0] for steps in lengths)
        if whole and np.isfinite(found.time).all()
        else None
    )
    return Row(name, release, given, difference, own, worst)


def judged(found: Recording, reference: Recording) -> tuple[float, str]:
    """The largest difference of all outputs and times, of the output's largest value, and where."""
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


def show(rows: list[Row], walk: Walk) -> None:
    """Prints the table."""
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
            one.name, one.version, one.given, shown(one.difference), shown(one.own), one.remark
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
            shown(one.prompt),
            shown(one.late) if not one.trouble else one.trouble,
        )
    Console(width=max(150, shutil.get_terminal_size().columns)).print(table)


def shown(difference: float | None) -> str:
    """A difference, or what stands for it."""
    return (
        "not run"
        if difference is None
        else f"{difference:.1e}"
        if difference
        else "none, to the last bit"
    )


if __name__ == "__main__":
    sys.exit(main())
