"""Factors of a study file: the values or the distribution behind a name, and what lies at a
quantile of it.

"friction.mu" = [0.3, 0.6]                           values
"friction.mu" = { linspace = [0.2, 1.0, 9] }         evenly spaced values; logspace: evenly in the
logarithm "torso.mass"  = { uniform = [2.0, 4.0] }             drawn; loguniform, normal = [mean,
standard deviation], integers = [first, last] "terrain.incline" = { linspace = [0, 10, 6], unit =
"deg" } "gains.slip.kp"   = { loguniform = [0.3, 3.0], relative = true }     times the designed gain
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from scipy.special import ndtri

from hexapod_cosim.cosim.study.plan.records import (
    INTEGERS,
    LOGUNIFORM,
    NORMAL,
    UNIFORM,
    VALUES,
    Factor,
    StudyError,
    Value,
)
from hexapod_cosim.models import unknown_name

SPACED = ("linspace", "logspace")
KINDS = (VALUES, *SPACED, UNIFORM, LOGUNIFORM, NORMAL, INTEGERS)
BESIDES = ("unit", "relative")
MAX_VALUES, MAX_FACTORS = 1_000_000, 1000
LARGEST_INTEGER = 2**53  # that a double holds with all below
PARAMETERS = "parameters."
LEAST_QUANTILE = 2.0**-53  # a normal distribution has no value at 0
EXAMPLE = '"friction.mu" = { uniform = [0.3, 0.9] }'


def read_factors(table: Any, where: str) -> tuple[Factor, ...]:
    """The factors of a table, whose names may be written with dots in quotes or as tables.
    Raises StudyError.
    """
    if not isinstance(table, Mapping):
        raise StudyError(
            "wrong type",
            got=table,
            expected="a table of factors",
            fix=f"write [{where.rpartition(' ')[2]}]",
            where=where,
        )
    found: dict[str, Factor] = {}
    for name, value in _named(table, ""):
        plain = plain_name(name)
        if plain in found:
            raise StudyError(
                "a factor given twice",
                got=name,
                expected="each name once",
                fix="take one away",
                where=f"{where}.{name}",
            )
        found[plain] = _read_factor(plain, value, f"{where}.{name}")
    if len(found) > MAX_FACTORS:
        raise StudyError(
            "too many factors", got=len(found), expected=f"at most {MAX_FACTORS}", where=where
        )
    return tuple(found.values())


def plain_name(name: str) -> str:
    """Of a setting: parameters.torso.mass is another way to write torso.mass."""
    return name.removeprefix(PARAMETERS)


def _named(table: Mapping[str, Any], before: str) -> Iterator[tuple[str, Any]]:
    """Names with dots: friction.mu without quotes is a table in a table to TOML."""
    for key, value in table.items():
        name = f"{before}{key}"
        if "." not in key and isinstance(value, Mapping) and _is_section(value):
            yield from _named(value, f"{name}.")
        else:
            yield name, value


def _is_section(table: Mapping[str, Any]) -> bool:
    return bool(table) and all(
        isinstance(item, Mapping | list) and key not in KINDS for key, item in table.items()
    )


def _read_factor(name: str, value: Any, where: str) -> Factor:
    if isinstance(value, list):
        return Factor(name=name, kind=VALUES, values=_values(value, where))
    if not isinstance(value, Mapping):
        raise StudyError(
            "wrong type",
            got=value,
            expected="a list of values or a distribution",
            fix=f"write {EXAMPLE}",
            where=where,
        )
    for key in value:
        if key not in (*KINDS, *BESIDES):
            raise unknown_name("key", key, (*KINDS, *BESIDES), where=where, error=StudyError)
    kinds = [key for key in value if key in KINDS]
    if len(kinds) != 1:
        raise StudyError(
            "not a factor",
            got=kinds or dict(value),
            expected=f"one of {', '.join(KINDS)}",
            fix=f"write {EXAMPLE}",
            where=where,
        )
    unit, relative = value.get("unit", ""), value.get("relative", False)
    if not isinstance(unit, str) or not isinstance(relative, bool):
        raise StudyError(
            "wrong type",
            got=dict(value),
            expected='unit = "deg", relative = true or false',
            where=where,
        )
    made = _of_kind(kinds[0], value[kinds[0]], f"{where}.{kinds[0]}")
    numbers = all(
        isinstance(item, int | float) and not isinstance(item, bool)
        for item in made.get("values", ())
    )
    _require(numbers or not unit, value[kinds[0]], f"numbers, as there is a unit {unit!r}", where)
    return Factor(name=name, unit=unit, relative=relative, **made)


def _of_kind(kind: str, given: Any, where: str) -> dict[str, Any]:
    if kind == VALUES:
        return {"kind": VALUES, "values": _values(given, where)}
    if kind in SPACED:
        low, high, count = _numbers(given, 3, where)
        space = np.linspace if kind == "linspace" else np.geomspace
        _require(
            count == int(count) and 1 <= count <= MAX_VALUES,
            given,
            f"a whole number of 1 to {MAX_VALUES} values",
            where,
        )
        _require(kind == "linspace" or (low > 0.0 and high > 0.0), given, "ends > 0", where)
        _require(low != high or count == 1, given, "different ends", where)
        _require(
            _spans(low, high, kind == "logspace"), given, "ends that are not so far apart", where
        )
        return {"kind": VALUES, "values": tuple(space(low, high, int(count)).tolist())}
    low, high = _numbers(given, 2, where)
    _require(kind != NORMAL or high >= 0.0, given, "a standard deviation >= 0", where)
    _require(kind == NORMAL or low <= high, given, "the lower end first", where)
    _require(kind != LOGUNIFORM or low > 0.0, given, "ends > 0", where)
    _require(
        kind != INTEGERS or (low == int(low) and high == int(high)), given, "whole numbers", where
    )
    _require(
        kind != INTEGERS or max(-low, high) <= LARGEST_INTEGER,
        given,
        "whole numbers within 53 bits",
        where,
    )
    _require(_spans(low, high, kind == LOGUNIFORM), given, "ends that are not so far apart", where)
    return {"kind": kind, "low": low, "high": high}


def _spans(low: float, high: float, ratio: bool) -> bool:
    """Whether what lies between can be counted with."""
    return math.isfinite(high / low if ratio else max(abs(low), abs(high)) * 10.0)


def _values(given: Any, where: str) -> tuple[Value, ...]:
    fix = "write values = [0.3, 0.6]"
    if (
        not isinstance(given, list)
        or not given
        or not all(isinstance(item, int | float | bool | str) for item in given)
    ):
        raise StudyError(
            "not values",
            got=given,
            expected="a list of numbers, names or truths",
            fix=fix,
            where=where,
        )
    kinds = {bool: "truths", str: "texts"}
    _require(
        len({kinds.get(type(item), "numbers") for item in given}) == 1,
        given,
        "values of one kind: numbers, texts or truths",
        where,
    )
    _require(len(given) <= MAX_VALUES, f"{len(given)} values", f"at most {MAX_VALUES}", where)
    return tuple(given)


def _numbers(given: Any, count: int, where: str) -> list[float]:
    whole = isinstance(given, list) and len(given) == count
    if not whole or not all(
        isinstance(item, int | float) and not isinstance(item, bool) and math.isfinite(item)
        for item in given
    ):
        raise StudyError(
            "not a distribution",
            got=given,
            expected=f"{count} finite numbers",
            fix=f"write {EXAMPLE}",
            where=where,
        )
    return [float(item) for item in given]


def _require(holds: bool, got: Any, expected: str, where: str) -> None:
    if not holds:
        raise StudyError(
            "value not allowed", got=got, expected=expected, fix="correct it", where=where
        )


def at_quantile(factor: Factor, share: float) -> Value:
    """The value below which a share, 0 to 1, of the factor's distribution lies; all values of a
    list are equally likely.
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
    """Values that tell whether the factor's name, unit and range are right: all of a list, the ends
    of a distribution.

    A normal one has no ends: a deviation from the mean either way stands for them, and what is
    drawn further out is judged when it is run.
    """
    if factor.kind == VALUES:
        return factor.values
    if factor.kind == INTEGERS:
        return int(factor.low), int(factor.high)
    if factor.kind == NORMAL:
        return factor.low, factor.low - factor.high, factor.low + factor.high
    return factor.low, factor.high
