"""Checks that start_values.txt, which the binary reads, and modelDescription.xml, which importers
read, state the same values.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

START_VALUES, CHECKSUM = "resources/start_values.txt", "checksum "
SHOWN = 5  # the number of missing values that are listed


def start_value_problems(data: bytes | None, token: str, description: Any) -> Iterator[str]:
    """Yields the problems of start_values.txt, one sentence each.

    Args:
        data: the content of start_values.txt; None if it is missing.
        token: the GUID or instantiation token of modelDescription.xml.
        description: fmpy's model description; arrays have consecutive value references.
    """
    if data is None:
        yield f"{START_VALUES} is missing: the binary takes the robot from it"
        return
    first, *lines = data.decode("utf-8", errors="replace").split("\n")
    if first.strip() != token:
        yield f"{START_VALUES} has GUID {first.strip()!r}, modelDescription.xml {token!r}"
    stated, seen = _stated(description), set()
    for number, line in enumerate(lines, start=2):
        words = line.split()
        if not words or line.startswith(CHECKSUM):  # the binary checks it
            continue
        seen.add(words[0])
        yield from _line_problems(f"{START_VALUES} line {number}", words, stated)
    yield from _missing_problems(
        [
            f"{reference} ({name})"
            for reference, (name, _) in stated.items()
            if str(reference) not in seen
        ]
    )


def _line_problems(
    where: str, words: list[str], stated: dict[int, tuple[str, float]]
) -> Iterator[str]:
    """Yields the problems of one line; stated: name and value by reference."""
    if len(words) < 2 or not words[0].isdecimal() or math.isnan(_number(words[1])):
        yield f"{where}: got {' '.join(words)!r}, expected a value reference and a value"
        return
    reference, value = int(words[0]), _number(words[1])
    if reference not in stated:
        yield f"{where}: value reference {reference} has no start value in modelDescription.xml"
        return
    name, expected = stated[reference]
    if value != expected:
        yield f"{where}: {name} is {value!r}, modelDescription.xml says {expected!r}"


def _missing_problems(missing: list[str]) -> Iterator[str]:
    """Yields the missing values, SHOWN of them by name."""
    for name in missing[:SHOWN]:
        yield f"{START_VALUES} lacks the value reference {name}"
    if len(missing) > SHOWN:
        yield f"{START_VALUES} lacks {len(missing) - SHOWN} more"


def _stated(description: Any) -> dict[int, tuple[str, float]]:
    """Returns names and start values by value references of elements.

    The elements of an array have its reference and those that follow.
    """
    return {
        int(variable.valueReference) + place: (str(variable.name), _number(word))
        for variable in description.modelVariables
        if variable.start is not None
        for place, word in enumerate(str(variable.start).split())
    }


def _number(word: str) -> float:
    """Parses a number or Boolean; NaN for other text."""
    if word in ("true", "false"):
        return float(word == "true")
    try:
        return float.fromhex(word) if "x" in word else float(word)
    except ValueError:
        return math.nan
