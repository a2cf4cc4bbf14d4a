"""Writes modelDescription.xml and buildDescription.xml of FMI 3.0.

The variables are those of FMI 2.0, with arrays in the place of their elements.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any
from xml.etree.ElementTree import Element, SubElement

from hexapod_cosim.cosim.common.components import Component
from hexapod_cosim.cosim.common.plant_files import DISTRIBUTION
from hexapod_cosim.cosim.interface.arrays import Array, arrays
from hexapod_cosim.cosim.interface.model_description import (
    ModelDescription,
    about_type,
    about_unit,
    add_experiment,
    add_log_categories,
    add_provenance,
    add_units,
    document_text,
    general_facts,
    render_fmi2,
    stated,
    typed_attributes,
)
from hexapod_cosim.cosim.interface.records import Interface, Variable

# capabilities, each tested by tests/fmi/test_fmi3.py
CAPABILITIES = {
    "needsExecutionTool": "false",
    "canBeInstantiatedOnlyOncePerProcess": "false",
    "canGetAndSetFMUState": "true",
    "canSerializeFMUState": "true",
    "providesPerElementDependencies": "false",
}
MODEL_EXCHANGE = {"needsCompletedIntegratorStep": "true", "providesEvaluateDiscreteStates": "false"}
CO_SIMULATION = {
    "canHandleVariableCommunicationStepSize": "true",
    "providesEvaluateDiscreteStates": "false",
}
# of components with events and steps of their own
EVENTS = (
    "hasEventMode",
    "mightReturnEarlyFromDoStep",
    "providesIntermediateUpdate",
    "canReturnEarlyAfterIntermediateUpdate",
)
TYPES = {"Real": "Float64", "Enumeration": "Enumeration", "Integer": "Int64", "Boolean": "Boolean"}
TIME = "time"


def render_fmi3(interface: Interface) -> ModelDescription:
    """Returns the model description of a component's FMI 3.0 FMU.

    Its instantiation token is the GUID of the FMI 2.0 FMU with the same binary and start values.
    """
    guid = render_fmi2(interface).guid
    variables = arrays(interface)
    root = Element(
        "fmiModelDescription",
        {"fmiVersion": "3.0", "instantiationToken": guid} | general_facts(interface),
    )
    _add_interfaces(root, interface)
    add_units(root, interface.units)
    _add_types(root, interface)
    add_log_categories(root, interface)
    add_experiment(root, interface)
    _add_variables(root, interface, variables)
    _add_structure(root, interface, variables)
    add_provenance(SubElement(root, "Annotations"), "Annotation", {"type": DISTRIBUTION}, interface)
    return ModelDescription(guid=guid, xml=document_text(root))


def render_build_description(component: Component, sources: Iterable[str]) -> str:
    """Returns buildDescription.xml of a component, for C files in the archive's sources folder."""
    root = Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = SubElement(
        root,
        "BuildConfiguration",
        modelIdentifier=component.identifier,
        description="C11 and its library, nothing else",
    )
    files = SubElement(configuration, "SourceFileSet", language="C11")
    for name in sources:
        SubElement(files, "SourceFile", name=name)
    SubElement(files, "IncludeDirectory", name=".")
    SubElement(
        configuration,
        "Library",
        name="m",
        external="true",
        description="mathematics of the C library, where it stands apart",
    )
    return document_text(root)


def _add_interfaces(root: Element, interface: Interface) -> None:
    """Adds CoSimulation and, for components with continuous states, ModelExchange."""
    has_states = bool(interface.states)
    differentiable = has_states and interface.directional_derivatives
    both = {"modelIdentifier": interface.component.identifier} | CAPABILITIES
    for kind in ("Directional", "Adjoint"):
        both[f"provides{kind}Derivatives"] = "true" if differentiable else "false"
    if has_states:
        SubElement(root, "ModelExchange", both | MODEL_EXCHANGE)
    events = dict.fromkeys(EVENTS, "true" if has_states else "false")
    SubElement(
        root,
        "CoSimulation",
        both | CO_SIMULATION | events | {"maxOutputDerivativeOrder": str(int(has_states))},
    )


def _add_types(root: Element, interface: Interface) -> None:
    """Adds the types of enumerations and units."""
    parent = Element("TypeDefinitions")
    for enumeration in interface.enumerations.values():
        facts = {"name": enumeration.name, "description": about_type(enumeration, interface)}
        element = SubElement(parent, "EnumerationType", facts)
        for number, (name, text) in enumerate(enumeration.items, start=1):
            SubElement(element, "Item", name=name, value=str(number), description=text)
    for unit in interface.units:
        if unit.type is not None:
            display = {"displayUnit": unit.display[0]} if unit.display else {}
            SubElement(
                parent,
                "Float64Type",
                {"name": unit.type, "description": about_unit(unit)}
                | {"quantity": unit.type, "unit": unit.name}
                | display,
            )
    root.extend([parent] if len(parent) else [])


