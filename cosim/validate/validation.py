"""Validates FMUs that this package wrote: with fmpy's checks and with checks of its own."""

from __future__ import annotations

import zipfile
from contextlib import chdir
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from fmpy.fmi2 import FMU2Slave, fmi2CallbackFunctions
from fmpy.validation import validate_fmu

from hexapod_cosim.cosim.common.archives import unpack, unsafe_members
from hexapod_cosim.cosim.common.binaries import incomplete
from hexapod_cosim.cosim.common.components import CONTROLLER, POLICY
from hexapod_cosim.cosim.common.plant_files import fmi2_platform, packed_binary
from hexapod_cosim.cosim.common.temporary import TemporaryFolder
from hexapod_cosim.cosim.interface.descriptions import (
    forbidden_markup,
    open_description,
    read_description,
)
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.master.signals import Signals
from hexapod_cosim.cosim.validate.archive import (
    DESCRIPTION,
    archive_problems,
    read_members,
    zip_problems,
)
from hexapod_cosim.cosim.validate.description import description_problems, schema_problems
from hexapod_cosim.cosim.validate.description3 import description_problems3
from hexapod_cosim.cosim.validate.start_value import START_VALUES, start_value_problems
from hexapod_cosim.cosim.validate.trial import problems_of_a_trial
from hexapod_cosim.cosim.validate.validation3 import find_own_problems3
from hexapod_cosim.models import FmuError, HexapodError

TRIAL_STEP = 0.001  # s
FOREIGN_GUID = "{00000000-0000-0000-0000-000000000000}"


def find_problems(path: Path) -> list[str]:
    """Returns the problems of an FMU, one sentence each; empty for a valid FMU.

    Raises FmuError for a file that is no FMU.
    """
    try:
        description = open_description(path)
    except FmuError:
        problems = _unread_problems(path)
        if not problems:
            raise
        return problems
    if description.fmiVersion.startswith("3.") and description.coSimulation is not None:
        return [*map(str, validate_fmu(str(path))), *find_own_problems3(path, description)]
    read_description(path)
    return [*map(str, validate_fmu(str(path))), *find_own_problems(path)]


def _unread_problems(path: Path) -> list[str]:
    """Returns the problems of a modelDescription.xml that fmpy cannot read.

    Empty if it is no XML.
    """
    unsafe = _unsafe_problems(path)
    if unsafe:
        return unsafe
    try:
        with zipfile.ZipFile(path) as archive:
            data = archive.read(DESCRIPTION)
        root = ElementTree.fromstring(data)
    except Exception:  # also zlib's and the parser's: the error that was raised says why
        return []
    if forbidden_markup(data):
        return []
    fmi3 = root.get("fmiVersion", "").startswith("3.")
    broken = schema_problems(
        DESCRIPTION,
        data,
        "fmi3/fmi3ModelDescription.xsd" if fmi3 else "fmi2/fmi2ModelDescription.xsd",
    )
    return broken or (description_problems3 if fmi3 else description_problems)(root)


def _unsafe_problems(path: Path) -> list[str]:
    """Returns why the archive is not unpacked, and its violations of the ZIP format."""
    try:
        with zipfile.ZipFile(path) as archive:
            unsafe = [
                f"{what}: got {got!r}, expected {expected}"
                for what, got, expected in unsafe_members(archive.infolist())
            ]
            return [*zip_problems(archive), *unsafe] if unsafe else []
    except Exception:  # no archive
        return []


def find_own_problems(path: Path) -> list[str]:
    """Returns the problems that this package's own checks find in an FMI 2.0 FMU.

    An FMU without a binary for this machine is not run. Raises FmuError for a file that is no FMU.
    """
    description, (found, damaged) = read_description(path), read_members(path)
    if found is None:
        return damaged
    problems = archive_problems(path)
    with zipfile.ZipFile(path) as archive:
        names = archive.namelist()
        data = archive.read(START_VALUES) if START_VALUES in names else None
        problems += start_value_problems(data, description.guid, description)
        runs_here = any(name.startswith(f"binaries/{fmi2_platform()}/") for name in names)
    return problems + (problems_of_a_trial(binary_problems, path) if runs_here else [])


def binary_problems(path: Path) -> list[str]:
    """Returns the problems that show when the FMU runs in this process."""
    return _run_problems(path) + _guid_problems(path, read_description(path))


def _run_problems(path: Path) -> list[str]:
    """Loads, initializes and steps the FMU; returns the error, if any."""
    try:
        with Fmu(path, name="validate") as plant:
            plant.initialise(0.0, 1.0)
            identifier = plant.description.coSimulation.modelIdentifier
            if identifier in (CONTROLLER.identifier, POLICY.identifier):
                plant.block(plant.names("output")).get()
            else:
                Signals(plant).read()
            plant.step(0.0, TRIAL_STEP)
    except HexapodError as error:
        return [str(error)]
    return []


def _guid_problems(path: Path, description: Any) -> list[str]:
    """Checks that the binary refuses another model description's GUID."""
    callbacks = fmi2CallbackFunctions()
    with TemporaryFolder("validate") as folder:
        unpack(path, folder)
        identifier = description.coSimulation.modelIdentifier
        library = packed_binary(folder, identifier)
        if library is not None and incomplete(Path(library).read_bytes()):
            return []  # archive_problems reports it; loading it would end this process
        try:
            with chdir(Path.cwd()):  # fmpy does not restore the working folder when loading fails
                facts = {
                    "guid": FOREIGN_GUID,
                    "modelIdentifier": identifier,
                    "libraryPath": library,
                }
                slave = FMU2Slave(unzipDirectory=folder, instanceName="validate", **facts)
        except Exception:  # fmpy's errors have no common type; _run_problems reports this one
            return []
        try:
            slave.instantiate(callbacks=callbacks)
        except Exception:  # the binary refuses the GUID
            slave.freeLibrary()
            return []
        slave.freeInstance()
    return [
        (
            f"binaries: {identifier} takes the GUID {FOREIGN_GUID}, expected that of "
            "modelDescription.xml alone"
        )
    ]
