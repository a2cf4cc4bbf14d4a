"""Validates FMI 3.0 FMUs: the checks of validation.py that differ between the standards."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import chdir, suppress
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from fmpy import platform_tuple
from fmpy.fmi3 import FMU3Slave

from hexapod_cosim.cosim.common.archives import unpack
from hexapod_cosim.cosim.common.binaries import refuse_incomplete
from hexapod_cosim.cosim.common.temporary import TemporaryFolder
from hexapod_cosim.cosim.interface.descriptions import open_description
from hexapod_cosim.cosim.validate.archive import (
    BUILD_DESCRIPTION,
    DESCRIPTION,
    TERMINALS,
    member_problems,
    read_members,
)
from hexapod_cosim.cosim.validate.description import schema_problems
from hexapod_cosim.cosim.validate.description3 import description_problems3, variables3
from hexapod_cosim.cosim.validate.start_value import START_VALUES, start_value_problems
from hexapod_cosim.cosim.validate.trial import problems_of_a_trial

SCHEMAS = {
    DESCRIPTION: "fmi3ModelDescription",
    BUILD_DESCRIPTION: "fmi3BuildDescription",
    TERMINALS: "fmi3TerminalsAndIcons",
}
FOREIGN_TOKEN = "{00000000-0000-0000-0000-000000000000}"
TRIAL_STEP = 0.001  # s


def find_own_problems3(path: Path, description: Any) -> list[str]:
    """Returns the problems of an FMU whose model description fmpy has read, one sentence each."""
    found, problems = read_members(path)
    if found is None:
        return problems
    for member, schema in SCHEMAS.items():
        problems += (
            schema_problems(member, found[member], f"fmi3/{schema}.xsd")
            if member in found
            else [f"{member} is missing"]
        )
    if problems:
        return problems
    root = ElementTree.fromstring(found[DESCRIPTION])
    problems += [*description_problems3(root), *_source_problems(found)]
    problems += member_problems(
        root, found, [variable.name for variable in variables3(root)], fmi=3
    )
    problems += start_value_problems(
        found.get(START_VALUES), description.instantiationToken, description
    )
    return problems or problems_of_a_trial(binary_problems3, path)


def _source_problems(found: dict[str, bytes]) -> Iterator[str]:
    """Yields sources that are listed but missing, or present but not listed."""
    root = ElementTree.fromstring(found[BUILD_DESCRIPTION])
    listed = {f"sources/{file.get('name')}" for file in root.iter("SourceFile")}
    for name in sorted(listed - set(found)):
        yield f"{BUILD_DESCRIPTION} lists {name}, which is not in the archive"
    for name in sorted(
        name
        for name in found
        if name.startswith("sources/") and name.endswith(".c") and name not in listed
    ):
        yield f"{name} is not listed by {BUILD_DESCRIPTION}"


def binary_problems3(path: Path) -> list[str]:
    """Loads, initializes and steps the FMU in this process, and checks that it refuses another
    token; returns the problems. An FMU without a binary for this machine has none.
    """
    description = open_description(path)
    with TemporaryFolder("validate") as folder:
        unpack(path, folder)
        binaries = folder / "binaries" / platform_tuple
        if not binaries.is_dir():
            return []
        try:
            for library in binaries.iterdir():
                refuse_incomplete(library)
            _run_step(str(folder), description, description.instantiationToken)
        except Exception as error:  # fmpy's errors have no common type
            return [f"binaries: {error}"]
        with suppress(Exception):  # the binary refuses the token
            _run_step(str(folder), description, FOREIGN_TOKEN)
            return [
                (
                    f"binaries: it takes the token {FOREIGN_TOKEN}, expected that of "
                    "modelDescription.xml alone"
                )
            ]
    return []


def _run_step(folder: str, description: Any, token: str) -> None:
    """Runs the FMU for one step. Raises fmpy's exceptions when a call fails."""
    identifier = description.coSimulation.modelIdentifier
    with chdir(Path.cwd()):  # fmpy does not restore the working folder when loading fails
        fmu = FMU3Slave(
            guid=token, modelIdentifier=identifier, unzipDirectory=folder, instanceName="validate"
        )
    try:
        fmu.instantiate(logMessage=_ignore_message)
    except Exception:
        fmu.freeLibrary()
        raise
    try:
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        fmu.doStep(0.0, TRIAL_STEP)
        fmu.terminate()
    finally:
        fmu.freeInstance()


def _ignore_message(*_: object) -> None:
    """Ignores a log message."""
