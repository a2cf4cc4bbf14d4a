"""Writes modelDescription.xml of FMI 2.0 and the GUID that the binary's start values share."""

from __future__ import annotations

import hashlib
import re
import uuid
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from hexapod_cosim.cosim.common.components import Component
from hexapod_cosim.cosim.common.plant_files import DISTRIBUTION, FMI3_SOURCES, source_files
from hexapod_cosim.cosim.interface.records import Enumeration, Interface, Unit, Variable

# capabilities, each tested by tests/fmi/test_fmi.py or in tests/exchange
BOTH = {
    "canBeInstantiatedOnlyOncePerProcess": "false",
    "canNotUseMemoryManagementFunctions": "true",
    "canGetAndSetFMUstate": "true",
    "canSerializeFMUstate": "true",
}
MODEL_EXCHANGE = {"completedIntegratorStepNotNeeded": "false"} | BOTH
CO_SIMULATION = {
    "canHandleVariableCommunicationStepSize": "true",
    "canRunAsynchronuously": "false",
} | BOTH


@dataclass(frozen=True)
class ModelDescription:
    """modelDescription.xml and its GUID, which is a hash of the document."""

    guid: str
    xml: str


def render_fmi2(interface: Interface) -> ModelDescription:
    """Returns the model description of a component's FMU."""
    root = _document(interface)
    digest = hashlib.sha256(ElementTree.tostring(root)).digest()
    guid = "{" + str(uuid.UUID(bytes=digest[:16], version=4)) + "}"
    root.set("guid", guid)
    return ModelDescription(guid=guid, xml=document_text(root))


def document_text(root: Element) -> str:
    """Formats a document."""
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'


def _document(interface: Interface) -> Element:
    """Returns the document with an empty GUID."""
    own = {
        "fmiVersion": "2.0",
        "guid": "",
        "numberOfEventIndicators": str(interface.event_indicators),
    }
    root = Element("fmiModelDescription", own | general_facts(interface))
    _add_interfaces(root, interface)
    add_units(root, interface.units)
    _add_types(root, interface)
    add_log_categories(root, interface)
    add_experiment(root, interface)
    add_provenance(SubElement(root, "VendorAnnotations"), "Tool", {"name": DISTRIBUTION}, interface)
    variables = SubElement(root, "ModelVariables")
    for variable in interface.variables:
        _add_variable(variables, variable, interface)
    _add_structure(root, interface)
    return root


def _add_interfaces(root: Element, interface: Interface) -> None:
    """Adds CoSimulation and, for components with continuous states, ModelExchange."""
    differentiable = bool(interface.states) and interface.directional_derivatives
    derivatives = {"providesDirectionalDerivative": _flag(differentiable)}
    order = {
        "maxOutputDerivativeOrder": str(int(bool(interface.states))),
        "canInterpolateInputs": _flag(bool(interface.states)),
    }
    identifier = {"modelIdentifier": interface.component.identifier}
    if interface.states:
        _add_sources(
            SubElement(root, "ModelExchange", identifier | MODEL_EXCHANGE | derivatives),
            interface.component,
        )
    _add_sources(
        SubElement(root, "CoSimulation", identifier | CO_SIMULATION | order | derivatives),
        interface.component,
    )


def _flag(value: bool) -> str:
    """Formats a Boolean."""
    return "true" if value else "false"


def _add_sources(element: Element, component: Component) -> None:
    """Adds the list of the component's C files."""
    files = SubElement(element, "SourceFiles")
    for name in source_files(component):
        if name.endswith(".c") and not name.startswith(FMI3_SOURCES):
            SubElement(files, "File", name=name)


def general_facts(interface: Interface) -> dict[str, str]:
    """Returns the attributes of the root that both versions of the standard share."""
    robot = interface.robot
    joints = sum(len(leg.links) for leg in robot.legs)
    return {
        "modelName": robot.name + interface.component.suffix,
        "version": interface.version,
        "author": f"{DISTRIBUTION} developers",
        "copyright": f"Copyright (c) the {DISTRIBUTION} developers",
        "license": "MIT",
        "description": interface.component.description.format(bodies=1 + joints, joints=joints),
        "generationTool": f"{DISTRIBUTION} {interface.version}",
        "variableNamingConvention": "structured",
    }


def add_log_categories(root: Element, interface: Interface) -> None:
    """Adds the log categories."""
    categories = SubElement(root, "LogCategories")
    for name, text in interface.log_categories.items():
        SubElement(categories, "Category", name=name, description=text)


def add_units(root: Element, units: Iterable[Unit]) -> None:
    """Adds the units with their display units."""
    parent = SubElement(root, "UnitDefinitions")
    for unit in units:
        element = SubElement(parent, "Unit", name=unit.name)
        if unit.exponents is not None:
            SubElement(
                element,
                "BaseUnit",
                {base: str(exponent) for base, exponent in unit.exponents.items()},
            )
        if unit.display is not None:
            SubElement(element, "DisplayUnit", name=unit.display[0], factor=repr(unit.display[1]))


