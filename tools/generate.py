"""Writes generated/ of each FMU from its interface.toml, the robot athena and the version in
pyproject.toml.

usage: python tools/generate.py [--check]

The repository has only defaults.c and include/hexapod/generated of plant and controller, which the
C libraries need; a build of the FMUs writes the other files (tools/generate_sources.py).

--check writes nothing, lists the files that are not up to date and exits with 1 if there are any.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path

from generate_c import render_defaults, render_settings, render_structure, render_variables

from hexapod_cosim.controller import DEFAULT_PERIOD, make_gait
from hexapod_cosim.cosim.cli.extension import extensions_in, loaded
from hexapod_cosim.cosim.export.start_values import start_values
from hexapod_cosim.cosim.interface.controller import ControllerSetup, load_controller_interface
from hexapod_cosim.cosim.interface.model_description import render_fmi2
from hexapod_cosim.cosim.interface.plant import load_interface
from hexapod_cosim.cosim.interface.records import Interface
from hexapod_cosim.models.robot import load_robot

ROOT = Path(__file__).resolve().parents[1]
DEFAULT_ROBOT = "athena"


def main() -> int:
    """Writes or checks the files; returns the exit code."""
    parser = argparse.ArgumentParser(description="Generates generated/ of each FMU.")
    parser.add_argument(
        "--check", action="store_true", help="write nothing; exit with 1 if a file is stale"
    )
    check = parser.parse_args().check
    stale = stale_files(render_all())
    for path, text in stale.items():
        print(f"{path}: {'stale; run tools/generate.py' if check else 'written'}")
        if not check:
            write(path, text)
    return 1 if check and stale else 0


def stale_files(files: Mapping[Path, str]) -> dict[Path, str]:
    """Returns path and new text of the files that are missing or not up to date."""
    return {
        path: text
        for path, text in files.items()
        if not path.is_file() or path.read_text(encoding="utf-8") != text
    }


def write(path: Path, text: str) -> None:
    """Writes a file and creates its folder if need be."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8", newline="\n")


def render_all() -> dict[Path, str]:
    """Returns path and text of every generated file."""
    return {
        path: text
        for interface in interfaces()
        for path, text in render_component(interface).items()
    }


def interfaces() -> tuple[Interface, ...]:
    """Returns the interfaces of plant and controller of the default robot, and those of the
    extensions.
    """
    robot = load_robot(DEFAULT_ROBOT)
    setup = ControllerSetup(robot=robot, gait=make_gait(robot), period=DEFAULT_PERIOD)
    added = [place for extension in extensions_in(ROOT) for place in extension.interfaces]
    core = load_interface(robot), load_controller_interface(setup)
    return (*core, *(loaded(place)() for place in added))


def descriptions(folder: Path) -> dict[Path, str]:
    """Returns path and text of modelDescription.xml and start_values.txt of plant and controller,
    in a folder each.
    """
    found = {}
    for interface in interfaces()[:2]:
        description, place = render_fmi2(interface), folder / interface.component.name
        found[place / "modelDescription.xml"] = description.xml
        found[place / "start_values.txt"] = start_values(interface, description.guid)
    return found


def render_component(interface: Interface) -> dict[Path, str]:
    """Returns path and text of the generated files of one component."""
    folder = ROOT / interface.component.tree / "generated"
    header = ROOT / interface.component.tree / "include" / "hexapod" / "generated"
    settings = {}
    if interface.enumerations:
        settings[header / f"{interface.component.name}_settings.h"] = render_settings(interface)
    return settings | {
        folder / "variables.h": render_structure(interface.component),
        folder / "variables.c": render_variables(interface, render_fmi2(interface).guid),
        folder / "defaults.c": render_defaults(interface),
    }


if __name__ == "__main__":
    sys.exit(main())
