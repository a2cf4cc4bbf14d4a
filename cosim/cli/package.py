"""Reads System Structure packages (SSP) as the FMUs and settings of a run, for `hexapod simulate`.

The loop runs a plant and a controller. What else a package may hold is refused with the reason.
"""

from __future__ import annotations

import json
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote
from xml.etree import ElementTree

from hexapod_cosim.cosim.common.archives import open_archive, read_member, unpack
from hexapod_cosim.cosim.common.files import write_text
from hexapod_cosim.cosim.common.plant_files import fmi2_platform, fmi3_platform
from hexapod_cosim.cosim.export.plant import export_interface
from hexapod_cosim.cosim.export.ssp import OSP, SSD
from hexapod_cosim.cosim.export.start_values import with_starts
from hexapod_cosim.cosim.interface.arrays import arrays
from hexapod_cosim.cosim.interface.descriptions import forbidden_markup, open_description
from hexapod_cosim.cosim.interface.plant import load_interface
from hexapod_cosim.cosim.interface.records import Interface, Variable
from hexapod_cosim.cosim.master.connection import names_of_map
from hexapod_cosim.cosim.run.plant import BODY_PARAMETERS
from hexapod_cosim.models import HexapodError, list_robots, load_robot

STRUCTURE = "SystemStructure.ssd"
COMMAND = "command."  # prefix of the controller's body command, which the scenario gives
# an input that every plant has, of FMI 2.0 and 3.0
DRIVEN = {"LF.coxa.angle_ref", "angle_ref"}
NUMBERS = ("Real", "Float64", "Enumeration")
ENDS = ("startElement", "startConnector", "endElement", "endConnector")
ELSEWHERE = "run it in another tool for packages, such as OMSimulator"


@dataclass(frozen=True)
class Package:
    """The plant FMU of a package, and the settings of a scenario that repeat the package."""

    plant: Path
    settings: list[str]


@dataclass(frozen=True)
class Part:
    """A component of a package: its name, FMU and model description."""

    name: str
    fmu: Path
    description: Any

    def names(self, causality: str) -> set[str]:
        """Returns the names of its variables of one causality."""
        variables = self.description.modelVariables
        return {one.name for one in variables if one.causality == causality}


def read_package(path: Path, folder: Path, given: Sequence[str] = ()) -> Package:
    """Unpacks a package into a folder.

    given: settings that the user adds, of which robot=FILE names the plant's robot.
    Raises HexapodError for a package that the loop does not connect as the package says.
    """
    if not zipfile.is_zipfile(path):
        raise HexapodError(
            "no such package",
            got=str(path),
            expected=f"a ZIP file with a {STRUCTURE}",
            fix="make one with `hexapod export --ssp -o FILE.ssp`",
        )
    unpack(path, folder)
    root = _structure(path, folder / STRUCTURE)
    plant, controller = _parts(root, folder, str(path))
    table = _connected(root, plant, controller, str(path))
    names = (f"{json.dumps(ours)} = {json.dumps(own)}" for ours, own in table.items())
    write_text(controller.fmu.with_suffix(".toml"), "\n".join(["[map]", *names, ""]))
    robots = [text.partition("=")[2].strip() for text in given if text.startswith("robot=")]
    starts = _starts(plant, str(path))
    robot, changed = _robot_of(starts, robots or _candidates(root), str(path))
    fmu = plant.fmu if plant.description.fmiVersion == "2.0" else _as_fmi2(plant, robot, starts)
    settings = [f"robot={robot}", f"control={controller.fmu}", f"title={json.dumps(path.stem)}"]
    settings += [*_experiment(root, str(path)), *_commands(controller)]
    return Package(fmu, [*settings, *changed])


def _refusal(got: object, expected: str, where: str, fix: str = ELSEWHERE) -> HexapodError:
    what = "a package that the loop cannot connect"
    return HexapodError(what, got=got, expected=expected, fix=fix, where=where)


def _structure(path: Path, file: Path) -> ElementTree.Element:
    """Returns the root of a package's structure. Raises HexapodError."""
    try:
        data = file.read_bytes()
        found = forbidden_markup(data)
        if found is None:
            return ElementTree.fromstring(data)
    except (OSError, ElementTree.ParseError) as error:
        found = str(error)
    raise HexapodError(
        f"the package's {STRUCTURE} cannot be read",
        got=found,
        expected="XML in UTF-8 without a document type",
        where=str(path),
    )


def _parts(root: ElementTree.Element, folder: Path, where: str) -> tuple[Part, Part]:
    """Returns plant and controller. Raises HexapodError for a package of others."""
    found = list(root.iter(f"{{{SSD}}}Component"))
    parts = [
        Part(one.get("name", ""), file, open_description(file))
        for one in found
        for file in [_file(folder, one.get("source", ""), where)]
    ]
    parts.sort(key=lambda part: part.names("input").isdisjoint(DRIVEN))
    plants = [part.name for part in parts if not part.names("input").isdisjoint(DRIVEN)]
    systems = list(root.iter(f"{{{SSD}}}System"))
    if len(parts) != 2 or len(plants) != 1 or len(systems) != 1:
        names = ", ".join(one.get("name", "") for one in found)
        raise _refusal(
            f"{len(systems)} systems of the components {names}, of which {len(plants)} take joint "
            "commands under our names",
            "one system of a plant, which takes them, and a controller",
            where,
        )
    if next(root.iter(f"{{{SSD}}}ParameterBinding"), None) is not None:
        raise _refusal("parameter sets", "values that are start values of the FMUs", where)
    return parts[0], parts[1]


