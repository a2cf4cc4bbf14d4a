"""Packs plant and controller FMUs, what connects them and their parameters as a System Structure
package (SSP 1.0).

Variables connect by name: an output of one component drives the other's input of the same name and
type. What is left unconnected, such as the walking command, stays an input and is in the parameter
set. Enumerations keep the FMU's own start values: SSP readers refuse them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from hexapod_cosim.cosim.common.plant_files import DISTRIBUTION, package_version
from hexapod_cosim.cosim.export.export import write_archive
from hexapod_cosim.cosim.interface.descriptions import read_description
from hexapod_cosim.models.errors import FmuError, nearest_name

VERSION = "1.0"
STANDARD = "http://ssp-standard.org/SSP1/SystemStructure"
SSD, SSC, SSV = f"{STANDARD}Description", f"{STANDARD}Common", f"{STANDARD}ParameterValues"
OSP = "http://opensimulationplatform.com/SSP/OSPAnnotations"
PREFIXES = {
    "ssd": SSD,
    "ssc": SSC,
    "ssv": SSV,
    "osp": OSP,
}  # readers look for these prefixes, not for the namespaces
PARAMETER_SET = (
    "start"  # one name for all components' sets: a tool that is told to apply it applies all
)
TYPES = ("Real", "Boolean")
OPTIONS = {
    "control": "choose it with --controller",
    "gait.pattern": "choose it with --gait",
}  # enumerations of no robot file
KINDS = ("input", "output", "parameter")
NOTHING: Mapping[str, Any] = MappingProxyType({})
BASE_UNITS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad", "factor", "offset")


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """How the package is meant to run [s]."""

    step: float
    stop: float


@dataclass(frozen=True)
class Component:
    """An FMU in the package."""

    name: str
    fmu: Path
    description: Any  # model description, as fmpy reads it

    @property
    def variables(self) -> dict[str, Any]:
        """Its inputs, outputs and parameters that a package can name, in the FMU's order."""
        return {
            one.name: one
            for one in self.description.modelVariables
            if one.causality in KINDS and one.type in TYPES
        }

    def of(self, causality: str) -> dict[str, Any]:
        """Those of one causality."""
        return {
            name: variable
            for name, variable in self.variables.items()
            if variable.causality == causality
        }


@dataclass(frozen=True)
class Connection:
    """An output of one component and the input that it drives; both have this name."""

    start: str
    end: str
    name: str


def export_ssp(
    path: str | Path,
    fmus: Mapping[str, Path],
    *,
    title: str,
    experiment: Experiment,
    values: Mapping[str, Mapping[str, float]] = NOTHING,
) -> Path:
    """Writes a package of FMUs, which connect by the names of their variables, and returns its
    path.

    Args:
        path: the file to write; it appears complete or not at all.
        fmus: files by the names of their components.
        title: of the system.
        experiment: step and stop time that tools take if they are told nothing else.
        values: of parameters and unconnected inputs, by component and name, in place of the FMU's
            start values.

    Raises FmuError: not co-simulation FMUs, nothing to connect, a value for something that is not
    there or out of its range; HexapodError: a path that cannot be written.
    """
    components = [Component(name, fmu, read_description(fmu)) for name, fmu in fmus.items()]
    connections = connect(components)
    members = {
        "SystemStructure.ssd": _text(
            structure(components, connections, title=title, experiment=experiment)
        )
    }
    for component in components:
        members[f"resources/{component.name}.fmu"] = component.fmu.read_bytes()
        members[_values_file(component)] = _text(
            parameter_set(component, connections, values.get(component.name, NOTHING))
        )
    return write_archive(Path(path), members)


