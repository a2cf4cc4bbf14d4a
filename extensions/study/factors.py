"""Reads the factors of a study file: a list of values or a distribution for each name.

Values, evenly spaced values and values that are evenly spaced in their logarithm:

    "friction.mu" = [0.3, 0.6]
    "friction.mu" = { linspace = [0.2, 1.0, 9] }
    "friction.mu" = { logspace = [0.2, 1.0, 9] }

Distributions; `normal` takes the mean and the standard deviation, `integers` the first and the
last integer:

    "torso.mass" = { uniform = [2.0, 4.0] }
    "torso.mass" = { loguniform = [2.0, 4.0] }
    "torso.mass" = { normal = [2.7, 0.1] }

A unit, and a factor of the designed gain:

    "terrain.incline" = { linspace = [0, 10, 6], unit = "deg" }
    "gains.hold.path_rate" = { loguniform = [0.3, 3.0], relative = true }
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from scipy.special import ndtri

from hexapod_cosim.extensions.study.keys import is_number, require, require_known, require_once
from hexapod_cosim.extensions.study.records import (
    INTEGERS,
    LOGUNIFORM,
    NORMAL,
    UNIFORM,
    VALUES,
    Factor,
    Value,
)

SPACED = ("linspace", "logspace")
KINDS = (VALUES, *SPACED, UNIFORM, LOGUNIFORM, NORMAL, INTEGERS)
OPTIONS = ("unit", "relative")
MAX_VALUES, MAX_FACTORS = 1_000_000, 1000
LARGEST_INTEGER = 2**53  # a double holds all integers up to it
PARAMETERS = "parameters."
LEAST_QUANTILE = 2.0**-53  # a normal distribution has no value at quantile 0
EXAMPLE = '"friction.mu" = { uniform = [0.3, 0.9] }'


def read_factors(table: Any, where: str) -> tuple[Factor, ...]:
    """Reads the factors of a table. Raises StudyError.

    Names with dots may be written in quotes or as nested tables.
    """
    fix = f"write [{where.rpartition(' ')[2]}]"
    require(isinstance(table, Mapping), table, "a table of factors", where, fix=fix)
    found: dict[str, Factor] = {}  # by name in small letters: columns of SQL ignore case
    for name, value in _named(table, ""):
        plain = plain_name(name)
        require_once(name, plain.lower() in found, f"{where}.{name}")
        found[plain.lower()] = _read_factor(plain, value, f"{where}.{name}")
    require(len(found) <= MAX_FACTORS, len(found), f"at most {MAX_FACTORS} factors", where)
    return tuple(found.values())


def plain_name(name: str) -> str:
    """Returns a setting's name without the prefix "parameters.", which is optional."""
    return name.removeprefix(PARAMETERS)


def _named(table: Mapping[str, Any], before: str) -> Iterator[tuple[str, Any]]:
    """Yields names with dots and their values: TOML reads friction.mu as nested tables."""
    for key, value in table.items():
        name = f"{before}{key}"
        if "." not in key and isinstance(value, Mapping) and _is_section(value):
            yield from _named(value, f"{name}.")
        else:
            yield name, value


def _is_section(table: Mapping[str, Any]) -> bool:
    """Returns whether a table holds factors rather than a distribution."""
    return bool(table) and all(
        isinstance(item, Mapping | list) and key not in KINDS for key, item in table.items()
    )


def _read_factor(name: str, value: Any, where: str) -> Factor:
    if isinstance(value, list):
        return Factor(name=name, kind=VALUES, values=_values(value, where))
    expected, fix = "a list of values or a distribution", f"write {EXAMPLE}"
    require(isinstance(value, Mapping), value, expected, where, fix=fix)
    require_known(value, (*KINDS, *OPTIONS), where)
    kinds = [key for key in value if key in KINDS]
    require(len(kinds) == 1, dict(value), f"one of {', '.join(KINDS)}", where, fix=fix)
    unit, relative = value.get("unit", ""), value.get("relative", False)
    typed = isinstance(unit, str) and isinstance(relative, bool)
    require(typed, dict(value), 'unit = "deg", relative = true or false', where)
    made = _of_kind(kinds[0], value[kinds[0]], f"{where}.{kinds[0]}")
    numbers = all(map(is_number, made.get("values", ())))
    expected = f"numbers, as there is a unit {unit!r}"
    require(numbers or not unit, value[kinds[0]], expected, where)
    return Factor(name=name, unit=unit, relative=relative, **made)


