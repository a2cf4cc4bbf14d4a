"""Names in interface.toml: patterns with axes, for all that share a form."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable, Mapping
from typing import Any


def expand(
    entry: Mapping[str, Any], axes: Mapping[str, list[str]]
) -> Iterable[tuple[Mapping[str, Any], dict[str, tuple[int, str]]]]:
    """An entry with each combination of its axes: axis -> (index from 0, label)."""
    used = own_axes(entry, axes)
    for combination in itertools.product(*map(enumerate, used.values())):
        yield entry, dict(zip(used, combination, strict=True))


def own_axes(entry: Mapping[str, Any], axes: Mapping[str, list[str]]) -> dict[str, list[str]]:
    """The labels of the axes in an entry's name, in its order."""
    labels = dict(axes) | {"i": [str(i + 1) for i in range(entry.get("size", 0))]}
    return {
        axis or "i": labels[axis or "i"] for axis in re.findall(r"\{(\w+)\}|\[i\]", entry["name"])
    }


def labelled(pattern: str, labels: Mapping[str, str]) -> str:
    """A pattern's name with these labels for its axes."""
    return pattern.replace("[i]", f"[{labels.get('i')}]").format(**labels)


def expand_names(
    patterns: Iterable[str] | None, labels: Mapping[str, str], table: Mapping[str, Any]
) -> tuple[str, ...] | None:
    """Names by patterns: @ begins a group, {axis} is one's own label, * every leg, joint or
    index (of three, or of a quaternion's four).
    """
    if patterns is None:
        return None
    found: list[str] = []
    for pattern in patterns:
        group = table["group"][pattern[1:]] if pattern.startswith("@") else None
        found += (
            _every(labelled(pattern, labels), table["axis"])
            if group is None
            else expand_names(group, labels, table) or ()
        )
    return tuple(found)


def _every(pattern: str, axes: Mapping[str, list[str]]) -> list[str]:
    """A name for every label of its stars: a leg at the beginning, a joint inside, an index in
    brackets (a quaternion has four).
    """
    indices = [f"[{i + 1}]" for i in range(4 if "quaternion" in pattern else 3)]
    joints, legs = ([f".{joint}." for joint in axes["joint"]], [f"{leg}." for leg in axes["leg"]])
    names = [pattern]
    for star, labels in (("[*]", indices), (".*.", joints), ("*.", legs)):
        names = [
            name.replace(star, label, 1)
            for name in names
            for label in (labels if star in name else [star])
        ]
    return names
