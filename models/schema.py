"""Reads typed records from TOML tables and checks them by the annotations of their fields.

Example of a field: `mass: Annotated[float, Number("kg", above=0.0)]`. A value is a number in SI
units or a quantity with its unit ("5 ms").
"""

from __future__ import annotations

import math
import re
from collections.abc import Hashable, Iterable, Mapping
from dataclasses import MISSING, dataclass, fields
from functools import cache
from numbers import Integral, Real
from typing import Any, cast, get_type_hints

from hexapod_cosim.models.errors import RobotError, unknown_name
from hexapod_cosim.models.files import LARGEST

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


@dataclass(frozen=True)
class Number:
    """A finite number with a unit and a range."""

    unit: str
    above: float = -math.inf  # exclusive
    below: float = math.inf  # exclusive
    at_least: float = -math.inf
    at_most: float = math.inf

    @property
    def expected(self) -> str:
        """The range in words, "a finite number" without one."""
        bounds = [(self.above, ">"), (self.at_least, ">="), (self.below, "<"), (self.at_most, "<=")]
        parts = [f"{sign} {bound:g}" for bound, sign in bounds if math.isfinite(bound)]
        text = "a finite number" + (" " + " and ".join(parts) if parts else "")
        return f"{text} [{self.unit}]"

    def holds(self, value: float) -> bool:
        """Returns whether the value is finite and within the range."""
        return (
            math.isfinite(value)
            and self.above < value < self.below
            and self.at_least <= value <= self.at_most
        )

    def read(self, value: Any, where: str) -> float:
        """Returns the value as a float. Raises RobotError; `where` names the key."""
        value = _in_si(value, self.unit, where)
        if isinstance(value, bool) or not isinstance(value, Real):  # NumPy's as well
            raise wrong_type(value, self.expected, "give a number", where)
        if not self.holds(float(value)):
            fix = "correct the value and its unit"
            raise RobotError(
                "value not allowed", got=value, expected=self.expected, fix=fix, where=where
            )
        return float(value)


@dataclass(frozen=True)
class Vector:
    """A fixed count of finite numbers with a common unit."""

    unit: str
    size: int
    above: float = -math.inf  # each entry, exclusive

    @property
    def expected(self) -> str:
        """The count of numbers and their unit, in words."""
        return f"{self.size} numbers [{self.unit}]"

    def read(self, value: Any, where: str) -> tuple[float, ...]:
        """Returns the values as a tuple. Raises RobotError; `where` names the key."""
        if not isinstance(value, list | tuple):
            raise wrong_type(value, self.expected, "give a list of numbers", where)
        if len(value) != self.size:
            fix = f"give exactly {self.size} entries"
            raise RobotError(
                "wrong length", got=value, expected=self.expected, fix=fix, where=where
            )
        entry = Number(self.unit, above=self.above)
        return tuple(entry.read(item, f"{where}[{k}]") for k, item in enumerate(value))


@dataclass(frozen=True)
class Choice:
    """A name from a closed list."""

    names: tuple[str, ...]

    @property
    def expected(self) -> str:
        """The names."""
        return f"one of {', '.join(self.names)}"

    def read(self, value: Any, where: str) -> str:
        """Returns the name. Raises RobotError; `where` names the key."""
        if not isinstance(value, str):
            raise wrong_type(value, self.expected, "give a name in quotes", where)
        if value not in self.names:
            raise unknown_name("name", value, self.names, where=where, error=RobotError)
        return value


@dataclass(frozen=True)
class Text:
    """A text that is not empty."""

    expected = "a text"

    def read(self, value: Any, where: str) -> str:
        """Returns the text. Raises RobotError; `where` names the key."""
        if not isinstance(value, str) or not value:
            raise wrong_type(value, self.expected, "give it in quotes", where)
        return value


@dataclass(frozen=True)
class Texts:
    """A list of texts, or of some of the `names`, which then come in their order."""

    names: tuple[str, ...] = ()

    @property
    def expected(self) -> str:
        """The names, if they are limited."""
        return f"a list of some of {', '.join(self.names)}" if self.names else "a list of texts"

    def read(self, value: Any, where: str) -> tuple[str, ...]:
        """Returns the texts. Raises RobotError; `where` names the key."""
        given = list(value) if isinstance(value, list | tuple) else [value]
        known = all(isinstance(one, str) and one in (self.names or (one,)) for one in given)
        if not isinstance(value, list | tuple) or not known or (self.names and not given):
            fix = f'write ["{self.names[0] if self.names else "text"}"]'
            raise wrong_type(value, self.expected, fix, where)
        return tuple(one for one in self.names if one in given) if self.names else tuple(given)


