"""Rules that every exported archive keeps, beyond those that fmpy's validation checks."""

from __future__ import annotations

import math
import posixpath
import re
import zipfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import fmpy
import pytest
from fmi_plant import ATHENA
from lxml import etree

from hexapod_cosim.cosim.export.plant import export_controller, export_fmu
from hexapod_cosim.cosim.interface.model_description import render_fmi2
from hexapod_cosim.cosim.interface.model_description3 import render_fmi3
from hexapod_cosim.cosim.run.plan import make_setup
from hexapod_cosim.cosim.scenario.records import CONTROLS
from hexapod_cosim.models import list_robots, load_robot

STANDARD_HEADER = re.compile(r"fmi[23](Functions|FunctionTypes|TypesPlatform|PlatformTypes)\.h")
TERMINALS = "terminalsAndIcons/terminalsAndIcons.xml"
PNG = b"\x89PNG\r\n\x1a\n"
PICTURE = {2: "model.png", 3: "documentation/diagram.png"}


@dataclass(frozen=True)
class Exported:
    """An exported FMU: its archive's entries, its files and fmpy's description."""

    fmi: int
    entries: list[zipfile.ZipInfo]
    files: dict[str, bytes]
    description: Any


CASES = [*((robot, 2) for robot in list_robots()), ("athena", 3), ("phantomx_mk4", 3)]
CASES += [(control, fmi) for control in CONTROLS for fmi in (2, 3)]


@pytest.fixture(scope="module", params=CASES, ids=[f"{name}-{fmi}" for name, fmi in CASES])
def exported(
    plant_build: Path, tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest
) -> Exported:
    name, fmi = request.param
    path = tmp_path_factory.mktemp("exported") / f"{name}.fmu"
    if name in CONTROLS:
        setup = make_setup(load_robot("athena"), control=name, period=0.005)
        export_controller(setup, path, fmi=fmi)
    else:
        export_fmu(load_robot(name), path, fmi=fmi)
    with zipfile.ZipFile(path) as archive:
        entries = archive.infolist()
        files = {entry.filename: archive.read(entry) for entry in entries if not entry.is_dir()}
    # raises ValidationError for what does not follow the standard's schema
    description = fmpy.read_model_description(
        str(path), validate=True, validate_variable_names=False, validate_model_structure=True
    )
    return Exported(fmi, entries, files, description)


def test_the_description_has_no_empty_list(exported: Exported) -> None:
    root = ElementTree.fromstring(exported.files["modelDescription.xml"])
    assert [child.tag for child in root if not len(child) and not child.attrib] == []


@pytest.mark.parametrize("render", [render_fmi2, render_fmi3])
def test_an_interface_without_types_has_no_list_of_them(render: Any) -> None:
    units = tuple(replace(unit, type=None) for unit in ATHENA.units)
    bare = replace(ATHENA, units=units, enumerations={})
    assert "TypeDefinitions" in render(ATHENA).xml
    assert "TypeDefinitions" not in render(bare).xml


def test_every_packed_source_is_listed_and_every_listed_one_is_packed(exported: Exported) -> None:
    packed = {
        name for name in exported.files if name.startswith("sources/") and name.endswith(".c")
    }
    for configuration in exported.description.buildConfigurations:
        listed = [name for files in configuration.sourceFileSets for name in files.sourceFiles]
        assert len(listed) == len(set(listed))
        assert {f"sources/{name}" for name in listed} == packed
    assert packed


def test_included_headers_are_packed_and_the_standard_s_are_not(exported: Exported) -> None:
    missing = []
    for name, data in exported.files.items():
        if not name.startswith("sources/"):
            continue
        assert not STANDARD_HEADER.fullmatch(posixpath.basename(name)), name
        for include in re.findall(r'^\s*#\s*include\s+"([^"]+)"', data.decode(), re.MULTILINE):
            beside = posixpath.normpath(posixpath.join(posixpath.dirname(name), include))
            places = {beside, f"sources/{include}"}
            if not (STANDARD_HEADER.fullmatch(include) or places & set(exported.files)):
                missing.append((name, include))
    assert missing == []


