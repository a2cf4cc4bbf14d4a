"""What extensions add to the command line, the build, releases and the site of the documentation.

Commands are declared by name and place, so that `hexapod --help` and the completion of names import
none of them. An extension is a folder of extensions/, or another package, with an entry point in
the group hexapod.commands that names an `Extension` in a module which imports nothing slow.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module, metadata
from pathlib import Path
from typing import Any

GROUP = "hexapod.commands"
Rows = list[dict[str, Any]]


@dataclass(frozen=True, kw_only=True)
class Command:
    """A command: a function with Typer's annotations, or a Typer application of sub-commands.

    The attribute EPILOG of its module, if there is one, ends its help.
    """

    name: str
    about: str  # in the list of commands
    place: str  # "module:function"


@dataclass(frozen=True, kw_only=True)
class Extension:
    """The parts that an extension adds; functions are named by "module:function"."""

    commands: Sequence[Command]
    # kind in run.json -> function of the folder that writes its report again and returns the files
    reports: Mapping[str, str] = field(default_factory=dict)
    lists: Mapping[str, str] = field(default_factory=dict)  # functions of `hexapod list` -> Rows
    # functions that return the Interface of an FMU for the default robot, for the build
    interfaces: Sequence[str] = ()
    # file in the wheel's hexapod_cosim/plant -> function that returns its bytes, for a release
    release: Mapping[str, str] = field(default_factory=dict)
    # file in the documentation's site -> function that writes it to a path
    site: Mapping[str, str] = field(default_factory=dict)


def loaded(place: str) -> Any:
    """Imports what a place "module:name" names."""
    module, _, name = place.partition(":")
    return getattr(import_module(module), name)


@cache
def installed_extensions() -> tuple[Extension, ...]:
    """Returns the installed extensions in the order of their names.

    An extension whose folder was deleted after the installation is left out.
    """
    entries = sorted(metadata.entry_points(group=GROUP), key=lambda entry: entry.name)
    found = (_extension(entry) for entry in entries)
    return tuple(extension for extension in found if extension is not None)


def _extension(entry: metadata.EntryPoint) -> Extension | None:
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


def extensions_in(tree: Path) -> list[Extension]:
    """Returns the extensions of a source tree, whether or not they are installed."""
    names = sorted(path.parent.name for path in tree.glob("extensions/*/extension.py"))
    return [loaded(f"hexapod_cosim.extensions.{name}.extension:EXTENSION") for name in names]


def report_functions() -> dict[str, str]:
    """Returns the functions of all extensions that write a report again, by the folder's kind."""
    return {k: place for one in installed_extensions() for k, place in one.reports.items()}


def list_functions() -> dict[str, str]:
    """Returns what the extensions add to `hexapod list`, by name."""
    return {k: place for one in installed_extensions() for k, place in one.lists.items()}
