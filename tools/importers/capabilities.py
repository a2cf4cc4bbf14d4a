"""Uses through other tools what few importers use: tunable parameters, intermediate updates and
adjoint derivatives through fmpy, and derivatives by a parameter through CasADi's Ipopt.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave

STEP, STEPS, FINE = 0.005, 16, 1e-4  # s, 1, s
DROP = 0.15  # m  height of the torso from which feet touch down after about 50 ms
GAIN = 30.0  # N m/rad  servo.kp that is set while the robot falls
EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "07_casadi.py"
FOUND = "servo.kp 52.6 N m/rad, height 10.42 mm"  # what the example prints
CASADI = "casadi==3.8.2"


@dataclass(frozen=True)
class Capability:
    """How far a tool's numbers are from what they should be; None: it gave none."""

    name: str
    tool: str
    difference: float | None
    limit: float
    missing: bool = False  # whether the tool could not be installed

    @property
    def agrees(self) -> bool:
        """Whether the difference is within the limit."""
        return self.difference is not None and self.difference <= self.limit


@contextmanager
def running(fmu: Path, update: Callable[..., None] | None = None) -> Iterator[Any]:
    """Yields an instance of fmpy of either version, dropped from DROP, and its references."""
    description = fmpy.read_model_description(str(fmu))
    folder = TemporaryDirectory()
    facts = {
        "guid": description.guid,
        "modelIdentifier": description.coSimulation.modelIdentifier,
        "unzipDirectory": fmpy.extract(str(fmu), folder.name),
        "instanceName": "plant",
    }
    reference = {one.name: one.valueReference for one in description.modelVariables}
    if description.fmiVersion == "2.0":
        slave = FMU2Slave(**facts)
        slave.instantiate()
        slave.setupExperiment()
        slave.setReal([reference["initial.position[3]"]], [DROP])
    else:
        slave = FMU3Slave(**facts)
        slave.instantiate(intermediateUpdate=update)
        slave.setFloat64([reference["initial.position"]], [0.0, 0.0, DROP])
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    yield slave, reference
    slave.terminate()
    slave.freeInstance()
    folder.cleanup()


def tuned(fmu2: Path, fmu3: Path) -> Capability:
    """Returns the difference of the heights after a gain is tuned in FMI 2.0 and in FMI 3.0."""
    with running(fmu2) as (two, of2), running(fmu3) as (three, of3):
        for k in range(STEPS):
            if k == STEPS // 2:
                two.setReal([of2["servo.kp"]], [GAIN])
                three.setFloat64([of3["servo.kp"]], [GAIN])
            two.doStep(k * STEP, STEP)
            three.doStep(k * STEP, STEP)
        kept = three.getFloat64([of3["servo.kp"]])[0] == GAIN
        torques = [two.getReal([of2["LF.femur.torque"]])[0]]
        torques.append(three.getFloat64([of3["torque"]], 18)[1])
    return Capability(
        "tunable parameter, FMI 2.0 against 3.0", "fmpy",
        abs(torques[0] - torques[1]) if kept else None, 0.0,
    )  # fmt: skip


def updated(fmu3: Path) -> Capability:
    """Returns the difference of heights at intermediate updates from those at every 0.1 ms [m]."""
    seen: list[tuple[float, float]] = []

    def update(_environment: Any, time: float, *_: Any) -> None:
        seen.append((time, watched.getFloat64([of["torso.position"]], 3)[2]))

    every = []
    with running(fmu3, update) as (watched, of), running(fmu3) as (fine, _):
        for k in range(STEPS):
            watched.doStep(k * STEP, STEP)
        for k in range(round(STEPS * STEP / FINE)):
            every.append(fine.getFloat64([of["torso.position"]], 3)[2])
            fine.doStep(k * FINE, FINE)
    times, heights = np.array(seen).reshape(-1, 2).T
    curve = np.interp(times, FINE * np.arange(len(every)), every)
    return Capability(
        "intermediate update against steps of 0.1 ms", "fmpy",
        float(np.abs(heights - curve).max()) if len(times) > STEPS else None, 2e-7,
    )  # fmt: skip


def adjoint(fmu3: Path) -> Capability:
    """Returns the relative difference of adjoint derivatives from seeded directional ones."""
    with running(fmu3) as (slave, of):
        slave.doStep(0.0, STEP)
        unknowns, knowns = [of["der(speed)"], of["torso.velocity"]], [of["servo.kp"], of["angle"]]
        rows, columns = 18 + 3, 1 + 18
        seed = np.random.default_rng(1).normal(size=rows)
        found = slave.getAdjointDerivative(unknowns, knowns, list(seed), columns)
        expected = [
            seed @ slave.getDirectionalDerivative(unknowns, knowns, list(one), rows)
            for one in np.eye(columns)
        ]
    difference = np.abs(np.array(found) - expected).max() / np.abs(expected).max()
    return Capability("adjoint against directional derivatives", "fmpy", float(difference), 1e-12)


def tuned_by_ipopt(folder: Path) -> Capability:
    """Runs the example with CasADi, installed into a folder; 0: it found what it should."""
    pip: Sequence[str] = ("install", "--quiet", "--no-deps", "--target", str(folder), CASADI)
    row = ("gain and foot path by Ipopt", CASADI.replace("==", " "))
    if not (folder / "casadi").exists():
        done = subprocess.run([sys.executable, "-m", "pip", *pip], check=False)
        if done.returncode:
            return Capability(*row, None, 0.0, missing=True)
    environment = os.environ | {"PYTHONPATH": str(folder)}
    said = subprocess.run(
        [sys.executable, str(EXAMPLE)], env=environment, capture_output=True, text=True, check=False
    )
    return Capability(*row, 0.0 if FOUND in said.stdout else None, 0.0)