def _add_variables(root: Element, interface: Interface, variables: Iterable[Array]) -> None:
    """Adds time and all variables."""
    parent = SubElement(root, "ModelVariables")
    reference = str(interface.first_reference["independent"])
    SubElement(
        parent,
        "Float64",
        {
            "name": TIME,
            "valueReference": reference,
            "causality": "independent",
            "variability": "continuous",
            "unit": "s",
            "description": "Simulated time",
        },
    )
    references = _references(variables)
    derivative_of = {state.derivative: references[state.name] for state in interface.states}
    for variable in variables:
        _add_variable(parent, variable, interface, derivative_of.get(variable.first.name))


def _references(variables: Iterable[Array]) -> dict[str, int]:
    """Returns the value references of arrays by the names of their elements."""
    return {element.name: array.reference for array in variables for element in array.elements}


def _add_variable(
    parent: Element, array: Array, interface: Interface, derivative_of: int | None
) -> None:
    """Adds a variable; derivative_of: value reference of its state."""
    first = array.first
    attributes: dict[str, Any] = {
        "name": array.name,
        "valueReference": array.reference,
        "causality": first.causality,
        "variability": first.variability,
        "initial": {"input": None, "parameter": "exact"}.get(first.causality, "calculated"),
        "description": array.description,
        **typed_attributes(first, interface),
        "start": _starts(array),
        "derivative": derivative_of,
        "reinit": "true" if first.name in interface.reinitialised else None,
        "intermediateUpdate": "true" if _is_intermediate(first, interface) else None,
    }
    element = SubElement(parent, TYPES[first.type], stated(attributes))
    for size in array.shape:
        SubElement(element, "Dimension", start=str(size))


def _is_intermediate(variable: Variable, interface: Interface) -> bool:
    """Returns whether importers may read or set a variable at steps of the solver."""
    continuous = variable.variability == "continuous" and variable.type == "Real"
    return bool(interface.states) and continuous and variable.causality in ("input", "output")


def _starts(array: Array) -> str | None:
    """Returns the elements' start values; None for outputs."""
    values = [e.start for e in array.elements if e.start is not None]
    return " ".join(stated({str(k): value for k, value in enumerate(values)}).values()) or None


def _add_structure(root: Element, interface: Interface, variables: tuple[Array, ...]) -> None:
    """Adds FMI 2.0's dependencies of elements as those of their arrays, and event indicators."""
    structure = SubElement(root, "ModelStructure")
    by_reference = {array.reference: array for array in variables}
    references = _references(variables)
    outputs = [array for array in variables if array.first.causality == "output"]
    derivatives = _arrays_of(
        [state.derivative for state in interface.states], references, by_reference
    )
    states = _arrays_of([state.name for state in interface.states], references, by_reference)
    initial = sorted({array.reference for array in (*outputs, *derivatives, *states)})
    indicators = [
        array
        for pattern in interface.indicator_patterns
        for array in variables
        if array.pattern == pattern
    ]
    for title, arrays_, depends in (
        ("Output", outputs, interface.depends),
        ("ContinuousStateDerivative", derivatives, interface.depends),
        (
            "InitialUnknown",
            [by_reference[reference] for reference in initial],
            interface.depends_initially,
        ),
        ("EventIndicator", indicators, interface.depends),
    ):
        for array in arrays_:
            causalities = ("input", "parameter") if title == "InitialUnknown" else ("input",)
            known = {one.reference for one in variables if one.first.causality in causalities}
            known |= set() if title == "InitialUnknown" else {one.reference for one in states}
            _add_unknown(structure, title, array, _knowns(array, depends, references, known))


def _arrays_of(
    names: Iterable[str], references: Mapping[str, int], by_reference: Mapping[int, Array]
) -> list[Array]:
    """Returns the arrays of elements, each once, in the order of the elements."""
    return [
        by_reference[reference] for reference in dict.fromkeys(references[name] for name in names)
    ]


def _knowns(
    array: Array,
    depends: Callable[[str], tuple[str, ...] | None],
    references: Mapping[str, int],
    everything: Iterable[int],
) -> list[int]:
    """Returns the references of the arrays that some element depends on. All of them are written
    out, because CasADi reads no unknown without dependencies.
    """
    found: set[int] = set()
    for element in array.elements:
        knowns = depends(element.name)
        if knowns is None:
            return sorted(everything)
        found |= {references[known] for known in knowns}
    return sorted(found)


def _add_unknown(structure: Element, title: str, array: Array, knowns: Iterable[int]) -> None:
    """Adds an unknown with its dependencies."""
    attributes = {"valueReference": str(array.reference)}
    attributes["dependencies"] = " ".join(map(str, knowns))
    SubElement(structure, title, attributes)
