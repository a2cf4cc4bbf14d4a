"""Changes what an FMU's model description offers, for importers and binaries that have less."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from hexapod_cosim.cosim.interface.plant_interface import Enumeration, Interface, Variable

# in a binary that a compiler without complex numbers built (plant_fmu/src/plant/continuous.c)
NO_DERIVATIVES = b"derivatives: got a call in a binary without complex numbers"


def with_integers(interface: Interface) -> Interface:
    """Returns the interface with Integers instead of enumerations, from 1 to the number of items.

    Their descriptions list the items. Binaries take both as the same numbers.
    """
    variables = tuple(_as_integer(one, interface.enumerations) for one in interface.variables)
    return replace(interface, variables=variables, enumerations={})


def _as_integer(variable: Variable, enumerations: Mapping[str, Enumeration]) -> Variable:
    """Returns a variable whose enumeration, if it has one, is an Integer."""
    if variable.enumeration is None:
        return variable
    names = [name for name, _ in enumerations[variable.enumeration].items]
    listed = ", ".join(f"{number} {name}" for number, name in enumerate(names, start=1))
    return replace(
        variable,
        type="Integer",
        enumeration=None,
        minimum=1,
        maximum=len(names),
        description=f"{variable.description}: {listed}",
    )


def listed_items(description: str | None) -> dict[str, int]:
    """Returns the items that the description of such an Integer lists, with their numbers."""
    listed = (description or "").rpartition(": ")[2].split(", ")
    pairs = (item.partition(" ") for item in listed)
    return {name: int(number) for number, _, name in pairs if number.isdecimal()}


def for_binaries(interface: Interface, binaries: Mapping[str, bytes]) -> Interface:
    """Returns the interface that all of these binaries have: without directional derivatives if
    one was built by a compiler without complex numbers, such as Microsoft's.
    """
    lacking = any(NO_DERIVATIVES in data for data in binaries.values())
    return replace(interface, directional_derivatives=False) if lacking else interface
