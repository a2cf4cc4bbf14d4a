"""Writes the reference of an FMU's variables, from the rows of the FMU's own documentation."""

from __future__ import annotations

from collections.abc import Iterator

from hexapod_cosim.controller import DEFAULT_PERIOD
from hexapod_cosim.cosim.export.documentation import Row, variable_rows
from hexapod_cosim.cosim.interface.controller import load_controller_interface
from hexapod_cosim.cosim.interface.plant import load_interface
from hexapod_cosim.cosim.interface.records import Interface
from hexapod_cosim.cosim.run.plan import make_setup
from hexapod_cosim.models import load_robot

HEADINGS = {"input": "Inputs", "output": "Outputs", "parameter": "Parameters", "local": "Locals"}
# `hexapod design` computes these start values for each robot
DESIGNED, DESIGNED_NAMES = "designed", ("gains.paper.",)
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
        rows = variable_rows(interface, causality, arrayed=False)
        if rows:
            yield f"## {heading}\n"
            yield "| " + " | ".join(COLUMNS) + " |"
            yield "|" + "---|" * len(COLUMNS)
            yield from map(_row, rows)
            yield ""
    yield from _choices(interface)


def _row(row: Row) -> str:
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
