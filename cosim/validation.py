"""Is this FMU one of ours, and sound? fmpy's checks, then what no general checker sees."""

from __future__ import annotations

import math
import zipfile
from contextlib import chdir
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from fmpy import extract
from fmpy.fmi2 import FMU2Slave, fmi2CallbackFunctions
from fmpy.validation import validate_fmu

from hexapod_cosim.cosim.archive_check import archive_problems
from hexapod_cosim.cosim.components import CONTROLLER
from hexapod_cosim.cosim.fmu import Fmu, open_description, read_description
from hexapod_cosim.cosim.plant_files import fmi2_platform, packed_binary
from hexapod_cosim.cosim.signals import Signals
from hexapod_cosim.cosim.validation3 import find_own_problems3
from hexapod_cosim.models import HexapodError

START_VALUES = "resources/start_values.txt"
CHECKSUM = "checksum "
TRIAL_STEP = 0.001  # s
FOREIGN_GUID = "{00000000-0000-0000-0000-000000000000}"


def find_problems(path: Path) -> list[str]:
    """What is wrong with an FMU, one sentence each; empty when it is sound. Raises FmuError when it is no FMU at all."""
    description = open_description(path)
    if description.fmiVersion.startswith("3.") and description.coSimulation is not None:
        return [*map(str, validate_fmu(str(path))), *find_own_problems3(path, description)]
    read_description(path)
    return [*map(str, validate_fmu(str(path))), *find_own_problems(path)]


def find_own_problems(path: Path) -> list[str]:
    """The same without fmpy's checks; what was packed for other machines alone is not run. Raises FmuError when it is no FMU at all."""
    description, problems = read_description(path), archive_problems(path)
    with zipfile.ZipFile(path) as archive:
        problems += _start_value_problems(archive, description)
        runs_here = any(name.startswith(f"binaries/{fmi2_platform()}/") for name in archive.namelist())
    return problems + (_run_problems(path) + _guid_problems(path, description) if runs_here else [])


def _start_value_problems(archive: zipfile.ZipFile, description: Any) -> list[str]:
    """The binary takes its robot from start_values.txt, importers see modelDescription.xml: both must say the same."""
    if START_VALUES not in archive.namelist():
        return [f"{START_VALUES} is missing: the binary takes the robot from it"]
    guid, *lines = archive.read(START_VALUES).decode("utf-8", errors="replace").split("\n")
    lines = [line for line in lines if not line.startswith(CHECKSUM)]  # which the binary checks as it loads
    problems = (
        [] if guid.strip() == description.guid else [f"{START_VALUES} has GUID {guid.strip()!r}, modelDescription.xml {description.guid!r}"]
    )
    known = {variable.valueReference: variable for variable in description.modelVariables}
    for number, line in enumerate(lines, start=2):
        problems += _line_problems(f"{START_VALUES} line {number}", line.split(), known)
    return problems


def _line_problems(where: str, words: list[str], known: dict[int, Any]) -> list[str]:
    if not words:
        return []
    try:
        reference, value = int(words[0]), _number(words[1])
    except (ValueError, IndexError):
        return [f"{where}: got {' '.join(words)!r}, expected a value reference and a value"]
    if reference not in known:
        return [f"{where}: value reference {reference} is not in modelDescription.xml"]
    variable = known[reference]
    stated = _start(variable)
    same = stated is not None and math.isclose(stated, value, rel_tol=1e-12, abs_tol=1e-300)
    return [] if same else [f"{where}: {variable.name} is {value!r}, modelDescription.xml says {variable.start!r}"]


def _number(word: str) -> float:
    return float.fromhex(word) if "x" in word else float(word)


def _start(variable: Any) -> float | None:
    if variable.start in ("true", "false"):
        return float(variable.start == "true")
    return None if variable.start is None else float(variable.start)


def _run_problems(path: Path) -> list[str]:
    """Loads the binary, starts it, takes a step."""
    try:
        with Fmu(path, name="validate") as plant:
            plant.initialise(0.0, 1.0)
            if plant.description.coSimulation.modelIdentifier == CONTROLLER.identifier:
                plant.block(plant.names("output")).get()
            else:
                Signals(plant).read()
            plant.step(0.0, TRIAL_STEP)
    except HexapodError as error:
        return [str(error)]
    return []


def _guid_problems(path: Path, description: Any) -> list[str]:
    """A binary that takes any GUID would run with another model's description."""
    callbacks = fmi2CallbackFunctions()
    with TemporaryDirectory(prefix="hexapod-validate-") as folder:
        extract(path, folder)
        identifier = description.coSimulation.modelIdentifier
        try:
            with chdir(Path.cwd()):  # fmpy leaves the working folder changed when the library does not load
                facts = {"guid": FOREIGN_GUID, "modelIdentifier": identifier, "libraryPath": packed_binary(folder, identifier)}
                slave = FMU2Slave(unzipDirectory=folder, instanceName="validate", **facts)
        except Exception:  # fmpy's errors have no common type; that it does not load is told elsewhere
            return []
        try:
            slave.instantiate(callbacks=callbacks)
        except Exception:  # as it should
            slave.freeLibrary()
            return []
        slave.freeInstance()
    return [f"binaries: {identifier} takes the GUID {FOREIGN_GUID}, expected that of modelDescription.xml alone"]
