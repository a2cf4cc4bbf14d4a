"""What an extension adds to the command line, and the extensions that are installed.

An extension is a folder of extensions/, or another package, with an entry point in the group
hexapod.commands that names an `Extension`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

GROUP = "hexapod.commands"
Rows = list[dict[str, Any]]


@dataclass(frozen=True, kw_only=True)
class Command:
    """A command: a function with Typer's annotations, or a Typer application of sub-commands."""

    name: str
    run: Callable[..., Any]
    epilog: str | None = None


@dataclass(frozen=True, kw_only=True)
class Extension:
    """The parts of the command line that an extension defines."""

    commands: Sequence[Command]
    # kind in run.json -> function that writes the report of such a folder again and returns the
    # files it wrote
    reports: Mapping[str, Callable[[Path], Sequence[Path]]] = field(default_factory=dict)
    lists: Mapping[str, Callable[[], Rows]] = field(default_factory=dict)  # of `hexapod list`


@cache
def installed_extensions() -> tuple[Extension, ...]:
    """Returns the installed extensions in the order of their names.

    An extension whose folder was deleted after the installation is left out.
    """
    entries = sorted(metadata.entry_points(group=GROUP), key=lambda entry: entry.name)
    found = (_loaded(entry) for entry in entries)
    return tuple(extension for extension in found if extension is not None)


def _loaded(entry: metadata.EntryPoint) -> Extension | None:
    """Returns the extension that an entry point names, or None if its package does not exist."""
    try:
        extension = entry.load()
    except ModuleNotFoundError as error:
        if error.name is not None and f"{entry.module}.".startswith(f"{error.name}."):
            return None
        raise
    if not isinstance(extension, Extension):
        raise TypeError(f"entry point {entry.name} of {GROUP}: got {extension!r}, not an Extension")
    return extension


def report_functions() -> dict[str, Callable[[Path], Sequence[Path]]]:
    """Returns the functions of all extensions that write a report again, by the folder's kind."""
    return {
        kind: function
        for extension in installed_extensions()
        for kind, function in extension.reports.items()
    }


def list_functions() -> dict[str, Callable[[], Rows]]:
    """Returns what the extensions add to `hexapod list`, by name."""
    return {
        name: function
        for extension in installed_extensions()
        for name, function in extension.lists.items()
    }
