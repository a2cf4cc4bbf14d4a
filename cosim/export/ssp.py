"""Writes FMUs and their connections as a System Structure package: SSP 1.0 for FMUs of FMI 2.0,
SSP 2.0 for those of FMI 3.0, whose arrays are connected as a whole.

An output of one component is connected to the input of the other that has the same name, type and
dimensions. A package has no parameter sets: all values are the FMUs' start values. Inputs that no
output drives have no connectors, because masters set those to 0, and keep their start values.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement

from hexapod_cosim.cosim.common.plant_files import DISTRIBUTION, package_version
from hexapod_cosim.cosim.export.plant import write_archive
from hexapod_cosim.cosim.interface.descriptions import read_description
from hexapod_cosim.cosim.interface.model_description import document_text
from hexapod_cosim.models.errors import FmuError

VERSIONS = {"2.0": "1.0", "3.0": "2.0"}  # of SSP by FMI's
STANDARD = "http://ssp-standard.org/SSP1/SystemStructure"
SSD, SSC = f"{STANDARD}Description", f"{STANDARD}Common"
OSP = "http://opensimulationplatform.com/SSP/OSPAnnotations"
# some readers require these prefixes, not the namespaces only
PREFIXES = {"ssd": SSD, "ssc": SSC, "osp": OSP}
REAL = ("Real", "Float64")  # of FMI 2.0 and 3.0
TYPES = (*REAL, "Boolean")
KINDS = ("input", "output", "parameter")
BASE_UNITS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad", "factor", "offset")


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
    path: str | Path, fmus: Mapping[str, Path], *, title: str, step: float, stop: float
) -> Path:
    """Writes a package of FMUs, connected by the names of their variables, and returns its path.

    Args:
        path: the file to write, atomically.
        fmus: files by the names of their components, all of one version of FMI.
        title: of the system.
        step, stop: default step size and stop time [s].

    Raises FmuError for FMUs without co-simulation and without connections; HexapodError when the
    path cannot be written.
    """
    components = [
        Component(name, fmu, read_description(fmu, tuple(VERSIONS))) for name, fmu in fmus.items()
    ]
    root = structure(components, connect(components), title=title, step=step, stop=stop)
    members = {"SystemStructure.ssd": document_text(root).encode()}
    members |= {f"resources/{one.name}.fmu": one.fmu.read_bytes() for one in components}
    return write_archive(Path(path), members)


def connect(components: Sequence[Component]) -> list[Connection]:
    """Returns the connections between components. Raises FmuError for one without any."""
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
    return found


def _kind(variable: Any) -> tuple[str, tuple[int, ...]]:
    """Returns the type and the dimensions of a variable; none of a scalar."""
    return variable.type, tuple(int(one.start) for one in variable.dimensions or ())


def structure(
    components: Sequence[Component],
    connections: Iterable[Connection],
    *,
    title: str,
    step: float,
    stop: float,
) -> Element:
    """Returns the root of SystemStructure.ssd."""
    facts = {
        "version": VERSIONS[components[0].description.fmiVersion],
        "name": title,
        "generationTool": f"{DISTRIBUTION} {package_version()}",
    }
    spaces = {f"xmlns:{prefix}": space for prefix, space in PREFIXES.items()}
    root = Element("ssd:SystemStructureDescription", facts | spaces)
    system = SubElement(
        root,
        "ssd:System",
        name="root",
        description=f"{title}: " + ", ".join(one.name for one in components),
    )
    elements, driven = SubElement(system, "ssd:Elements"), list(connections)
    for component in components:
        _add_component(
            elements, component, {one.name for one in driven if one.end == component.name}
        )
    parent = SubElement(system, "ssd:Connections")
    for one in driven:
        ends = {
            "startElement": one.start,
            "startConnector": one.name,
            "endElement": one.end,
            "endConnector": one.name,
        }
        SubElement(parent, "ssd:Connection", ends)
    _add_units(root, components)
    _add_experiment(root, step, stop)
    return root


def _add_component(parent: Element, component: Component, driven: Container[str]) -> None:
    """Adds a component with its connectors, of inputs only those that are driven."""
    facts = {
        "name": component.name,
        "type": "application/x-fmu-sharedlibrary",
        "source": f"resources/{component.name}.fmu",
    }
    element = SubElement(parent, "ssd:Component", facts | {"implementation": "CoSimulation"})
    connectors = SubElement(element, "ssd:Connectors")
    for variable in component.variables.values():
        if variable.causality == "input" and variable.name not in driven:
            continue
        connector = SubElement(
            connectors, "ssd:Connector", {"name": variable.name, "kind": variable.causality}
        )
        if variable.description:
            connector.set("description", variable.description)
        SubElement(connector, f"ssc:{variable.type}", _unit(variable, component))
        for size in _kind(variable)[1]:
            SubElement(connector, "ssc:Dimension", size=str(size))


def _unit(variable: Any, component: Component) -> dict[str, str]:
    """Returns the unit attribute, if the unit has integer exponents, which SSP requires."""
    supported = any(
        unit.name == variable.unit and unit.baseUnit is not None
        for unit in component.description.unitDefinitions
    )
    return {"unit": variable.unit} if variable.type in REAL and supported else {}


def _add_units(root: Element, components: Iterable[Component]) -> None:
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
    parent = SubElement(root, "ssd:Units")
    for name in sorted(used):
        exponents = {key: getattr(known[name], key) for key in BASE_UNITS}
        neutral = {"factor": 1.0, "offset": 0.0}
        stated = {
            key: str(value) for key, value in exponents.items() if value != neutral.get(key, 0)
        }
        SubElement(SubElement(parent, "ssc:Unit", name=name), "ssc:BaseUnit", stated)


def _add_experiment(root: Element, step: float, stop: float) -> None:
    """Adds start and stop time, and the step size in an annotation that readers support."""
    parent = SubElement(root, "ssd:DefaultExperiment", startTime="0.0", stopTime=repr(stop))
    annotation = SubElement(
        SubElement(parent, "ssd:Annotations"), "ssc:Annotation", type="com.opensimulationplatform"
    )
    SubElement(
        SubElement(annotation, "osp:Algorithm"), "osp:FixedStepAlgorithm", baseStepSize=repr(step)
    )
