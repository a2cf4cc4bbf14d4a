"""Is this FMI 3.0 FMU one of ours, and sound? What `cosim/validate/validation.py` asks of FMI
2.0, where the standards differ.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import chdir, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from xml.etree import ElementTree

from fmpy import extract, platform_tuple
from fmpy.fmi3 import FMU3Slave

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

SCHEMAS = {
    DESCRIPTION: "fmi3ModelDescription",
    BUILD_DESCRIPTION: "fmi3BuildDescription",
    TERMINALS: "fmi3TerminalsAndIcons",
}
FOREIGN_TOKEN = "{00000000-0000-0000-0000-000000000000}"
TRIAL_STEP = 0.001  # s


def find_own_problems3(path: Path, description: Any) -> list[str]:
    """What is wrong, one sentence each, of an FMU whose model description fmpy has read."""
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
    return problems or _run_problems(path, description)


def _source_problems(found: dict[str, bytes]) -> Iterator[str]:
    """Sources listed and present, both ways."""
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


def _run_problems(path: Path, description: Any) -> list[str]:
    """Loads this machine's binary, if there is one, starts it and takes a step; and it must
    refuse a foreign token.
    """
    with TemporaryDirectory(prefix="hexapod-validate-") as folder:
        extract(path, folder)
        if not (Path(folder) / "binaries" / platform_tuple).is_dir():
            return []
        try:
            _try(folder, description, description.instantiationToken)
        except Exception as error:  # fmpy's errors have no common type
            return [f"binaries: {error}"]
        with suppress(Exception):  # as it should
            _try(folder, description, FOREIGN_TOKEN)
            return [
                f"binaries: it takes the token {FOREIGN_TOKEN}, expected that of modelDescription.xml alone"
            ]
    return []


def _try(folder: str, description: Any, token: str) -> None:
    """Raises what fmpy raises when a call comes back with an error."""
    identifier = description.coSimulation.modelIdentifier
    with chdir(Path.cwd()):  # fmpy leaves the working folder changed when the library does not load
        fmu = FMU3Slave(
            guid=token, modelIdentifier=identifier, unzipDirectory=folder, instanceName="validate"
        )
    try:
        fmu.instantiate(logMessage=_say_nothing)
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


def _say_nothing(*_: object) -> None:
    """A logger."""