def test_the_page_the_licence_and_pictures_are_packed(exported: Exported) -> None:
    assert exported.files["documentation/index.html"].strip()
    assert exported.files["documentation/licenses/license.txt"].strip()
    assert exported.files[PICTURE[exported.fmi]].startswith(PNG)


def test_terminals_follow_the_schema_and_hold_known_variables(exported: Exported) -> None:
    if TERMINALS not in exported.files:
        return
    schema = Path(fmpy.__file__).parent / "schema" / "fmi3" / "fmi3TerminalsAndIcons.xsd"
    rules = etree.XMLSchema(etree.parse(str(schema)))
    assert rules.validate(etree.fromstring(exported.files[TERMINALS])), rules.error_log
    root = ElementTree.fromstring(exported.files[TERMINALS])
    if root.find("GraphicalRepresentation") is not None:
        assert exported.files["terminalsAndIcons/icon.png"].startswith(PNG)
    top = root.find("Terminals")
    known = {variable.name for variable in exported.description.modelVariables}
    assert top is not None
    assert member_names(top) <= known


def member_names(parent: Element) -> set[str]:
    """Returns the variables of all terminals below an element, whose names must differ."""
    found = set()
    names = [terminal.get("name") for terminal in parent.iterfind("Terminal")]
    assert len(names) == len(set(names)), names
    for terminal in parent.iterfind("Terminal"):
        members = list(terminal.iterfind("TerminalMemberVariable"))
        assert len({member.get("memberName") for member in members}) == len(members)
        found |= {str(member.get("variableName")) for member in members} | member_names(terminal)
    return found


def number(variable: Any, key: str) -> float | None:
    """Returns min, max or nominal of a variable or, without one, of its type."""
    text = getattr(variable, key)
    if text is None and variable.declaredType is not None:
        text = getattr(variable.declaredType, key)
    return None if text is None else float(text)


def test_numbers_of_variables_are_finite_and_starts_are_in_their_ranges(exported: Exported) -> None:
    for variable in exported.description.modelVariables:
        assert variable.description, variable.name
        if variable.type in ("String", "Boolean", "Binary"):
            continue
        least, most, nominal = (number(variable, key) for key in ("min", "max", "nominal"))
        starts = [float(word) for word in str(variable.start or "").split()]
        for value in (least, most, nominal, *starts):
            assert value is None or math.isfinite(value), variable.name
        least = -math.inf if least is None else least
        most = math.inf if most is None else most
        assert least <= most, variable.name
        assert all(least <= start <= most for start in starts), variable.name
        assert nominal != 0.0, variable.name
        if variable.type == "Enumeration":
            items = {float(item.value) for item in variable.declaredType.items}
            assert set(starts) <= items, variable.name


def test_the_model_structure_is_in_order(exported: Exported) -> None:
    description = exported.description
    place = {id(one): at for at, one in enumerate(description.modelVariables)}
    for unknowns in (description.outputs, description.initialUnknowns):
        places = [place[id(unknown.variable)] for unknown in unknowns]
        assert places == sorted(set(places))
    for unknown in (*description.outputs, *description.derivatives, *description.initialUnknowns):
        references = [int(one.valueReference) for one in unknown.dependencies or []]
        places = [place[id(one)] for one in unknown.dependencies or []]
        ordered = references if exported.fmi == 3 else places
        assert ordered == sorted(set(ordered)), unknown.variable.name


def parsed(word: str) -> float:
    """Returns a number, also one in hexadecimal digits, or 1 and 0 for true and false."""
    if word in ("true", "false"):
        return float(word == "true")
    return float.fromhex(word) if "x" in word else float(word)


def test_the_binary_s_start_values_are_those_of_the_description(exported: Exported) -> None:
    first, *lines = exported.files["resources/start_values.txt"].decode().splitlines()
    assert first == exported.description.guid
    packed = {
        int(words[0]): parsed(words[1])
        for line in lines
        if (words := line.split()) and words[0] != "checksum"
    }
    # the elements of an array have its reference and those that follow
    assert packed == {
        int(variable.valueReference) + place: parsed(word)
        for variable in exported.description.modelVariables
        if variable.start is not None
        for place, word in enumerate(str(variable.start).split())
    }