@dataclass(frozen=True)
class Flag:
    """A Boolean."""

    expected = "true or false"

    def read(self, value: Any, where: str) -> bool:
        """Returns the value. Raises RobotError; `where` names the key."""
        if not isinstance(value, bool):
            raise wrong_type(value, self.expected, "write true or false", where)
        return value


@dataclass(frozen=True)
class Whole:
    """An integer of at least 0 that TOML can hold."""

    expected = "a whole number from 0 to 2^63 - 1"

    def read(self, value: Any, where: str) -> int:
        """Returns the value. Raises RobotError; `where` names the key."""
        if isinstance(value, bool) or not isinstance(value, Integral):  # NumPy's as well
            raise wrong_type(value, self.expected, "write 1 or another whole number", where)
        number = int(value)
        if not 0 <= number <= LARGEST:
            what, fix = "out of range", "write 1 or another whole number"
            raise RobotError(what, got=value, expected=self.expected, fix=fix, where=where)
        return number


Spec = Number | Vector | Choice | Text | Texts | Flag | Whole


def _in_si(value: Any, unit: str, where: str) -> Any:
    """Converts a quantity in a string, such as "5 ms", to SI; returns any other value unchanged.

    Raises RobotError for a wrong unit. `where` names the key in messages.
    """
    match = QUANTITY.fullmatch(value) if isinstance(value, str) else None
    if match is None:
        return value
    scales = SCALES.get(unit, {unit: 1.0})
    given = " ".join((match[2] or "").replace("*", " ").replace("N.m", "N m").split())
    given = given.replace("Nm", "N m")
    if given in scales:
        return float(match[1]) * scales[given]
    raise RobotError(
        "wrong unit" if given else "number without unit in quotes",
        got=value,
        expected="a number without a unit" if unit == "1" else f"a value in {' or '.join(scales)}",
        fix=f"write a plain number: {match[1]}"
        if unit == "1"
        else f"a plain number, without quotes, is in {unit}",
        where=where,
    )


def wrong_type(got: Any, expected: str, fix: str, where: str) -> RobotError:
    """Returns the exception for a value of another type."""
    return RobotError("wrong type", got=got, expected=expected, fix=fix, where=where)


def specs(record: type[Any]) -> dict[str, Spec]:
    """Returns the annotated fields of a record class, by name."""
    return _specs(cast(Hashable, record))


@cache
def _specs(record: Any) -> dict[str, Spec]:
    """Reads the annotations of a record class once."""
    hints = get_type_hints(record, include_extras=True)
    return {
        name: spec
        for name, hint in hints.items()
        for spec in getattr(hint, "__metadata__", ())
        if isinstance(spec, Spec)
    }


def expect_table(value: Any, where: str) -> Mapping[str, Any]:
    """Returns the value if it is a TOML table. Raises RobotError otherwise."""
    if not isinstance(value, Mapping):
        raise wrong_type(value, "a table", "write it as [section] with keys below", where)
    return value


def refuse_unknown_keys(table: Mapping[str, Any], valid: Iterable[str], where: str) -> None:
    """Raises RobotError for the first invalid key, with the most similar valid one."""
    for key in table:
        if key not in valid:
            raise unknown_name("key", key, valid, where=where, error=RobotError)


def read_given(
    record: type[Any], table: Any, where: str, *, extra: tuple[str, ...] = ()
) -> dict[str, Any]:
    """Returns the checked fields of the record that the table contains. Raises RobotError.

    extra: valid keys that are not fields of the record.
    """
    known, table = specs(record), expect_table(table, where)
    refuse_unknown_keys(table, [*known, *extra], where)
    return {
        key: known[key].read(value, f"{where}.{key}")
        for key, value in table.items()
        if key in known
    }


def require(record: type[Any], given: dict[str, Any], where: str) -> dict[str, Any]:
    """Returns the given fields of the record.

    Raises RobotError for a missing one without a default.
    """
    known = specs(record)
    for item in fields(record):
        usual = item.default is not MISSING or item.default_factory is not MISSING
        if item.name in known and item.name not in given and not usual:
            raise missing_key(item.name, known[item.name], f"{where}.{item.name}")
    return given


def read_record(record: type[Any], table: Any, where: str) -> Any:
    """Returns the record of a table; keys that the table does not give have their defaults.

    Raises RobotError.
    """
    return record(**require(record, read_given(record, table, where), where))


def missing_key(key: str, spec: Spec, where: str) -> RobotError:
    """Returns the exception for a key without a value."""
    return RobotError("missing key", expected=spec.expected, fix=f"add `{key} = ...`", where=where)


def check_record(record: Any, where: str) -> None:
    """Checks a record that was built in Python by the rules for files. Raises RobotError."""
    for key, spec in specs(type(record)).items():
        spec.read(getattr(record, key), f"{where}.{key}")
