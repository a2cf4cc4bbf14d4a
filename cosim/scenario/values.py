"""Reads single values and records of a scenario; every reader raises ScenarioError.

`where` names the key in messages.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from hexapod_cosim.cosim.scenario.quantities import to_si
from hexapod_cosim.models import RobotError, ScenarioError
from hexapod_cosim.models.schema import expect_table, read_given, require, specs


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
