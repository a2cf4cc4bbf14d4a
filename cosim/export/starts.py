"""Changes start values of an FMU's inputs and parameters before it is written."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import replace

from hexapod_cosim.cosim.interface.plant import Causality, Interface, Variable
from hexapod_cosim.models.errors import FmuError, nearest_name

# enumerations that no robot file has
OPTIONS = {"control": "choose it with --controller", "gait.pattern": "choose it with --gait"}
SETTABLE: tuple[Causality, ...] = ("input", "parameter")


def with_starts(
    interface: Interface, values: Mapping[str, float], *, driven: Collection[str] = ()
) -> Interface:
    """Returns the interface with other start values, by the names of scalar variables.

    driven: inputs that another component sets, whose start values have no effect.

    Raises FmuError for other variables than inputs and parameters, enumerations, driven inputs, and
    values out of range.
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
    if variable is not None and variable.type == "Enumeration":
        raise enumeration_error(component, name)
    if variable is None or variable.causality not in SETTABLE or name in driven:
        free = [one.name for one in interface.of_causality(*SETTABLE) if one.name not in driven]
        raise unknown_error(component, name, free)
    low, high = (0.0, 1.0) if variable.type == "Boolean" else (variable.minimum, variable.maximum)
    check_range(
        f"{component}.{name}",
        value,
        -math.inf if low is None else low,
        math.inf if high is None else high,
        whole=variable.type != "Real",
        unit=variable.unit,
    )


def enumeration_error(component: str, name: str) -> FmuError:
    """Returns the error of an enumeration, which readers of packages refuse."""
    table, _, key = name.rpartition(".")
    fix = (
        OPTIONS.get(name)
        or f"write {key} under [{table}] of a robot file, and give that with --robot FILE"
    )
    expected = "a real or Boolean variable: readers of packages refuse enumerations"
    return FmuError(
        f"{component}: an enumeration cannot be set in a package",
        got=name,
        expected=expected,
        fix=fix,
    )


def unknown_error(component: str, name: str, settable: Collection[str]) -> FmuError:
    """Returns the error of a name that is not among the settable ones."""
    near = nearest_name(name, settable)
    fix = f"did you mean {near!r}?" if near else "name a parameter or an input that nothing drives"
    return FmuError(f"{component} has no such value to set", got=name, fix=fix)


def check_range(
    name: str, value: float, low: float, high: float, *, whole: bool, unit: str | None
) -> None:
    """Raises FmuError for a value that is not within [low, high]; a whole one is 0 or 1."""
    if (not whole or value in (0.0, 1.0)) and math.isfinite(value) and low <= value <= high:
        return
    raise FmuError(
        f"{name} is out of range",
        got=value,
        expected=f"{low:g} to {high:g} {unit or ''}".rstrip(),
        fix="give a value within",
    )


def _start(variable: Variable, value: float) -> float | int:
    """Returns a start value of the variable's type."""
    return float(value) if variable.type == "Real" else int(value)