def connect(components: Sequence[Component]) -> list[Connection]:
    """Every output that drives another component's input. Raises FmuError when a component is
    left alone, or an input has two drivers.
    """
    found = [
        Connection(source.name, target.name, name)
        for source in components
        for target in components
        if source is not target
        for name, output in source.of("output").items()
        if name in target.of("input") and target.variables[name].type == output.type
    ]
    for component in components:
        if not any(component.name in (one.start, one.end) for one in found):
            expected = "an output of one named as an input of the other, of the same type"
            raise FmuError(
                "nothing to connect",
                got=f"{component.name}: {component.fmu.name}",
                expected=expected,
            )
    driven = [(one.end, one.name) for one in found]
    twice = next((one for one in driven if driven.count(one) > 1), None)
    if twice is not None:
        raise FmuError(
            "an input with two drivers",
            got=f"{twice[0]}: {twice[1]}",
            expected="outputs of different names",
        )
    return found


def structure(
    components: Sequence[Component],
    connections: Iterable[Connection],
    *,
    title: str,
    experiment: Experiment,
) -> Element:
    """SystemStructure.ssd."""
    root = Element("ssd:SystemStructureDescription", _heading(title, "ssd", "ssc", "osp"))
    system = SubElement(
        root,
        "ssd:System",
        name="root",
        description=f"{title}: " + ", ".join(one.name for one in components),
    )
    elements = SubElement(system, "ssd:Elements")
    for component in components:
        _add_component(elements, component)
    parent = SubElement(system, "ssd:Connections")
    for one in connections:
        ends = {
            "startElement": one.start,
            "startConnector": one.name,
            "endElement": one.end,
            "endConnector": one.name,
        }
        SubElement(parent, "ssd:Connection", ends)
    _add_units(root, "ssd:Units", components)
    _add_experiment(root, experiment)
    return root


def parameter_set(
    component: Component, connections: Iterable[Connection], values: Mapping[str, float]
) -> Element:
    """The component's parameters and unconnected inputs as an .ssv file's root. Raises FmuError
    for other values.
    """
    driven = {one.name for one in connections if one.end == component.name}
    settable = component.of("parameter") | {
        name: one for name, one in component.of("input").items() if name not in driven
    }
    for name, value in values.items():
        _check_value(component, settable, name, value)
    root = Element("ssv:ParameterSet", _heading(PARAMETER_SET, "ssv", "ssc"))
    parameters = SubElement(root, "ssv:Parameters")
    for name, variable in settable.items():
        parameter = SubElement(parameters, "ssv:Parameter", _described(variable))
        SubElement(
            parameter,
            f"ssv:{variable.type}",
            {"value": _start(variable, values.get(name))} | _unit(variable, component),
        )
    _add_units(root, "ssv:Units", [component])
    return root


def _check_value(
    component: Component, settable: Mapping[str, Any], name: str, value: float
) -> None:
    """Raises FmuError for a value of something that no package can set, or one that the FMU
    would refuse.
    """
    if name in {
        one.name for one in component.description.modelVariables if one.type == "Enumeration"
    }:
        table, _, key = name.rpartition(".")
        fix = (
            OPTIONS.get(name)
            or f"write {key} under [{table}] of a robot file, and give that with --robot FILE"
        )
        expected = "a real or Boolean variable: readers of packages refuse enumerations"
        raise FmuError(
            f"{component.name}: an enumeration cannot be set in a package",
            got=name,
            expected=expected,
            fix=fix,
        )
    if name not in settable:
        near = nearest_name(name, settable)
        fix = (
            f"did you mean {near!r}?"
            if near
            else "name a parameter or an input that nothing drives"
        )
        raise FmuError(f"{component.name} has no such value to set", got=name, fix=fix)
    low, high = _range(settable[name])
    whole = settable[name].type != "Boolean" or value in (0.0, 1.0)
    if not (whole and math.isfinite(value) and low <= value <= high):
        expected = f"{low:g} to {high:g} {settable[name].unit or ''}".rstrip()
        raise FmuError(
            f"{component.name}.{name} is out of range",
            got=value,
            expected=expected,
            fix="give a value within",
        )


