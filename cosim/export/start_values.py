"""The text of start_values.txt: the numbers of an FMU's robot, which its binary reads."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from functools import reduce

from hexapod_cosim.cosim.interface.records import Causality, Interface, Variable
from hexapod_cosim.models.errors import FmuError, suggestion

FNV_BASIS, FNV_PRIME, MASK, WORD = 0xCBF29CE484222325, 0x100000001B3, (1 << 64) - 1, 8
SETTABLE: tuple[Causality, ...] = ("input", "parameter")


def start_values(interface: Interface, guid: str) -> str:
    """Returns start_values.txt, which the binary reads at instantiation (fmi/resources.c).

    It holds the GUID, a line "reference value name" for every input and parameter, and a checksum,
    which begins with the digest of the table of variables: a binary with another table refuses it.
    """
    lines = [guid, *map(_start_line, interface.of_causality("input", "parameter"))]
    total = reduce(checksum, (line.encode() for line in lines), interface.table_digest)
    return "\n".join([*lines, f"checksum {total:016x}"]) + "\n"


def _start_line(variable: Variable) -> str:
    """Returns the line "reference value name"; Reals are hexadecimal, so exact."""
    value = (
        float(variable.start or 0.0).hex()
        if variable.type == "Real"
        else str(int(variable.start or 0))
    )
    return f"{variable.reference} {value} {variable.name}"


def checksum(seed: int, data: bytes) -> int:
    """Returns hx_checksum of the plant: FNV-1a over little-endian words of 64 bits, with its high
    bits mixed into the low ones.
    """
    value = seed ^ FNV_BASIS
    for place in range(0, len(data), WORD):
        value = (value ^ int.from_bytes(data[place : place + WORD], "little")) * FNV_PRIME & MASK
        value ^= value >> 32
    return (value ^ len(data)) * FNV_PRIME & MASK


def with_starts(
    interface: Interface, values: Mapping[str, float], *, driven: Collection[str] = ()
) -> Interface:
    """Returns the interface with other start values, by the names of scalar variables.

    driven: inputs that another component sets, whose start values have no effect.

    Raises FmuError for other variables than inputs and parameters, driven inputs, and values out
    of range.
    """
    for name, value in values.items():
        _check(interface, name, value, driven)
    changed = tuple(
        replace(one, start=_start(one, values[one.name])) if one.name in values else one
        for one in interface.variables
    )
    return replace(interface, variables=changed)


def _check(interface: Interface, name: str, value: float, driven: Collection[str]) -> None:
    """Raises FmuError for a value that cannot be set."""
    component, variable = interface.component.name, interface.by_name.get(name)
    if variable is None or variable.causality not in SETTABLE or name in driven:
        free = [one.name for one in interface.of_causality(*SETTABLE) if one.name not in driven]
        otherwise = "name a parameter or an input without a source"
        fix = suggestion(name, free, otherwise=otherwise)
        raise FmuError(f"{component} has no such value to set", got=name, fix=fix)
    variable.check(value, FmuError, name=f"{component}.{name}")


def _start(variable: Variable, value: float) -> float | int:
    """Returns a start value of the variable's type."""
    return float(value) if variable.type == "Real" else int(value)
