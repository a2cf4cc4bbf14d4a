"""Writes documentation/index.html of an FMU."""

from __future__ import annotations

import posixpath
import re
from collections.abc import Iterable, Sequence
from xml.etree import ElementTree

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

from hexapod_cosim.cosim.common.components import PLANT
from hexapod_cosim.cosim.interface.arrays import arrays
from hexapod_cosim.cosim.interface.records import CAUSALITIES, Interface, Pattern, Variable

INTERFACES = {"CoSimulation": "co-simulation", "ModelExchange": "model exchange"}
# explanations of the names in the tables, for scalars (False) and arrays (True)
NAMES = {
    False: (
        "Below, {leg}, {joint} and {inertia} stand for each of the names above or of xx, yy, zz, "
        "xy, xz, yz; [i] for 1, 2, 3 (quaternions: to 4)."
    ),
    True: (
        "Below, the numbers behind a name are an array's sizes: 6 legs, 3 joints in the order "
        "above, 3 axes; the last index runs fastest. What FMI 2.0 calls LF.coxa.angle_ref is the "
        "first element of angle_ref."
    ),
}

Row = dict[str, str]


def render_html(interface: Interface, description: str, *, picture: str, reference: bool) -> str:
    """Returns the page of one FMU. The templates are in pages/, one for each component.

    Args:
        interface: of the FMU.
        description: the FMU's modelDescription.xml.
        picture: path of the robot's picture in the archive.
        reference: whether the archive contains reference results.
    """
    root = ElementTree.fromstring(description.encode())
    environment = Environment(
        loader=ChoiceLoader(
            [PackageLoader(one, "pages") for one in (PLANT.package, interface.component.package)]
        ),
        autoescape=True,
        undefined=StrictUndefined,
    )
    robot, arrayed = interface.robot, str(root.get("fmiVersion")).startswith("3")
    return environment.get_template(f"{interface.component.name}.html.jinja").render(
        robot=robot,
        picture=posixpath.relpath(picture, "documentation"),
        reference=reference,
        interface=interface,
        joints=sum(len(leg.links) for leg in robot.legs),
        fmi=root.get("fmiVersion"),
        token=root.get("guid", root.get("instantiationToken")),
        kinds=[name for tag, name in INTERFACES.items() if root.find(tag) is not None],
        names=NAMES[arrayed],
        arrayed=arrayed,
        groups={
            causality: variable_rows(interface, causality, arrayed=arrayed)
            for causality in CAUSALITIES
        },
        weight=robot.total_mass * max(map(abs, robot.gravity)),
    )


def variable_rows(interface: Interface, causality: str, *, arrayed: bool) -> list[Row]:
    """Returns table rows of the variables of a causality: one for each pattern or FMI 3.0 array."""
    if arrayed:
        chosen = [array for array in arrays(interface) if array.first.causality == causality]
        sizes = ["".join(f"[{size}]" for size in array.shape) for array in chosen]
        return [
            _row(array.name + size, array.description, array.elements, interface)
            for array, size in zip(chosen, sizes, strict=True)
        ]
    variables = [variable for variable in interface.variables if variable.causality == causality]
    patterns = [pattern for pattern in interface.patterns if pattern.causality == causality]
    return [
        _row(pattern.name, pattern.description, _matching(pattern, variables), interface)
        for pattern in patterns
    ]


def _row(name: str, meaning: str, variables: Sequence[Variable], interface: Interface) -> Row:
    """Returns the table row of variables that share a description."""
    first = variables[0]
    display = {unit.name: unit.display[0] for unit in interface.units if unit.display}.get(
        first.unit or "", ""
    )
    choices = interface.enumerations[first.enumeration].items if first.enumeration else ()
    return {
        "name": name,
        "unit": first.unit or first.enumeration or first.type,
        "display": display,
        "count": str(len(variables)),
        "range": "" if choices else _range(first),
        "start": _starts(variables, [name for name, _ in choices]),
        "meaning": meaning,
        "choices": "; ".join(
            f"{number} {name}: {text}" for number, (name, text) in enumerate(choices, start=1)
        ),
    }


def _matching(pattern: Pattern, variables: Iterable[Variable]) -> list[Variable]:
    """Returns the variables that a pattern stands for."""
    labels = dict(pattern.axes)
    expression = re.escape(pattern.name).replace(r"\[i\]", r"\[\d+\]")
    expression = re.sub(
        r"\\\{(\w+)\\\}",
        lambda match: f"(?:{'|'.join(map(re.escape, labels[match[1]]))})",
        expression,
    )
    matches = re.compile(expression).fullmatch  # once: there are thousands of pairs
    return [variable for variable in variables if matches(variable.name)]


def _range(variable: Variable) -> str:
    """Returns the text of a range; "" without limits."""
    if variable.minimum is None and variable.maximum is None:
        return ""
    low, high = (
        "" if bound is None else f"{bound:.4g}" for bound in (variable.minimum, variable.maximum)
    )
    return f"{low} to {high}" if low and high else f"from {low}" if low else f"to {high}"


def _starts(variables: Sequence[Variable], choices: Sequence[str]) -> str:
    """Returns a short text of the start values: one if all are equal, a range if there are many."""
    values = list(
        dict.fromkeys(variable.start for variable in variables if variable.start is not None)
    )
    if choices and values:
        return f"{values[0]} ({choices[int(values[0]) - 1]})"
    shown = list(dict.fromkeys(f"{value:.4g}" for value in values))
    return ", ".join(shown) if len(shown) <= 4 else f"{min(values):.4g} to {max(values):.4g}"
