"""Writes FMUs, their connections and their parameters as a System Structure package: SSP 1.0 for
FMUs of FMI 2.0, SSP 2.0 for those of FMI 3.0, whose arrays are connected as a whole.

An output of one component is connected to the input of the other that has the same name, type and
dimensions. Unconnected inputs, such as the walking command, are in the parameter set of SSP 1.0.
Enumerations are not, since readers of packages refuse them; they keep the FMU's start values. A
package of SSP 2.0 has no parameter sets: all values are the FMUs' start values.
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
from hexapod_cosim.cosim.export.plant import write_archive
from hexapod_cosim.cosim.export.start_values import check_range, enumeration_error, unknown_error
from hexapod_cosim.cosim.interface.descriptions import read_description
from hexapod_cosim.models.errors import FmuError

VERSIONS = {"2.0": "1.0", "3.0": "2.0"}  # of SSP by FMI's
STANDARD = "http://ssp-standard.org/SSP1/SystemStructure"
SSD, SSC, SSV = f"{STANDARD}Description", f"{STANDARD}Common", f"{STANDARD}ParameterValues"
OSP = "http://opensimulationplatform.com/SSP/OSPAnnotations"
# some readers require these prefixes, not the namespaces only
PREFIXES = {"ssd": SSD, "ssc": SSC, "ssv": SSV, "osp": OSP}
PARAMETER_SET = "start"  # the same name for all components, so that tools apply all sets together
REAL = ("Real", "Float64")  # of FMI 2.0 and 3.0
TYPES = (*REAL, "Boolean")
KINDS = ("input", "output", "parameter")
NOTHING: Mapping[str, Any] = MappingProxyType({})
BASE_UNITS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad", "factor", "offset")


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """Default step size and stop time of the package [s]."""

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
        """Inputs, outputs and parameters of the types that SSP supports, in the FMU's order."""
        return {
            one.name: one
            for one in self.description.modelVariables
            if one.causality in KINDS and one.type in TYPES
        }

    def of(self, causality: str) -> dict[str, Any]:
        """Returns the variables of one causality."""
        return {
            name: variable
            for name, variable in self.variables.items()
            if variable.causality == causality
        }


@dataclass(frozen=True)
class Connection:
    """A connection of an output to an input of the same name, a scalar or an array."""

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
    """Writes a package of FMUs, connected by the names of their variables, and returns its path.

    Args:
        path: the file to write, atomically.
        fmus: files by the names of their components.
        title: of the system.
        experiment: default step size and stop time.
        values: of parameters and unconnected inputs by component and name, instead of the FMUs'
            start values; of FMUs of FMI 2.0 only.

    Raises FmuError for FMUs without co-simulation, FMUs of different versions, FMUs that do not
    connect, and unknown or invalid values; HexapodError when the path cannot be written.
    """
    components = [
        Component(name, fmu, read_description(fmu, tuple(VERSIONS))) for name, fmu in fmus.items()
    ]
    connections, version = connect(components), _version(components)
    members = {
        "SystemStructure.ssd": _text(
            structure(components, connections, title=title, experiment=experiment)
        )
    }
    for component in components:
        members[f"resources/{component.name}.fmu"] = component.fmu.read_bytes()
        if version == VERSIONS["2.0"]:
            members[_values_file(component)] = _text(
                parameter_set(component, connections, values.get(component.name, NOTHING))
            )
    return write_archive(Path(path), members)


def _version(components: Sequence[Component]) -> str:
    """Returns the version of SSP for the FMUs. Raises FmuError for FMUs of different versions."""
    found = {one.name: str(one.description.fmiVersion) for one in components}
    if len(set(found.values())) > 1:
        raise FmuError(
            "FMUs of different versions in one package",
            got=", ".join(f"{name}: FMI {version}" for name, version in found.items()),
            expected="one version",
            fix="export all of them with the same --fmi",
        )
    return VERSIONS[next(iter(found.values()))]


