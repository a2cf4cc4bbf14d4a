"""Calculates the reference results inside an FMU, which importers can compare with.

The files are those of the FMI cross-check: NAME_in.csv, NAME_ref.csv, NAME_ref.opt. They are where
the layered standard fmi-ls-ref (1.0.0-alpha.1, the version that the text of its tag v1.0.0-beta.1
gives) has related files, with its manifest. The inputs (a force on the torso, two moving joints)
are sampled at every communication step, so that results do not depend on the importer's
interpolation. The outputs depend on the state only, so that they may be read before or after the
next inputs are set.

An FMU of FMI 3.0 has arrays: a column is a whole array, with its elements in a cell, separated by
spaces, as fmpy and the Reference FMUs read and write them. Its binary is that of FMI 2.0 and gives
the same bits, so its results are calculated with an FMU of FMI 2.0.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import accumulate, pairwise
from pathlib import Path

from hexapod_cosim.cosim.interface.arrays import arrays
from hexapod_cosim.cosim.interface.plant_interface import Interface
from hexapod_cosim.cosim.master.fmu import Fmu

STANDARD, STANDARD_VERSION = "org.fmi-standard.fmi-ls-ref", "1.0.0-alpha.1"
ABOUT_STANDARD = "Layered Standard providing information on related files included in an FMU."
FOLDER = f"extra/{STANDARD}"
MANIFEST = f"{FOLDER}/fmi-ls-manifest.xml"
MANIFEST_NAMESPACE = "http://fmi-standard.org/fmi-ls-manifest"
# type, ending of the name, role in the standard, description
FILES = (
    ("text/csv", "in.csv", "testcase", "Inputs at every communication point"),
    ("text/csv", "ref.csv", "result", "Outputs where the FMU was packed"),
    ("text/csv", "ref.opt", "configuration", "Start, stop, step, relative tolerance"),
)
STEP, STEPS = 0.01, 100  # s, 1
PUSH = 0.05  # amplitude, of the robot's weight
SWING = 0.05  # rad, amplitude of the moving joints
MOVED = ("LF.femur.angle_ref", "RR.coxa.angle_ref")
OUTPUTS = (
    "torso.position[1]",
    "torso.position[2]",
    "torso.position[3]",
    "torso.roll",
    "torso.pitch",
    "torso.yaw",
    "LF.femur.angle",
    "RR.coxa.angle",
    "LM.foot.normal_force",
    "RM.foot.normal_force",
    "energy.kinetic",
)
# relative; in NAME_ref.opt, for solvers that round differently
TOLERANCE = 1e-6
DIGITS = 12


def reference_members(interface: Interface, fmu: Path, *, fmi: int = 2) -> dict[str, bytes]:
    """Runs an FMU and returns the three files and their manifest by path in the archive.

    Args:
        interface: of the plant.
        fmu: of FMI 2.0.
        fmi: version of the standard that the files are for.

    Raises FmuError when it does not run.
    """
    given = columns(interface, input_names(), fmi=fmi)
    seen = columns(interface, OUTPUTS, fmi=fmi)
    names = tuple(name for group in given.values() for name in group)
    inputs = [
        (k * STEP, *(float(f"{value:.{DIGITS}g}") for value in _inputs(interface, names, k * STEP)))
        for k in range(STEPS + 1)
    ]
    outputs = _run(fmu, names, inputs, [name for group in seen.values() for name in group])
    start = f"{FOLDER}/{interface.robot.name}"
    options = {"StartTime": 0.0, "StopTime": STEPS * STEP, "StepSize": STEP, "RelTol": TOLERANCE}
    return {
        f"{start}_in.csv": _csv(given, inputs),
        f"{start}_ref.csv": _csv(seen, outputs),
        f"{start}_ref.opt": "".join(
            f"{name},{value!r}\n" for name, value in options.items()
        ).encode(),
        MANIFEST: manifest(interface.robot.name),
    }


def manifest(name: str) -> bytes:
    """Returns the standard's manifest of the three files."""
    related = "".join(
        f'  <Related type="{kind}" source="{name}_{ending}" role="{role}"\n'
        f'    description="{about}"/>\n'
        for kind, ending, role, about in FILES
    )
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        f'<fmiReferences xmlns:fmi-ls="{MANIFEST_NAMESPACE}"\n'
        f'  fmi-ls:fmi-ls-name="{STANDARD}"\n'
        f'  fmi-ls:fmi-ls-version="{STANDARD_VERSION}"\n'
        f'  fmi-ls:fmi-ls-description="{ABOUT_STANDARD}">\n{related}</fmiReferences>\n'
    ).encode()