def _of_kind(kind: str, given: Any, where: str) -> dict[str, Any]:
    """Returns the kind and the values or ends of a factor, as keywords of Factor."""
    if kind == VALUES:
        return {"kind": VALUES, "values": _values(given, where)}
    if kind in SPACED:
        return {"kind": VALUES, "values": _spaced(kind, given, where)}
    low, high = _numbers(given, 2, where)
    whole = low == int(low) and high == int(high) and max(-low, high) <= LARGEST_INTEGER
    require(kind != NORMAL or high >= 0.0, given, "a standard deviation >= 0", where)
    require(kind == NORMAL or low <= high, given, "the lower end first", where)
    require(kind != LOGUNIFORM or low > 0.0, given, "ends > 0", where)
    require(kind != INTEGERS or whole, given, "whole numbers within 53 bits", where)
    close = math.isfinite(high / low if kind == LOGUNIFORM else 10.0 * max(abs(low), abs(high)))
    require(close, given, "ends that are closer", where)
    return {"kind": kind, "low": low, "high": high}


def _spaced(kind: str, given: Any, where: str) -> tuple[Value, ...]:
    """Returns the values of a linspace or a logspace."""
    low, high, count = _numbers(given, 3, where)
    whole = count == int(count) and 1 <= count <= MAX_VALUES
    require(whole, given, f"a whole number of 1 to {MAX_VALUES} values", where)
    require(kind == "linspace" or (low > 0.0 and high > 0.0), given, "ends > 0", where)
    require(low != high or count == 1, given, "different ends", where)
    space = np.linspace if kind == "linspace" else np.geomspace
    values = tuple(space(low, high, int(count)).tolist())
    require(all(map(math.isfinite, values)), given, "ends that are closer", where)
    return values


def _values(given: Any, where: str) -> tuple[Value, ...]:
    typed = isinstance(given, list) and all(isinstance(item, int | float | str) for item in given)
    expected, fix = "a list of numbers, names or booleans", "write values = [0.3, 0.6]"
    require(typed and len(given) > 0, given, expected, where, fix=fix)
    kinds = {bool: "booleans", str: "texts"}
    alike = len({kinds.get(type(item), "numbers") for item in given}) == 1
    require(alike, given, "values of one kind: numbers, texts or booleans", where)
    few = len(given) <= MAX_VALUES
    require(few, f"{len(given)} values", f"at most {MAX_VALUES}", where)
    return tuple(given)


def _numbers(given: Any, count: int, where: str) -> list[float]:
    finite = isinstance(given, list) and len(given) == count and all(map(is_number, given))
    require(finite, given, f"{count} finite numbers", where, fix=f"write {EXAMPLE}")
    return [float(item) for item in given]


def at_quantile(factor: Factor, share: float) -> Value:
    """Returns the value at a quantile, 0 to 1, of the factor's distribution.

    All values of a list are equally likely.
    """
    low, high = factor.low, factor.high
    if factor.kind == VALUES:
        return factor.values[min(int(share * len(factor.values)), len(factor.values) - 1)]
    if factor.kind == INTEGERS:
        return int(min(low + math.floor(share * (high - low + 1.0)), high))
    if factor.kind == LOGUNIFORM:
        return float(min(low * (high / low) ** share, high))
    if factor.kind == NORMAL:
        return float(low + high * ndtri(min(max(share, LEAST_QUANTILE), 1.0 - LEAST_QUANTILE)))
    return low + (high - low) * share


def samples(factor: Factor) -> tuple[Value, ...]:
    """Returns values by which the factor's name, unit and range can be checked.

    They are all values of a list, and the ends of a distribution. For a normal distribution they
    are the mean and the values one standard deviation away; a value further out is checked when it
    is run.
    """
    if factor.kind == VALUES:
        return factor.values
    if factor.kind == INTEGERS:
        return int(factor.low), int(factor.high)
    if factor.kind == NORMAL:
        return factor.low, factor.low - factor.high, factor.low + factor.high
    return factor.low, factor.high
