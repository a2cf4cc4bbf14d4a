"""The variables of the FMI 3 FMU: one for each pattern of interface.toml, an array if the pattern
has axes.

An array's name is the pattern's name without its axes, its dimensions are the axes in the order of
the name, and its value reference is that of its first element. LF.coxa.angle_ref, ...
RR.tibia.angle_ref of FMI 2 are angle_ref[6][3] in FMI 3.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

from hexapod_cosim.cosim.interface.patterns import plain_name
from hexapod_cosim.cosim.interface.records import CAUSALITIES, Interface, Pattern, Variable


@dataclass(frozen=True, kw_only=True)
class Array:
    """One variable of the FMI 3 FMU."""

    name: str
    pattern: str  # the name in interface.toml
    shape: tuple[int, ...]  # () for a scalar
    elements: tuple[Variable, ...]  # the last index runs fastest
    description: str

    @property
    def first(self) -> Variable:
        """The first element, whose type, unit and range are those of all."""
        return self.elements[0]

    @property
    def reference(self) -> int:
        """The value reference."""
        return self.first.reference


def arrays(interface: Interface) -> tuple[Array, ...]:
    """Returns all variables in the order of interface.toml."""
    found: list[Array] = []
    for causality in CAUSALITIES:
        variables = iter(interface.of_causality(causality))
        found += [
            _array(pattern, variables)
            for pattern in interface.patterns
            if pattern.causality == causality
        ]
    return tuple(found)


def _array(pattern: Pattern, variables: Iterator[Variable]) -> Array:
    """Makes the array of a pattern, whose elements are the next variables."""
    shape = tuple(len(labels) for _, labels in pattern.axes)
    elements = tuple(islice(variables, math.prod(shape)))
    return Array(
        name=plain_name(pattern.name),
        pattern=pattern.name,
        shape=shape,
        elements=elements,
        description=_description(pattern),
    )


def _description(pattern: Pattern) -> str:
    """Returns the pattern's description with the labels of axes other than 1, 2, 3."""
    axes = [f"{axis} ({' '.join(labels)})" for axis, labels in pattern.axes if axis != "i"]
    text = re.sub(r"Entry \{\w+\}", "Entries", pattern.description)
    return f"{text}; by {', '.join(axes)}" if axes else text
