"""Reads and writes files of gains (TOML)."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from hexapod_cosim.controller.gains import SECTIONS, Gains, GainsError
from hexapod_cosim.models import RobotError
from hexapod_cosim.models.errors import check_type, refuse_path
from hexapod_cosim.models.files import decoding_toml, parse_toml, read_text
from hexapod_cosim.models.schema import read_given, read_record, require, specs

FORMAT = 5


@contextmanager
def raising_gains_errors() -> Iterator[None]:
    """Turns the errors of checked records into GainsError."""
    try:
        yield
    except RobotError as error:
        raise GainsError(
            error.what, got=error.got, expected=error.expected, fix=error.fix, where=error.where
        ) from error


def save_gains(gains: Gains, path: str | Path) -> Path:
    """Writes a gains file (TOML, floats to the last bit).

    Raises GainsError for other gains and when the file cannot be written.
    """
    check_type(gains, Gains, "gains, as of load_gains()", where="gains", error=GainsError)
    refuse_path(path, "the gains file", GainsError)
    lines = ["# Gains of compliant and paper control, SI units; made by `hexapod design`."]
    lines += [f"format = {FORMAT}", *_toml_lines(gains)]
    for part in SECTIONS:
        lines += ["", f"[{part}]", *_toml_lines(getattr(gains, part))]
    target = Path(path)
    partial = target.with_name(target.name + ".partial")
    try:
        partial.write_text("\n".join(lines) + "\n", encoding="utf-8")
        partial.replace(target)
    except OSError as error:
        what, fix = "cannot write the gains file", "choose a writable folder"
        raise GainsError(what, got=error.strerror, fix=fix, where=str(target)) from error
    return target


def _toml_lines(record: Any) -> list[str]:
    """Returns a line for each plain field of a record; a margin without a limit has none."""
    values = {key: getattr(record, key) for key in specs(type(record))}
    return [
        f"{key} = {json.dumps(value) if isinstance(value, str | tuple) else repr(value)}"
        for key, value in values.items()
        if value != math.inf
    ]


def load_gains(path: str | Path) -> Gains:
    """Reads and checks a gains file.

    Raises GainsError: the file, the key, what was got and expected.
    """
    refuse_path(path, "the gains file", GainsError)
    try:
        with decoding_toml(Path(path), kind="gains", error=GainsError):
            table = parse_toml(read_text(Path(path)))
    except OSError as error:
        what, fix = "cannot read the gains file", "make one with `hexapod design`"
        raise GainsError(what, got=error.strerror, fix=fix, where=str(path)) from error
    found, expected = table.pop("format", "no format"), f"format = {FORMAT}"
    if found != FORMAT:
        what, fix = "unknown format of gains", "make the file again with `hexapod design`"
        raise GainsError(what, got=found, expected=expected, fix=fix, where=str(path))
    with raising_gains_errors():
        return _read(table, str(path))


def _read(table: dict[str, Any], where: str) -> Gains:
    """Returns the gains of a file's tables. Raises RobotError; `where` names the file."""
    parts = {
        name: read_record(kind, table.pop(name, None), f"{where}: [{name}]")
        for name, kind in SECTIONS.items()
    }
    return Gains(**require(Gains, read_given(Gains, table, where), where), **parts)
