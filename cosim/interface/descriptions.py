"""Reads model descriptions of FMUs with fmpy."""

from __future__ import annotations

import re
from collections.abc import Collection
from pathlib import Path
from typing import Any
from zipfile import ZipFile

from fmpy import read_model_description

from hexapod_cosim.cosim.common.archives import MAKE, NEEDED, open_archive, read_member
from hexapod_cosim.models.errors import FmuError, refuse_path

DESCRIPTION = "modelDescription.xml"
IDENTIFIER = r"[A-Za-z_]\w{0,199}"


def read_description(path: Path, versions: Collection[str] = ("2.0",)) -> Any:
    """Returns fmpy's model description of a co-simulation FMU of one of the versions of FMI.

    Raises FmuError for any other file.
    """
    description = open_description(path)
    refuse_other_kinds(description, path, versions)
    return description


def refuse_other_kinds(description: Any, path: Path, versions: Collection[str]) -> None:
    """Raises FmuError for a description of another version, or without co-simulation."""
    if description.fmiVersion not in versions or description.coSimulation is None:
        kind = "co-simulation" if description.coSimulation else "model exchange only"
        got = f"FMI {description.fmiVersion}, {kind}"
        expected = f"FMI {' or '.join(versions)} for co-simulation"
        raise _refusal("wrong kind of FMU", got, expected, path)


def open_description(path: Path) -> Any:
    """Returns fmpy's model description of an FMU of any version.

    Raises FmuError for a file that is no FMU.
    """
    refuse_unsafe(path)
    try:
        description = read_model_description(path, validate=False)
    except Exception as error:
        of_python = isinstance(error, TypeError | AttributeError | ValueError | LookupError)
        what = f"the FMU's {DESCRIPTION} cannot be read"
        expected = "XML after the standard's schema"
        got = "missing or wrong attributes" if of_python else str(error)
        raise _refusal(what, got, expected, path) from error
    _refuse_identifiers(description, path)
    return description


def refuse_unsafe(path: Path) -> None:
    """Raises FmuError for a file that fmpy is not given to read.

    These are other files than FMUs, archives that are unsafe to unpack and XML with entities.
    """
    refuse_path(path, "an FMU", FmuError)
    if not path.is_file():
        raise FmuError("no such FMU", got=str(path), expected="an existing .fmu file", fix=MAKE)
    try:
        with open_archive(path) as archive:
            _refuse_markup(archive, path)
    except KeyError as error:
        raise _refusal("not an FMU", error.args[0], NEEDED, path) from error


def _refuse_markup(archive: ZipFile, path: Path) -> None:
    """Raises FmuError for a model description with a document type, which may define entities."""
    archive.getinfo(DESCRIPTION)  # raises KeyError
    found = forbidden_markup(read_member(archive, DESCRIPTION))
    if found:
        expected = "XML in UTF-8 without a document type, which might define entities"
        raise _refusal(f"{DESCRIPTION} is not read", found, expected, path)


def forbidden_markup(data: bytes) -> str | None:
    """Returns what a document holds that is not read: a document type or another encoding."""
    if b"\0" in data or data.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "another encoding than UTF-8"
    return "<!DOCTYPE" if b"<!DOCTYPE" in data or b"<!ENTITY" in data else None


def _refuse_identifiers(description: Any, path: Path) -> None:
    """Raises FmuError for a modelIdentifier that is no name of a file in the archive."""
    for kind in (description.coSimulation, description.modelExchange):
        name = "hexapod" if kind is None else kind.modelIdentifier
        if not re.fullmatch(IDENTIFIER, str(name), re.ASCII):
            expected = "a C identifier of at most 200 characters, such as hexapod"
            raise _refusal("modelIdentifier is no file's name", name, expected, path)


def _refusal(what: str, got: object, expected: str, path: Path) -> FmuError:
    """Returns the error for a file that is no FMU of the kind that is needed."""
    return FmuError(what, got=got, expected=expected, fix=MAKE, where=str(path))