def input_names() -> tuple[str, ...]:
    """Returns the inputs that the run changes; the others keep their start values."""
    return ("torso.push_force[1]", "torso.push_force[2]", *MOVED)


def columns(
    interface: Interface, names: Sequence[str], *, fmi: int = 2
) -> dict[str, tuple[str, ...]]:
    """Returns the variables of FMI 2.0 in each column; in FMI 3.0 a column is a whole array."""
    if fmi == 2:
        return {name: (name,) for name in names}
    wanted = set(names)
    groups = (
        (array.name, tuple(one.name for one in array.elements)) for array in arrays(interface)
    )
    return {name: elements for name, elements in groups if wanted & set(elements)}


def _inputs(interface: Interface, names: Sequence[str], time: float) -> tuple[float, ...]:
    """Returns the values of inputs at a time [s]; those that do not move have their start values.

    The others are smooth, zero at the start, of different frequencies.
    """
    moved = dict(zip(input_names(), _moved(interface, time), strict=True))
    return tuple(moved.get(name, float(interface.variable(name).start or 0.0)) for name in names)


def _moved(interface: Interface, time: float) -> tuple[float, ...]:
    """Returns the values of the moved inputs at a time [s]."""
    weight = interface.robot.total_mass * math.hypot(*interface.robot.gravity)
    pushes = [PUSH * weight * math.sin(2.0 * math.pi * rate * time) for rate in (1.0, 1.5)]
    swings = [SWING * (1.0 - math.cos(2.0 * math.pi * rate * time)) / 2.0 for rate in (2.0, 1.0)]
    return *pushes, *(
        float(interface.variable(name).start or 0.0) + swing
        for name, swing in zip(MOVED, swings, strict=True)
    )


def _run(
    fmu: Path, names: Sequence[str], inputs: Sequence[Sequence[float]], outputs: Sequence[str]
) -> list[tuple[float, ...]]:
    """Runs the FMU under inputs; returns time and outputs at each communication point."""
    with Fmu(fmu, name="reference") as plant:
        plant.initialise(0.0, STEPS * STEP)
        given, seen = plant.block(names), plant.block(outputs)
        rows = []
        for time, *values in inputs:
            seen.get()
            rows.append((time, *seen.values.tolist()))
            given.values[:] = values
            given.set()
            if len(rows) <= STEPS:
                plant.step(time, STEP)
    return rows


def _csv(groups: Mapping[str, Sequence[str]], rows: Iterable[Sequence[float]]) -> bytes:
    """Formats rows of time and variables as CSV.

    groups: the variables in each column after the time; spaces separate those of one column.
    """
    ends = list(accumulate([1, *map(len, groups.values())]))
    lines = [",".join(f'"{name}"' for name in ("time", *groups))]
    for row in rows:
        cells = [row[first:last] for first, last in pairwise([0, *ends])]
        lines.append(",".join(" ".join(map(_number, cell)) for cell in cells))
    return ("\n".join(lines) + "\n").encode()


def _number(value: float) -> str:
    return f"{value + 0.0:.{DIGITS}g}"


def read_csv(data: bytes) -> Mapping[str, list[float]]:
    """Returns the columns of a reference file by name.

    A column of arrays has all elements of the first row, then those of the second.
    """
    header, *rows = data.decode().splitlines()
    cells = zip(*(row.split(",") for row in rows), strict=True)
    return {
        name.strip('"'): [float(value) for cell in column for value in cell.split()]
        for name, column in zip(header.split(","), cells, strict=True)
    }
