"""Reads a System Structure package for `hexapod simulate`: its plant, controller and values."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from hexapod_cosim.cosim.common.archives import unpack
from hexapod_cosim.cosim.export.ssp import SSD
from hexapod_cosim.cosim.interface.descriptions import read_description
from hexapod_cosim.cosim.interface.plant import load_interface
from hexapod_cosim.models import HexapodError, load_robot

COMPONENTS = ("plant", "controller")
COMMAND = "command."  # prefix of the controller's body command
MOST_CHANGES = 60  # parameters: more are those of another robot


@dataclass(frozen=True)
class Package:
    """The FMUs of a package, and the settings of a scenario that repeat its start values."""

    plant: Path
    controller: Path
    settings: list[str]


def read_package(path: Path, folder: Path) -> Package:
    """Unpacks a package into a folder. Raises HexapodError for one of other components or of
    another robot, which the loop cannot connect.
    """
    unpack(path, folder)
    structure = ElementTree.parse(folder / "SystemStructure.ssd")
    names = [one.get("name", "") for one in structure.iter(f"{{{SSD}}}Component")]
    if sorted(names) != sorted(COMPONENTS):
        raise HexapodError(
            "a package that the loop cannot connect",
            got=f"the components {', '.join(names)}",
            expected="a plant and a controller, as of `hexapod export --ssp`",
            fix="name them plant and controller, or run it in fmpy's simulate_ssp",
            where=str(path),
        )
    plant, controller = (folder / "resources" / f"{name}.fmu" for name in COMPONENTS)
    stops = [one.get("stopTime") for one in structure.iter(f"{{{SSD}}}DefaultExperiment")]
    lasts = [f"duration={float(stop)!r}" for stop in stops if stop]
    return Package(plant, controller, [*lasts, *_commands(controller), *_parameters(plant, path)])


def _commands(controller: Path) -> list[str]:
    """Returns the controller's body command as settings of a scenario."""
    variables = read_description(controller).modelVariables
    return [f"{one.name}={one.start}" for one in variables if one.name.startswith(COMMAND)]


def _parameters(plant: Path, path: Path) -> list[str]:
    """Returns the plant's parameters that differ from the default robot's. Raises HexapodError."""
    own = load_interface(load_robot("athena")).by_name
    given = {
        one.name: float(one.start)
        for one in read_description(plant).modelVariables
        if one.causality == "parameter" and one.type == "Real" and one.name in own
    }
    changed = {name: value for name, value in given.items() if value != own[name].start}
    if len(changed) > MOST_CHANGES:
        raise HexapodError(
            "a package of another robot",
            got=f"{len(changed)} parameters that differ from those of athena",
            fix="write a scenario with its robot; give it the FMUs by --fmu and --control",
            where=str(path),
        )
    return [f"{name}={value!r}" for name, value in changed.items()]