def _range(variable: Any) -> tuple[float, float]:
    """Its least and largest value, of its own or of its type."""
    if variable.type == "Boolean":
        return 0.0, 1.0
    sources = [one for one in (variable, variable.declaredType) if one is not None]
    low, high = (
        next((float(getattr(one, key)) for one in sources if getattr(one, key) is not None), None)
        for key in ("min", "max")
    )
    return -math.inf if low is None else low, math.inf if high is None else high


def _heading(name: str, *prefixes: str) -> dict[str, str]:
    facts = {
        "version": VERSION,
        "name": name,
        "generationTool": f"{DISTRIBUTION} {package_version()}",
    }
    return facts | {f"xmlns:{prefix}": PREFIXES[prefix] for prefix in prefixes}


def _values_file(component: Component) -> str:
    return f"resources/{component.name}.ssv"


def _add_component(parent: Element, component: Component) -> None:
    facts = {
        "name": component.name,
        "type": "application/x-fmu-sharedlibrary",
        "source": f"resources/{component.name}.fmu",
    }
    element = SubElement(parent, "ssd:Component", facts | {"implementation": "CoSimulation"})
    connectors = SubElement(element, "ssd:Connectors")
    for variable in component.variables.values():
        connector = SubElement(
            connectors, "ssd:Connector", _described(variable) | {"kind": variable.causality}
        )
        SubElement(connector, f"ssc:{variable.type}", _unit(variable, component))
    bindings = SubElement(element, "ssd:ParameterBindings")
    SubElement(
        bindings,
        "ssd:ParameterBinding",
        type="application/x-ssp-parameter-set",
        source=_values_file(component),
    )


def _described(variable: Any) -> dict[str, str]:
    text = {"description": variable.description} if variable.description else {}
    return {"name": variable.name} | text


def _start(variable: Any, value: float | None) -> str:
    """In place of the FMU's own start value if given, as text that reads back the same."""
    if variable.type == "Boolean":
        return str(variable.start == "true" if value is None else bool(value)).lower()
    return repr(float(variable.start) if value is None else float(value))


def _unit(variable: Any, component: Component) -> dict[str, str]:
    """The unit, where base units of whole exponents can say it: a package's units have no other
    form.
    """
    sayable = any(
        unit.name == variable.unit and unit.baseUnit is not None
        for unit in component.description.unitDefinitions
    )
    return {"unit": variable.unit} if variable.type == "Real" and sayable else {}


def _add_units(root: Element, tag: str, components: Iterable[Component]) -> None:
    """Every unit in use, once."""
    known = {
        unit.name: unit.baseUnit
        for one in components
        for unit in one.description.unitDefinitions
        if unit.baseUnit is not None
    }
    used = {
        variable.unit
        for one in components
        for variable in one.variables.values()
        if variable.unit in known
    }
    if not used:
        return
    parent = SubElement(root, tag)
    for name in sorted(used):
        exponents = {key: getattr(known[name], key) for key in BASE_UNITS}
        neutral = {"factor": 1.0, "offset": 0.0}
        stated = {
            key: str(value) for key, value in exponents.items() if value != neutral.get(key, 0)
        }
        SubElement(SubElement(parent, "ssc:Unit", name=name), "ssc:BaseUnit", stated)


def _add_experiment(root: Element, experiment: Experiment) -> None:
    """Start and stop; the step in the one annotation that a reader takes it from."""
    parent = SubElement(
        root, "ssd:DefaultExperiment", startTime="0.0", stopTime=repr(experiment.stop)
    )
    annotation = SubElement(
        SubElement(parent, "ssd:Annotations"), "ssc:Annotation", type="com.opensimulationplatform"
    )
    SubElement(
        SubElement(annotation, "osp:Algorithm"),
        "osp:FixedStepAlgorithm",
        baseStepSize=repr(experiment.step),
    )


def _text(root: Element) -> bytes:
    ElementTree.indent(root)
    return (
        b'<?xml version="1.0" encoding="UTF-8"?>\n'
        + ElementTree.tostring(root, encoding="unicode").encode()
        + b"\n"
    )