def _file(folder: Path, source: str, where: str) -> Path:
    """Returns the file of a component's source. Raises HexapodError for none in the package."""
    file = (folder / unquote(source)).resolve()
    if not file.is_relative_to(folder.resolve()) or not file.is_file():
        raise _refusal(source, "the path of an FMU in the package", where)
    return file


def _connected(
    root: ElementTree.Element, plant: Part, controller: Part, where: str
) -> dict[str, str]:
    """Returns the controller's names by the plant's. Raises HexapodError for other connections
    than the loop makes, which connects equal names.
    """
    table: dict[str, str] = {}
    for one in root.iter(f"{{{SSD}}}Connection"):
        start, output, end, entry = (one.get(key, "") for key in ENDS)
        text = f"{start}.{output} to {end}.{entry}"
        ours, own = (output, entry) if start == plant.name else (entry, output)
        if {start, end} != {plant.name, controller.name} or ours in table:
            raise _refusal(text, "each output of one FMU at one input of the other", where)
        if any(child.tag.endswith("Transformation") for child in one):
            raise _refusal(f"{text} with a transformation", "the same unit at both ends", where)
        table[ours] = own
    names_of_map(table, where=where)
    for mine, theirs in (("output", "input"), ("input", "output")):
        loose = plant.names(mine) & controller.names(theirs) - set(table.values())
        if loose:
            expected = "a connection of all equal names, which the loop connects"
            raise _refusal(f"none of {min(loose)}", expected, where)
    return table


def _experiment(root: ElementTree.Element, where: str) -> Iterator[str]:
    """Yields times and step of a package's experiment as settings. Raises HexapodError."""
    try:
        for one in root.iter(f"{{{SSD}}}DefaultExperiment"):
            start, stop = float(one.get("startTime", 0.0)), one.get("stopTime")
            yield from [f"start={start!r}"] if start else []
            yield from [f"duration={float(stop) - start!r}"] if stop else []
        for step in root.iter(f"{{{OSP}}}FixedStepAlgorithm"):
            yield f"macro_step={float(step.get('baseStepSize', 'no step'))!r}"
    except ValueError as error:
        raise _refusal(str(error), "times and a step in s", where) from error


def _commands(controller: Part) -> list[str]:
    """Returns the controller's body command as settings of a scenario."""
    variables = controller.description.modelVariables
    return [f"{one.name}={one.start}" for one in variables if one.name.startswith(COMMAND)]


def _starts(plant: Part, where: str) -> dict[str, float]:
    """Returns the numbers of a plant's start values by the names of FMI 2.0."""
    kinds = ("input", "parameter")
    texts = {
        one.name: str(one.start).split()
        for one in plant.description.modelVariables
        if one.causality in kinds and one.type in NUMBERS and one.start is not None
    }
    if plant.description.fmiVersion == "2.0":
        return {name: float(text) for name, (text,) in texts.items()}
    own = arrays(load_interface(load_robot("athena")))
    groups = [one for one in own if one.first.causality in kinds]
    if any(len(texts.get(one.name, ())) != len(one.elements) for one in groups):
        raise _refusal("a plant of FMI 3.0 that is not ours", "one of FMI 2.0, or ours", where)
    return {
        element.name: float(text)
        for one in groups
        for element, text in zip(one.elements, texts[one.name], strict=True)
    }


def _candidates(root: ElementTree.Element) -> list[str]:
    """Returns the robots that the plant may hold, first the one that the package names."""
    return sorted(list_robots(), key=lambda name: name != root.get("name"))


def _robot_of(
    starts: Mapping[str, float], robots: Sequence[str], where: str
) -> tuple[str, list[str]]:
    """Returns the robot with the same body as a plant, and the settings of the plant that differ
    from the robot's. Raises HexapodError if none of the robots has it.
    """
    least: tuple[str, list[str]] | None = None
    for robot in robots:
        interface = load_interface(load_robot(robot))
        changed = [
            one
            for one in interface.of_causality("parameter")
            if starts.get(one.name, one.start) != one.start
        ]
        body = [one.name for one in changed if one.name.startswith(BODY_PARAMETERS)]
        if not body:
            return robot, [_setting(one, starts[one.name], interface) for one in changed]
        if least is None or len(body) < len(least[1]):
            least = robot, body
    name, body = least or ("", [])
    raise HexapodError(
        "a package of another robot",
        got=f"{len(body)} numbers of its body that differ from those of {name}, as {body[0]}",
        expected=f"one of {', '.join(robots)}",
        fix="name the file of its robot: --set robot=FILE",
        where=where,
    )


def _setting(variable: Variable, value: float, interface: Interface) -> str:
    """Returns the setting of a scenario that gives a parameter a value."""
    if variable.enumeration is None:
        return f"{variable.name}={value!r}"
    items = interface.enumerations[variable.enumeration].items
    return f"{variable.name}={items[int(value) - 1][0]}"


def _as_fmi2(plant: Part, robot: str, starts: Mapping[str, float]) -> Path:
    """Returns the FMU of FMI 2.0 with the binary, grids and start values of ours of FMI 3.0, whose
    binary has the functions of both. Raises FmuError.
    """
    with open_archive(plant.fmu) as archive:
        names = archive.namelist()
        own, grids = f"binaries/{fmi3_platform()}/", "resources/terrain/"
        members = {
            name.replace(own, f"binaries/{fmi2_platform()}/"): read_member(archive, name)
            for name in names
            if name.startswith((own, grids))
        }
    file = plant.fmu.with_name("plant_of_fmi2.fmu")
    interface = with_starts(load_interface(load_robot(robot)), starts)
    return export_interface(interface, file, packed=members, bare=True)
