"""The binary takes its robot from start_values.txt, importers see modelDescription.xml: do both
say the same?
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

START_VALUES, CHECKSUM = "resources/start_values.txt", "checksum "
SHOWN = 5  # missing values that are named one by one


def start_value_problems(data: bytes | None, token: str, description: Any) -> Iterator[str]:
    """What is wrong with start_values.txt, one sentence each.

    Args:
        data: its bytes; None without one.
        token: the GUID or instantiation token of modelDescription.xml.
        description: the rest of modelDescription.xml, as fmpy reads it; arrays stand for
            consecutive value references.
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
        if not words or line.startswith(CHECKSUM):  # which the binary checks as it loads
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
    for name in missing[:SHOWN]:
        yield f"{START_VALUES} lacks the value reference {name}"
    if len(missing) > SHOWN:
        yield f"{START_VALUES} lacks {len(missing) - SHOWN} more"


def _stated(description: Any) -> dict[int, tuple[str, float]]:
    """Names and start values by the references of elements: an array's own, and those that
    follow.
    """
    return {
        int(variable.valueReference) + place: (str(variable.name), _number(word))
        for variable in description.modelVariables
        if variable.start is not None
        for place, word in enumerate(str(variable.start).split())
    }


def _number(word: str) -> float:
    """NaN, which equals nothing, for what is no number."""
    if word in ("true", "false"):
        return float(word == "true")
    try:
        return float.fromhex(word) if "x" in word else float(word)
    except ValueError:
        return math.nan
