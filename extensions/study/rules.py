"""Rules for the values of a study file: each reads a value or raises HexapodError.

A table of a file is read by a table of rules, from keys to a rule and a default, or REQUIRED. A
rule is a function, such as the `read` of models/schema.py's types.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

from hexapod_cosim.extensions.study.records import StudyError
from hexapod_cosim.models import unknown_name
from hexapod_cosim.models.schema import Texts, Whole, expect_table

Rule = Callable[[Any, str], Any]  # from a value and its place to what it means
Rules = Mapping[str, tuple[Rule, Any]]

REQUIRED = object()  # in place of a default
LARGEST = 2**63 - 1  # integer of a column
PARAMETERS = "parameters."  # an optional prefix of names


def require(
    holds: bool, got: Any, expected: str, where: str, *, what: str = "", fix: str = "correct it"
) -> None:
    """Raises StudyError unless a condition holds; see HexapodError for the texts."""
    if not holds:
        what = what or ("missing key" if got is None else "value not allowed")
        raise StudyError(what, got=got, expected=expected, fix=fix, where=where)


def require_known(names: Iterable[str], known: Iterable[str], where: str, kind: str) -> None:
    """Checks that all names are known ones of a kind."""
    for name in names:
        if name not in known:
            raise unknown_name(kind, name, list(known), where=where, error=StudyError)


def read_table(value: Any, rules: Rules, where: str) -> dict[str, Any]:
    """Returns the values of a table by its rules, with their defaults.

    `where`: the file, or the file and the key of the table.
    """
    require_known(expect_table(value, where), rules, where, "key")
    before, found = f"{where}." if ": " in where else f"{where}: ", {}
    for key, (rule, default) in rules.items():
        place, what = before + key, "missing key"
        given = key in value or default is not REQUIRED
        require(given, None, "a value", place, what=what, fix=f"add `{key} = ...`")
        found[key] = rule(value[key], place) if key in value else default
    return found


def is_number(value: Any) -> bool:
    """Returns whether a value is a finite number."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def number(value: Any, where: str) -> float:
    """Returns a finite number."""
    require(is_number(value), value, "a finite number", where)
    return float(value)


def texts(value: Any, where: str) -> tuple[str, ...]:
    """Returns the texts of a list: one or more, all different."""
    found = Texts().read(value, where)
    require(0 < len(found) == len(set(found)), value, "a list of different texts", where)
    return found


def count(value: Any, where: str) -> int:
    """Returns a whole number from 1."""
    require(Whole().read(value, where) >= 1, value, "a whole number >= 1", where)
    return int(value)


def seeds(value: Any, where: str) -> Sequence[int]:
    """Returns seeds from their number, { first, count } or a list of them."""
    if isinstance(value, list):
        different = 0 < len(value) == len(set(map(str, value)))
        require(different, value, "different whole numbers", where, fix="write seeds = 10")
        return tuple(Whole().read(item, where) for item in value)
    table = value if isinstance(value, Mapping) else {"count": value}
    given = read_table(table, {"count": (count, 1), "first": (Whole().read, 0)}, where)
    found = range(given["first"], given["first"] + given["count"])
    require(found[-1] <= LARGEST, value, "whole numbers within 64 bits", where)
    return found


def _is_table(_key: str, value: Any) -> bool:
    return isinstance(value, Mapping)


def leaves(
    nested: Mapping[str, Any], before: str = "", is_section: Callable[[str, Any], bool] = _is_table
) -> Iterator[tuple[str, Any]]:
    """Yields the values of nested tables by their names with dots."""
    for key, value in nested.items():
        if is_section(key, value):
            yield from leaves(value, f"{before}{key}.", is_section)
        else:
            yield f"{before}{key}", value


def named_once(nested: Any, where: str, is_section: Callable[[str, Any], bool] = _is_table) -> Any:
    """Yields name, value and place of the leaves of a table, without "parameters." in the names.

    Raises StudyError for a name that is given twice; columns of SQL ignore the case of letters.
    """
    found: set[str] = set()
    for full, value in leaves(nested, is_section=is_section):
        name, place = full.removeprefix(PARAMETERS), f"{where}.{full}"
        once = name.lower() not in found
        require(once, name, "each name once", place, what="given twice", fix="take one away")
        found.add(name.lower())
        yield name, value, place