def _add_types(root: Element, interface: Interface) -> None:
    """Adds the types of units and enumerations, if there are any: the list must not be empty."""
    parent = Element("TypeDefinitions")
    for unit in interface.units:
        _add_real_type(parent, unit)
    for enumeration in interface.enumerations.values():
        facts = {"name": enumeration.name, "description": about_type(enumeration, interface)}
        element = SubElement(SubElement(parent, "SimpleType", facts), "Enumeration")
        for number, (name, text) in enumerate(enumeration.items, start=1):
            SubElement(element, "Item", name=name, value=str(number), description=text)
    root.extend([parent] if len(parent) else [])


def about_unit(unit: Unit) -> str:
    """Returns the description of a unit's type."""
    words = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", unit.type or "")
    return f"{words.capitalize()} in {unit.name}"


def about_type(enumeration: Enumeration, interface: Interface) -> str:
    """Returns the description of an enumeration: that of its first variable."""
    own = (one for one in interface.variables if one.enumeration == enumeration.name)
    return next((one.description for one in own), enumeration.name)


def _add_real_type(parent: Element, unit: Unit) -> None:
    """Adds the type of a unit."""
    if unit.type is not None:
        display = {"displayUnit": unit.display[0]} if unit.display else {}
        SubElement(
            SubElement(parent, "SimpleType", name=unit.type, description=about_unit(unit)),
            "Real",
            {"quantity": unit.type, "unit": unit.name} | display,
        )


def add_experiment(root: Element, interface: Interface) -> None:
    """Adds the default experiment."""
    stop, step = repr(interface.stop_time), repr(interface.step)
    SubElement(root, "DefaultExperiment", startTime="0", stopTime=stop, stepSize=step)


def add_provenance(
    parent: Element, tag: str, attributes: dict[str, str], interface: Interface
) -> None:
    """Adds the robot's name and hash as an annotation of this tool."""
    tool = SubElement(parent, tag, attributes)
    SubElement(tool, "Robot", name=interface.robot.name, hash=interface.robot.hash)


def typed_attributes(variable: Variable, interface: Interface) -> dict[str, Any]:
    """Returns the attributes of a variable's type, None for those that it does not have."""
    units = {unit.name: unit for unit in interface.units}
    unit = units.get(variable.unit or "")
    return {
        "declaredType": variable.enumeration or (unit.type if unit else None),
        "unit": variable.unit,
        "displayUnit": unit.display[0] if unit and unit.display else None,
        "min": variable.minimum,
        "max": variable.maximum,
        "nominal": variable.nominal,
    }


def stated(attributes: Mapping[str, Any]) -> dict[str, str]:
    """Returns the attributes that are not None, as texts."""
    return {name: _text(value) for name, value in attributes.items() if value is not None}


def _add_variable(parent: Element, variable: Variable, interface: Interface) -> None:
    """Adds a variable."""
    element = SubElement(
        parent,
        "ScalarVariable",
        {
            "name": variable.name,
            "valueReference": str(variable.reference),
            "causality": variable.causality,
            "variability": variable.variability,
            "initial": "exact" if variable.causality == "parameter" else "calculated",
            "description": variable.description,
        },
    )
    if variable.causality == "input":
        del element.attrib["initial"]  # the standard forbids it for inputs
    attributes = typed_attributes(variable, interface) | {
        "start": variable.start,
        "derivative": interface.derivative_of.get(variable.name),
        "reinit": "true" if variable.name in interface.reinitialised else None,
    }
    SubElement(element, variable.type, stated(attributes))


def _text(value: float | int | str) -> str:
    """Formats a number, Boolean or text for XML."""
    if isinstance(value, bool):
        return str(value).lower()
    return value if isinstance(value, str) else repr(value)


def _add_structure(root: Element, interface: Interface) -> None:
    """Adds outputs and derivatives with their dependencies, and these and the states with the
    dependencies of their initial values.
    """
    structure = SubElement(root, "ModelStructure")
    outputs = [variable.name for variable in interface.of_causality("output")]
    derivatives = [state.derivative for state in interface.states]
    initial = sorted(
        {*outputs, *derivatives, *(state.name for state in interface.states)},
        key=interface.index.__getitem__,
    )
    for title, names, depends in (
        ("Outputs", outputs, interface.depends),
        ("Derivatives", derivatives, interface.depends),
        ("InitialUnknowns", initial, interface.depends_initially),
    ):
        if names:
            parent = SubElement(structure, title)
            for name in names:
                _add_unknown(parent, interface, name, depends(name))


def _add_unknown(
    parent: Element, interface: Interface, name: str, depends: Iterable[str] | None
) -> None:
    """Adds an unknown. Without stated dependencies it depends on all knowns."""
    attributes = {"index": str(interface.index[name])}
    if depends is not None:
        attributes["dependencies"] = " ".join(
            map(str, sorted(interface.index[known] for known in depends))
        )
    SubElement(parent, "Unknown", attributes)