def connect(components: Sequence[Component]) -> list[Connection]:
    """Returns the connections between components.

    Raises FmuError for a component without connections, and for an input with two sources.
    """
    found = [
        Connection(source.name, target.name, name)
        for source in components
        for target in components
        if source is not target
        for name, output in source.of("output").items()
        if name in target.of("input") and _kind(target.variables[name]) == _kind(output)
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


def _kind(variable: Any) -> tuple[str, tuple[int, ...]]:
    """Returns the type and the dimensions of a variable; none of a scalar."""
    return variable.type, tuple(int(one.start) for one in variable.dimensions or ())


def structure(
    components: Sequence[Component],
    connections: Iterable[Connection],
    *,
    title: str,
    experiment: Experiment,
) -> Element:
    """Returns the root of SystemStructure.ssd."""
    version = _version(components)
    root = Element(
        "ssd:SystemStructureDescription", _heading(title, "ssd", "ssc", "osp", version=version)
    )
    system = SubElement(
        root,
        "ssd:System",
        name="root",
        description=f"{title}: " + ", ".join(one.name for one in components),
    )
    elements = SubElement(system, "ssd:Elements")
    for component in components:
        _add_component(elements, component, is_bound=version == VERSIONS["2.0"])
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
    """Returns the root of a component's .ssv file: its parameters and unconnected inputs.

    Raises FmuError for values of other variables.
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
    """Raises FmuError for a value that a package cannot set or that the FMU would refuse."""
    if name in {
        one.name for one in component.description.modelVariables if one.type == "Enumeration"
    }:
        raise enumeration_error(component.name, name)
    if name not in settable:
        raise unknown_error(component.name, name, settable)
    low, high = _range(settable[name])
    check_range(
        f"{component.name}.{name}",
        value,
        low,
        high,
        whole=settable[name].type == "Boolean",
        unit=settable[name].unit,
    )


def _range(variable: Any) -> tuple[float, float]:
    """Returns minimum and maximum of a variable, its own or those of its type."""
    if variable.type == "Boolean":
        return 0.0, 1.0
    sources = [one for one in (variable, variable.declaredType) if one is not None]
    low, high = (
        next((float(getattr(one, key)) for one in sources if getattr(one, key) is not None), None)
        for key in ("min", "max")
    )
    return -math.inf if low is None else low, math.inf if high is None else high


def _heading(name: str, *prefixes: str, version: str = VERSIONS["2.0"]) -> dict[str, str]:
    """Returns the attributes of a root element."""
    facts = {
        "version": version,
        "name": name,
        "generationTool": f"{DISTRIBUTION} {package_version()}",
    }
    return facts | {f"xmlns:{prefix}": PREFIXES[prefix] for prefix in prefixes}


def _values_file(component: Component) -> str:
    """Returns the path of a component's parameter set in the package."""
    return f"resources/{component.name}.ssv"


def _add_component(parent: Element, component: Component, *, is_bound: bool) -> None:
    """Adds a component with its connectors and, if it is bound to one, its parameter set."""
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
        for size in _kind(variable)[1]:
            SubElement(connector, "ssc:Dimension", size=str(size))
    if not is_bound:
        return
    bindings = SubElement(element, "ssd:ParameterBindings")
    SubElement(
        bindings,
        "ssd:ParameterBinding",
        type="application/x-ssp-parameter-set",
        source=_values_file(component),
    )


def _described(variable: Any) -> dict[str, str]:
    """Returns the name and description of a variable as attributes."""
    text = {"description": variable.description} if variable.description else {}
    return {"name": variable.name} | text


def _start(variable: Any, value: float | None) -> str:
    """Returns the given value or the FMU's start value as text without loss of digits."""
    if variable.type == "Boolean":
        return str(variable.start == "true" if value is None else bool(value)).lower()
    return repr(float(variable.start) if value is None else float(value))


def _unit(variable: Any, component: Component) -> dict[str, str]:
    """Returns the unit attribute, if the unit has integer exponents, which SSP requires."""
    supported = any(
        unit.name == variable.unit and unit.baseUnit is not None
        for unit in component.description.unitDefinitions
    )
    return {"unit": variable.unit} if variable.type in REAL and supported else {}


def _add_units(root: Element, tag: str, components: Iterable[Component]) -> None:
    """Adds each used unit once."""
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
    """Adds start and stop time, and the step size in an annotation that readers support."""
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
    """Formats a document."""
    ElementTree.indent(root)
    return (
        b'<?xml version="1.0" encoding="UTF-8"?>\n'
        + ElementTree.tostring(root, encoding="unicode").encode()
        + b"\n"
    )
