"""Reads single values and records of a scenario; every reader raises ScenarioError.

`duration = 10` is in SI units; `macro_step = "5 ms"` names its unit, which is checked. `where`
names the key in messages.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from hexapod_cosim.models import RobotError, ScenarioError
from hexapod_cosim.models.schema import (
    Number,
    Spec,
    Vector,
    expect_table,
    read_given,
    require,
    specs,
)

# SI unit of a key -> units that may be written for it, each with its size in the SI unit
SCALES: dict[str, dict[str, float]] = {
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0},
    "m": {"m": 1.0, "mm": 1e-3, "cm": 1e-2},
    "m/s": {"m/s": 1.0, "mm/s": 1e-3, "cm/s": 1e-2, "km/h": 1.0 / 3.6},
    "rad": {"rad": 1.0, "deg": math.pi / 180.0},
    "rad/s": {"rad/s": 1.0, "deg/s": math.pi / 180.0, "rpm": math.pi / 30.0},
    "N": {"N": 1.0, "mN": 1e-3, "kN": 1e3},
    "N m": {"N m": 1.0, "mN m": 1e-3},
    "kg": {"kg": 1.0, "g": 1e-3},
    "Pa": {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9},
    "s/m": {"s/m": 1.0, "s/mm": 1e3},
}
QUANTITY = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(\S.*?)?\s*")


@contextmanager
def errors_of(file: str) -> Iterator[None]:
    """Adds the file's name to errors of the shared readers, and makes them ScenarioErrors."""
    try:
        yield
    except (RobotError, ScenarioError) as error:
        key = (error.where or "").removeprefix(".")  # keys in no section begin with a dot
        where = f"{file}: {key}" if key else file
        raise ScenarioError(
            error.what, got=error.got, expected=error.expected, fix=error.fix, where=where
        ) from error


def read_given_keys(record: type[Any], table: Any, where: str) -> dict[str, Any]:
    """Reads the keys that a table gives of a record, with quantities converted to SI."""
    known = specs(record)
    values = {
        key: to_si(value, known[key], f"{where}.{key}") if key in known else value
        for key, value in expect_table(table, where).items()
    }
    return read_given(record, values, where)


def read_record(record: type[Any], table: Any, where: str) -> Any:
    """Returns the record of a table; keys that the table does not give have their defaults."""
    return record(**require(record, read_given_keys(record, table, where), where))


def read_boolean(value: Any, where: str) -> bool:
    """Returns a value that is true or false."""
    if not isinstance(value, bool):
        raise ScenarioError("wrong type", got=value, expected="true or false", where=where)
    return value


def read_text(table: Mapping[str, Any], key: str, default: str) -> str:
    """Returns the text of a key, or the default where the table does not give it."""
    value = table.get(key, default)
    if not isinstance(value, str):
        raise ScenarioError("wrong type", got=value, expected="a text in quotes", where=key)
    return value


def read_list(value: Any, key: str) -> Sequence[Any]:
    """Returns the entries [[key]]."""
    if not isinstance(value, list | tuple):
        fix = f"write [[{key}]] with two brackets"
        raise ScenarioError(
            "wrong type", got=value, expected=f"entries [[{key}]]", fix=fix, where=key
        )
    return value


def read_seed(value: Any) -> int:
    """Returns a seed: a whole number, at least 0."""
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise ScenarioError(
            "value not allowed", got=value, expected="a whole number >= 0", where="seed"
        )
    return value


def to_si(value: Any, spec: Spec, where: str) -> Any:
    """Converts a quantity in a string, such as "5 ms", to SI; returns any other value unchanged.

    Raises ScenarioError for a wrong unit. `where` names the key in messages.
    """
    if isinstance(spec, Vector) and isinstance(value, list | tuple):
        return [to_si(item, Number(spec.unit), f"{where}[{k}]") for k, item in enumerate(value)]
    if not isinstance(spec, Number | Vector) or not isinstance(value, str):
        return value
    match = QUANTITY.fullmatch(value)
    if match is None:
        return value
    scales = SCALES.get(spec.unit, {spec.unit: 1.0})
    unit = " ".join(
        (match[2] or "").replace("*", " ").replace("N.m", "N m").replace("Nm", "N m").split()
    )
    if unit not in scales:
        raise ScenarioError(
            "wrong unit" if unit else "number without unit in quotes",
            got=value,
            expected=_with_units(scales),
            fix=f"a plain number, without quotes, is in {spec.unit}"
            if spec.unit != "1"
            else "write a plain number, without quotes",
            where=where,
        )
    return float(match[1]) * scales[unit]


def _with_units(units: Iterable[str]) -> str:
    """Returns the words for a value in one of these units; 1 is the unit of ratios."""
    words = " or ".join(units)
    return "a number without a unit" if words == "1" else f"a value in {words}"
