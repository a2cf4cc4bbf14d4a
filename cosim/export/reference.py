"""Calculates the reference results inside an FMU, which importers can compare with.

The files are those of the FMI cross-check: NAME_in.csv, NAME_ref.csv, NAME_ref.opt. They are where
the layered standard fmi-ls-ref (1.0.0-alpha.1, the version that the text of its tag v1.0.0-beta.1
gives) has related files, with its manifest. The plant's inputs (a force on the torso, two moving
joints) are sampled at every communication step, so that results do not depend on the importer's
interpolation. Its outputs depend on the state only, so that they may be read before or after the
next inputs are set. The controller's input, a constant speed, is set in initialization mode.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path

from hexapod_cosim.cosim.common.components import PLANT
from hexapod_cosim.cosim.interface.records import Interface
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
STOP, STEP = 1.0, 0.01  # s    the step of the plant; a controller steps by its period
WALK = ("command.vx", 0.08)  # the controller's input [m/s]
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
COMMANDS = ("LF.coxa.angle_ref", "LF.femur.angle_ref", "RM.tibia.angle_ref", "RM.coxa.speed_ref")
# relative; in NAME_ref.opt, for solvers that round differently
TOLERANCE = 1e-6
DIGITS = 12


def reference_members(interface: Interface, fmu: Path) -> dict[str, bytes]:
    """Runs an FMU of FMI 2.0 and returns the three files and their manifest by path in the archive.

    interface: of the plant or a controller. Raises FmuError when it does not run.
    """
    is_plant = interface.component is PLANT
    step, shown = (STEP, OUTPUTS) if is_plant else (interface.step, COMMANDS)
    names, steps = input_names() if is_plant else WALK[:1], round(STOP / step)
    inputs = [
        (k * step, *(float(f"{value:.{DIGITS}g}") for value in values))
        for k in range(steps + 1)
        for values in [_moved(interface, k * step) if is_plant else WALK[1:]]
    ]
    outputs = _run(fmu, names, inputs, shown, step=step)
    name = interface.robot.name + interface.component.suffix
    options = {"StartTime": 0.0, "StopTime": steps * step, "StepSize": step, "RelTol": TOLERANCE}
    lines = [f"{key},{value!r}\n" for key, value in options.items()]
    return {
        f"{FOLDER}/{name}_in.csv": _csv(names, inputs),
        f"{FOLDER}/{name}_ref.csv": _csv(shown, outputs),
        f"{FOLDER}/{name}_ref.opt": "".join(lines).encode(),
        MANIFEST: manifest(name),
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


def _moved(interface: Interface, time: float) -> tuple[float, ...]:
    """Returns the values of the inputs at a time [s]: smooth, zero at first, of different rates."""
    weight = interface.robot.total_mass * math.hypot(*interface.robot.gravity)
    pushes = [PUSH * weight * math.sin(2.0 * math.pi * rate * time) for rate in (1.0, 1.5)]
    swings = [SWING * (1.0 - math.cos(2.0 * math.pi * rate * time)) / 2.0 for rate in (2.0, 1.0)]
    return *pushes, *(
        float(interface.variable(name).start or 0.0) + swing
        for name, swing in zip(MOVED, swings, strict=True)
    )


def _run(
    fmu: Path,
    names: Sequence[str],
    inputs: Sequence[Sequence[float]],
    outputs: Sequence[str],
    *,
    step: float,
) -> list[tuple[float, ...]]:
    """Runs the FMU under inputs; returns time and outputs at each communication point."""
    with Fmu(fmu, name="reference") as instance:
        given, seen = instance.block(names), instance.block(outputs)
        given.values[:] = inputs[0][1:]
        instance.initialise(0.0, inputs[-1][0], given.set)
        rows = []
        for time, *values in inputs:
            seen.get()
            rows.append((time, *seen.values.tolist()))
            given.values[:] = values
            given.set()
            if len(rows) < len(inputs):
                instance.step(time, step)
    return rows


def _csv(names: Sequence[str], rows: Iterable[Sequence[float]]) -> bytes:
    """Formats rows of time and variables as CSV."""
    lines = [",".join(f'"{name}"' for name in ("time", *names))]
    lines += [",".join(f"{value + 0.0:.{DIGITS}g}" for value in row) for row in rows]
    return ("\n".join(lines) + "\n").encode()
