"""The text of start_values.txt: the numbers of an FMU's robot, which its binary reads."""

from __future__ import annotations

from functools import reduce

from hexapod_cosim.cosim.interface.plant import Interface, Variable

FNV_BASIS, FNV_PRIME, MASK, WORD = 0xCBF29CE484222325, 0x100000001B3, (1 << 64) - 1, 8


def start_values(interface: Interface, guid: str) -> str:
    """Returns start_values.txt, which the binary reads at instantiation (fmi/resources.c).

    It holds the GUID, a line "reference value name" for every input and parameter, and a checksum.
    """
    lines = [guid, *map(_start_line, interface.of_causality("input", "parameter"))]
    total = reduce(checksum, (line.encode() for line in lines), 0)
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
