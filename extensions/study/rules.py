"""Rules for the values of a study file: each reads a value or raises StudyError.

A table of a file is read by a table of rules, from keys to a rule and a default. A rule is called
with None for a missing key without a default, and refuses it as missing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

from hexapod_cosim.extensions.study.records import StudyError
from hexapod_cosim.models import unknown_name

Rule = Callable[[Any, str], Any]  # from a value and its place to what it means
Rules = Mapping[str, tuple[Rule, Any]]

LARGEST = 2**63 - 1  # integer of TOML and of a column
MAX_LENGTH = 1000  # characters of a text


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


def place_of(where: str, key: str) -> str:
    """Returns the place of a key in a table at a place, as in "study.toml: optimise.metric"."""
    return f"{where}{'.' if ': ' in where else ': '}{key}"


def read_table(value: Any, rules: Rules, where: str) -> dict[str, Any]:
    """Returns the values of a table by its rules, with their defaults."""
    table(value, where)
    require_known(value, rules, where, "key")
    return {
        key: rule(value.get(key, default), place_of(where, key))
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


def _different_texts(value: Any) -> bool:
    listed = isinstance(value, list) and all(isinstance(item, str) for item in value)
    return listed and 0 < len(value) == len(set(value))


text = simple(lambda value: isinstance(value, str), "a text in quotes")
boolean = simple(lambda value: isinstance(value, bool), "true or false", "leave the quotes out")
table = simple(lambda value: isinstance(value, Mapping), "a table", "write it as [section]")


def texts(example: str) -> Rule:
    """Returns the rule of a list of one or more different texts."""
    return simple(_different_texts, "a list of different texts", f"write {example}")


def whole(least: int, most: int) -> Rule:
    """Returns the rule of a whole number within bounds."""
    return simple(
        lambda value: is_number(value) and isinstance(value, int) and least <= value <= most,
        f"a whole number >= {least} and <= {most}",
    )


def names(known: Sequence[str]) -> Rule:
    """Returns the rule of one name, or of a list of different ones, among `known`."""

    def read(value: Any, where: str) -> tuple[str, ...]:
        listed = [value] if isinstance(value, str) else value
        texts(f"some of {', '.join(known)}")(listed, where)
        require_known(listed, known, where, "name")
        return tuple(listed)

    return read


def optional(rule: Rule) -> Rule:
    """Returns the rule of a key that may be missing."""
    return lambda value, where: None if value is None else rule(value, where)


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


def check_plain(value: Any, where: str) -> None:
    """Checks that JSON and a column can represent a value and all values in it."""
    if isinstance(value, Mapping):
        for key, item in value.items():
            check_plain(item, place_of(where, key))
    elif isinstance(value, list):
        for number, item in enumerate(value):
            check_plain(item, f"{where}[{number}]")
    elif isinstance(value, int):
        require(abs(value) <= LARGEST, value, "a whole number within 64 bits", where)
    elif isinstance(value, float):
        require(math.isfinite(value), value, "a finite number", where)
    else:
        plain = isinstance(value, str) and len(value) <= MAX_LENGTH and value.isprintable()
        expected = f"a number, true, false or a printable text of at most {MAX_LENGTH} characters"
        require(plain, value, expected, where, what="value not allowed")


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


def require_once(name: str, again: bool, where: str) -> None:
    """Checks that a name is not there already."""
    require(not again, name, "each name once", where, what="given twice", fix="take one away")
