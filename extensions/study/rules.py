"""Rules for the values of a study file: each reads a value or raises StudyError.

A table of a file is read by a table of rules, from keys to a rule and a default. A rule is called
with None for a missing key that is REQUIRED, and refuses it as missing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

from hexapod_cosim.extensions.study.records import StudyError
from hexapod_cosim.models import unknown_name

Rule = Callable[[Any, str], Any]  # from a value and its place to what it means
Rules = Mapping[str, tuple[Rule, Any]]

REQUIRED = object()  # in place of a default
LARGEST = 2**63 - 1  # integer of a column
PARAMETERS = "parameters."  # an optional prefix of names


def require(
    holds: bool,
    got: Any,
    expected: str,
    where: str,
    *,
    what: str = "",
    fix: str = "correct it",
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
    table(value, where)
    require_known(value, rules, where, "key")
    before = f"{where}." if ": " in where else f"{where}: "
    return {
        key: rule(value.get(key), before + key) if key in value or default is REQUIRED else default
        for key, (rule, default) in rules.items()
    }


def simple(holds: Callable[[Any], bool], expected: str, fix: str = "correct it") -> Rule:
    """Returns the rule of a value that is taken as it is when a condition holds."""

    def read(value: Any, where: str) -> Any:
        require(holds(value), value, expected, where, fix=fix)
        return value

    return read


def is_number(value: Any) -> bool:
    """Returns whether a value is a finite number."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


text = simple(lambda value: isinstance(value, str), "a text in quotes")
boolean = simple(lambda value: isinstance(value, bool), "true or false", "leave the quotes out")
table = simple(lambda value: isinstance(value, Mapping), "a table", "write it as [section]")


def texts(example: str) -> Rule:
    """Returns the rule of a list of one or more different texts."""
    return simple(
        lambda value: (
            isinstance(value, list)
            and all(isinstance(item, str) for item in value)
            and 0 < len(value) == len(set(value))
        ),
        "a list of different texts",
        f"write {example}",
    )


def whole(least: int, most: int) -> Rule:
    """Returns the rule of a whole number within bounds."""
    return simple(
        lambda value: type(value) is int and least <= value <= most,
        f"a whole number >= {least} and <= {most}",
    )


def name_of(known: Sequence[str]) -> Rule:
    """Returns the rule of one of the names `known`."""

    def read(value: Any, where: str) -> str:
        require(isinstance(value, str), value, f"one of {', '.join(known)}", where)
        require_known([value], known, where, "name")
        return str(value)

    return read


def seeds(most: int) -> Rule:
    """Returns the rule of seeds: their number, { first, count } or a list of them."""

    def read(value: Any, where: str) -> Sequence[int]:
        if isinstance(value, list):
            different = 0 < len(value) == len(set(map(str, value)))
            require(different, value, "different whole numbers", where, fix="write seeds = 10")
            return tuple(whole(0, LARGEST)(item, where) for item in value)
        if not isinstance(value, Mapping):
            return range(whole(1, most)(value, where))
        rules = {"count": (whole(1, most), 1), "first": (whole(0, LARGEST - most), 0)}
        given = read_table(value, rules, where)
        return range(given["first"], given["first"] + given["count"])

    return read


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
