"""Writes the reference of an FMU's variables."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence

from hexapod_cosim.controller import DEFAULT_PERIOD
from hexapod_cosim.cosim.interface.controller import load_controller_interface
from hexapod_cosim.cosim.interface.plant import load_interface
from hexapod_cosim.cosim.interface.records import Interface, Pattern, Variable
from hexapod_cosim.cosim.run.plan import make_setup
from hexapod_cosim.models import load_robot

HEADINGS = {"input": "Inputs", "output": "Outputs", "parameter": "Parameters", "local": "Locals"}
# `hexapod design` computes these start values for each robot
DESIGNED, DESIGNED_NAMES = "designed", ("gains.paper.",)
Row = dict[str, str]
COLUMNS = ("variable", "unit", "number", "range", "start", "meaning")


def interfaces() -> dict[str, Interface]:
    """Returns the interfaces of the default robot's two FMUs."""
    robot = load_robot("athena")
    return {
        "plant": load_interface(robot),
        "controller": load_controller_interface(
            make_setup(robot, control="kinematic", period=DEFAULT_PERIOD)
        ),
    }


def page(interface: Interface) -> str:
    """Returns the page on an FMU's variables."""
    return "\n".join(_lines(interface)) + "\n"


def _lines(interface: Interface) -> Iterator[str]:
    component = interface.component
    yield f"# Variables of the {component.name}'s FMU\n"
    yield (
        f"Made from `{component.tree}/interface.toml`. Start values are the ATHENA-like robot's. "
        "`{leg}` stands for LF, LM, LR, RF, RM, RR, `{joint}` for coxa, femur, tibia, "
        "`{inertia}` for xx, yy, zz, xy, xz, yz, and `[i]` for 1, 2, 3 (quaternions: to 4).\n"
    )
    yield (
        "In FMI 3.0 a row is one array without the braces' part of its name: "
        "`{leg}.foot.force[i]` is `foot.force[6][3]`, its elements "
        "in the order above, the last index fastest.\n"
    )
    for causality, heading in HEADINGS.items():
        rows = variable_rows(interface, causality)
        if rows:
            yield f"## {heading}\n"
            yield "| " + " | ".join(COLUMNS) + " |"
            yield "|" + "---|" * len(COLUMNS)
            yield from map(_line, rows)
            yield ""
    yield from _choices(interface)


def _line(row: Row) -> str:
    unit = row["unit"] + (f" ({row['display']})" if row["display"] else "")
    unit = f"[{unit}](#{unit.lower()})" if row["choices"] else unit
    start = DESIGNED if row["name"].startswith(DESIGNED_NAMES) else row["start"]
    cells = (f"`{row['name']}`", unit, row["count"], row["range"], start, row["meaning"])
    return (
        "| "
        + " | ".join(text if text.startswith(("`", "[")) else escaped(text) for text in cells)
        + " |"
    )


def _choices(interface: Interface) -> Iterator[str]:
    used = {variable.enumeration for variable in interface.variables}
    if used - {None}:
        yield "## Choices\n"
    for name, enumeration in interface.enumerations.items():
        if name in used:
            yield f"### {name}\n\n| number | name | meaning |\n|---|---|---|"
            yield from (
                f"| {number} | `{item}` | {escaped(text)} |"
                for number, (item, text) in enumerate(enumeration.items, start=1)
            )
            yield ""


def escaped(text: str) -> str:
    """Escapes plain text for a Markdown table."""
    for character in "\\|*_[]<>$`":
        text = text.replace(character, "\\" + character)
    return text


def variable_rows(interface: Interface, causality: str) -> list[Row]:
    """Returns table rows of the variables of a causality: one for each pattern."""
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
