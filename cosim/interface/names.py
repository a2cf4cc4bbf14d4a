"""Names of the FMU variables of all legs, joints and feet, in the order of the legs."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable, Mapping
from typing import Any

from hexapod_cosim.models import JOINT_NAMES, LEG_NAMES

LEGS, JOINTS = len(LEG_NAMES), len(JOINT_NAMES)
AXES = (1, 2, 3)


def joint_names(quantity: str) -> list[str]:
    """Returns the names of a quantity of all joints; legs run slowest."""
    return [f"{leg}.{joint}.{quantity}" for leg in LEG_NAMES for joint in JOINT_NAMES]


def foot_names(quantity: str) -> list[str]:
    """Returns the names of a scalar quantity of all feet."""
    return [f"{leg}.foot.{quantity}" for leg in LEG_NAMES]


def vector_names(stem: str, size: int = 3) -> list[str]:
    """Returns the names of a vector's elements."""
    return [f"{stem}[{k}]" for k in range(1, size + 1)]


def foot_vector_names(quantity: str) -> list[str]:
    """Returns the names of a vector quantity of all feet; axes run fastest."""
    return [name for stem in foot_names(quantity) for name in vector_names(stem)]


def expand(
    entry: Mapping[str, Any], axes: Mapping[str, list[str]]
) -> Iterable[tuple[Mapping[str, Any], dict[str, tuple[int, str]]]]:
    """Yields an entry with each combination of its axes: axis -> (index from 0, label)."""
    used = own_axes(entry, axes)
    for combination in itertools.product(*map(enumerate, used.values())):
        yield entry, dict(zip(used, combination, strict=True))


def own_axes(entry: Mapping[str, Any], axes: Mapping[str, list[str]]) -> dict[str, list[str]]:
    """Returns the labels of the axes in an entry's name, in the order of the name."""
    labels = dict(axes) | {"i": [str(i + 1) for i in range(entry.get("size", 0))]}
    return {
        axis or "i": labels[axis or "i"] for axis in re.findall(r"\{(\w+)\}|\[i\]", entry["name"])
    }


def labelled(pattern: str, labels: Mapping[str, str]) -> str:
    """Replaces the axes of a pattern by labels."""
    return pattern.replace("[i]", f"[{labels.get('i')}]").format(**labels)


def expand_names(
    patterns: Iterable[str] | None, labels: Mapping[str, str], table: Mapping[str, Any]
) -> tuple[str, ...] | None:
    """Returns the names that patterns stand for; None for None.

    A pattern @name stands for a group of `table`, {axis} for the label of the variable that the
    patterns belong to, and * for every leg, joint or index (1 to 3, of quaternions 1 to 4).
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
    """Returns the names with every label in the place of each star: a leg at the beginning, a
    joint inside, an index in brackets.
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
