"""The variables as FMI 3 has them: one for each pattern of interface.toml, an array if the pattern
has axes.

The name is the pattern's without its axes, the dimensions are the axes in the name's order, and the
value reference is that of the first element: LF.coxa.angle_ref, LF.femur.angle_ref, ...
RR.tibia.angle_ref of FMI 2 are angle_ref[6][3].
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

from hexapod_cosim.cosim.interface.interface import CAUSALITIES, Interface, Pattern, Variable
from hexapod_cosim.models.errors import HexapodError

AXES = re.compile(r"\{\w+\}\.|[._]\{\w+\}|\{\w+\}|\[i\]")


@dataclass(frozen=True, kw_only=True)
class Array:
    """One variable of the FMI 3 FMU."""

    name: str
    pattern: str  # its name in interface.toml
    shape: tuple[int, ...]  # () for a scalar
    elements: tuple[Variable, ...]  # the last index fastest
    description: str

    @property
    def first(self) -> Variable:
        """The first element: what it says of type, unit and range holds for all."""
        return self.elements[0]

    @property
    def reference(self) -> int:
        """The value reference."""
        return self.first.reference


def arrays(interface: Interface) -> tuple[Array, ...]:
    """All variables, in the order of interface.toml. Raises HexapodError when two patterns would
    have one name.
    """
    found: list[Array] = []
    for causality in CAUSALITIES:
        variables = iter(interface.of_causality(causality))
        found += [
            _array(pattern, variables)
            for pattern in interface.patterns
            if pattern.causality == causality
        ]
    names = [array.name for array in found]
    if twice := {name for name in names if names.count(name) > 1}:
        raise HexapodError(
            "names of FMI 3 variables",
            got=f"twice {', '.join(sorted(twice))}",
            expected="each once",
            fix="rename a pattern",
        )
    return tuple(found)


def array_name(pattern: str) -> str:
    """A pattern's name without its axes."""
    return AXES.sub("", pattern)


def _array(pattern: Pattern, variables: Iterator[Variable]) -> Array:
    """The array of a pattern, whose elements are the next variables."""
    shape = tuple(len(labels) for _, labels in pattern.axes)
    elements = tuple(islice(variables, math.prod(shape)))
    return Array(
        name=array_name(pattern.name),
        pattern=pattern.name,
        shape=shape,
        elements=elements,
        description=_description(pattern),
    )


def _description(pattern: Pattern) -> str:
    """The pattern's, with what its indices mean where they are not 1, 2, 3."""
    axes = [f"{axis} ({' '.join(labels)})" for axis, labels in pattern.axes if axis != "i"]
    text = re.sub(r"Entry \{\w+\}", "Entries", pattern.description)
    return f"{text}; by {', '.join(axes)}" if axes else text
