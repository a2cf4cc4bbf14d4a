"""Values of a study file's keys, each judged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from hexapod_cosim.cosim.study.records import StudyError
from hexapod_cosim.models import unknown_name


def whole(value: Any, where: str, *, least: int, most: int | None = None) -> int:
    """A whole number within bounds. Raises StudyError."""
    if isinstance(value, bool) or not isinstance(value, int) or value < least or (most is not None and value > most):
        expected = f"a whole number >= {least}" + ("" if most is None else f" and <= {most}")
        raise StudyError("value not allowed", got=value, expected=expected, fix="correct it", where=where)
    return value


def text_of(table: Mapping[str, Any], key: str, default: str, where: str) -> str:
    """A text. Raises StudyError."""
    value = table.get(key, default)
    if not isinstance(value, str):
        raise StudyError("wrong type", got=value, expected="a text in quotes", where=f"{where}: {key}")
    return value


def truth_of(table: Mapping[str, Any], key: str, default: bool, where: str) -> bool:
    """True or false. Raises StudyError."""
    value = table.get(key, default)
    if not isinstance(value, bool):
        raise StudyError("wrong type", got=value, expected="true or false", where=f"{where}: {key}")
    return value


def names_of(value: Any, known: Sequence[str], where: str) -> tuple[str, ...]:
    """Different names of a closed list, one at least. Raises StudyError."""
    if not isinstance(value, list) or not value or len({str(item) for item in value}) != len(value):
        raise StudyError("wrong type", got=value, expected=f"a list of some of {', '.join(known)}", where=where)
    for item in value:
        if item not in known:
            raise unknown_name("name", str(item), known, where=where, error=StudyError)
    return tuple(value)


def read_seeds(value: Any, where: str, *, most: int) -> Sequence[int]:
    """A number of seeds from 0 on, { first, count }, or the seeds themselves. Raises StudyError."""
    if isinstance(value, Mapping):
        for key in value:
            if key not in ("first", "count"):
                raise unknown_name("key", key, ("first", "count"), where=where, error=StudyError)
        first = whole(value.get("first", 0), f"{where}.first", least=0)
        return range(first, first + whole(value.get("count", 1), f"{where}.count", least=1, most=most))
    if isinstance(value, list):
        if not value or len(set(map(str, value))) != len(value):
            raise StudyError("not seeds", got=value, expected="different whole numbers >= 0", fix="write seeds = 10", where=where)
        return tuple(whole(item, where, least=0) for item in value)
    return range(whole(value, where, least=1, most=most))


def flat(table: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    """Values by name with dots, written in quotes or as tables."""
    found: dict[str, Any] = {}
    for key, value in table.items():
        found |= flat(value, f"{before}{key}.") if isinstance(value, Mapping) else {f"{before}{key}": value}
    return found
