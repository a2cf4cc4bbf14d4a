"""Records of an FMU's variables, units and enumerations, and of its whole interface."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from operator import attrgetter
from typing import Literal

from hexapod_cosim.cosim.common.components import Component
from hexapod_cosim.models.errors import HexapodError, unknown_name
from hexapod_cosim.models.records import Robot

Causality = Literal["input", "output", "parameter", "local"]
Type = Literal["Real", "Boolean", "Enumeration", "Integer"]
_IN_TABLE = (
    *("reference", "name", "type", "causality", "variability", "unit", "minimum", "maximum"),
    *("field", "group"),
)  # of a Variable, for its binary
CAUSALITIES: tuple[Causality, ...] = ("input", "output", "parameter", "local")


@dataclass(frozen=True, kw_only=True)
class Unit:
    """A unit and its display unit.

    exponents: of the SI base units; None where they are no integers, as FMI requires.
    display: name of the display unit and factor: display value = factor * value.
    type: the type that variables of this unit declare.
    """

    name: str
    exponents: Mapping[str, int] | None
    display: tuple[str, float] | None
    type: str | None = None


@dataclass(frozen=True, kw_only=True)
class Enumeration:
    """An enumeration type.

    Item k of `items` (name, description) has the number k + 1 and the C constant {prefix}_{NAME}.
    """

    name: str
    prefix: str
    items: tuple[tuple[str, str], ...]

    def number(self, item: str) -> int:
        """Returns the number of an item. Raises HexapodError for an unknown one."""
        names = [name for name, _ in self.items]
        if item not in names:
            raise unknown_name(self.name, item, names)
        return names.index(item) + 1

    def constant(self, number: int) -> str:
        """Returns the C constant of a number."""
        return f"{self.prefix}_{self.items[number - 1][0]}".upper()


@dataclass(frozen=True, kw_only=True)
class Variable:
    """One scalar variable of the FMU.

    depends: states and inputs that an output or local variable is a direct function of; None: all.
    initial: parameters that its initial value depends on, besides those of its states; None: all.
    group: of the outputs that are computed together; None: all.
    """

    name: str
    reference: int
    type: Type
    causality: Causality
    variability: str
    unit: str | None  # of a Real
    minimum: float | None
    maximum: float | None
    nominal: float | None
    start: float | int | None  # None for outputs
    enumeration: str | None
    field: str  # lvalue in struct hxVariables
    depends: tuple[str, ...] | None
    initial: tuple[str, ...] | None
    group: str | None
    description: str

    def check(self, value: float, error: Callable[..., HexapodError], *, name: str) -> None:
        """Raises the error for a value that is out of range, or not whole where it must be."""
        low, high = (0.0, 1.0) if self.type == "Boolean" else (self.minimum, self.maximum)
        low, high = -math.inf if low is None else low, math.inf if high is None else high
        is_whole = self.type == "Real" or float(value).is_integer()
        if not (math.isfinite(value) and low <= value <= high and is_whole):
            expected = f"{low:g} to {high:g} {self.unit or ''}".rstrip()
            what, fix = f"{name} is out of range", "give a value within"
            raise error(what, got=value, expected=expected, fix=fix)


@dataclass(frozen=True, kw_only=True)
class State:
    """A continuous state of model exchange, its derivative and the parameters that its initial
    value depends on, by the names of their variables.
    """

    name: str
    derivative: str
    initial: tuple[str, ...]
    reinit: bool  # whether an event may set it


@dataclass(frozen=True, kw_only=True)
class Pattern:
    """One entry of interface.toml, which stands for one variable or for several.

    axes: the axes in the name, each with its labels; in the order of the variables the first axis
    runs slowest.
    """

    name: str
    axes: tuple[tuple[str, tuple[str, ...]], ...]
    causality: Causality
    kind: str  # unit or type
    description: str


@dataclass(frozen=True, kw_only=True)
class Interface:
    """The content of one FMU's model description."""

    component: Component
    robot: Robot
    version: str
    variables: tuple[Variable, ...]
    states: tuple[State, ...]  # in the order in which importers exchange them
    event_indicators: int
    indicator_patterns: tuple[str, ...]  # those whose variables are the event indicators
    patterns: tuple[Pattern, ...]
    units: tuple[Unit, ...]
    enumerations: Mapping[str, Enumeration]
    log_categories: Mapping[str, str]
    first_reference: Mapping[str, int]
    stop_time: float  # s
    step: float  # s
    directional_derivatives: bool = True  # of components with states: the binary has them

    @cached_property
    def by_name(self) -> Mapping[str, Variable]:
        """Returns the variables by name."""
        return {variable.name: variable for variable in self.variables}

    @cached_property
    def index(self) -> Mapping[str, int]:
        """Indices of variables in the model description, from 1, by name."""
        return {variable.name: place for place, variable in enumerate(self.variables, start=1)}

    @cached_property
    def derivative_of(self) -> Mapping[str, int]:
        """Indices of states by the names of their derivatives."""
        return {state.derivative: self.index[state.name] for state in self.states}

    @cached_property
    def reinitialised(self) -> frozenset[str]:
        """Names of the states that an event may set."""
        return frozenset(state.name for state in self.states if state.reinit)

    @cached_property
    def table_digest(self) -> int:
        """64 bits that identify what a binary has to know of the variables: all but start values,
        texts and dependencies.
        """
        facts = attrgetter(*_IN_TABLE)
        rows = [facts(one) for one in self.variables]
        return int.from_bytes(hashlib.sha256(repr(rows).encode()).digest()[:8], "big")

    def depends(self, name: str) -> tuple[str, ...] | None:
        """Returns the states and inputs that an output or derivative is a direct function of.

        None: all.
        """
        return self.variable(name).depends

    def depends_initially(self, name: str) -> tuple[str, ...] | None:
        """Returns the parameters and inputs that an initial value depends on; None: all."""
        variable, start = self.variable(name), {state.name: state.initial for state in self.states}
        if name in start:
            return start[name]
        if variable.depends is None or variable.initial is None:
            return None
        through = [known for state in variable.depends for known in start.get(state, (state,))]
        return tuple(dict.fromkeys([*through, *variable.initial]))

    def variable(self, name: str) -> Variable:
        """Returns a variable by name. Raises HexapodError, which suggests the nearest name."""
        if name not in self.by_name:
            raise unknown_name("FMU variable", name, self.by_name)
        return self.by_name[name]

    def references(self, names: Iterable[str]) -> list[int]:
        """Returns value references in the order of the names. Raises HexapodError."""
        return [self.variable(name).reference for name in names]

    def of_causality(self, *causalities: Causality) -> list[Variable]:
        """Returns the variables of these causalities in the order of their references."""
        return [variable for variable in self.variables if variable.causality in causalities]
