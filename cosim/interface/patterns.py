"""Expands the names in interface.toml, which are patterns with axes such as {leg}.{joint}.angle."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable, Mapping
from typing import Any

from hexapod_cosim.models.errors import unknown_name

AXIS = re.compile(r"\{(\w+)\}|\[i\]")
AXES = re.compile(r"\{\w+\}\.|[._]\{\w+\}|\{\w+\}|\[i\]")
ROOTS = ("gait.", "gains.", "parts.")  # objects besides the robot that parameters are named after


def plain_name(pattern: str) -> str:
    """Returns a pattern's name without its axes."""
    return AXES.sub("", pattern)


def expand(
    entry: Mapping[str, Any], axes: Mapping[str, list[str]]
) -> Iterable[tuple[Mapping[str, Any], dict[str, tuple[int, str]]]]:
    """Yields an entry with each combination of its axes: axis -> (index from 0, label)."""
    used = own_axes(entry, axes)
    for combination in itertools.product(*map(enumerate, used.values())):
        yield entry, dict(zip(used, combination, strict=True))


def with_defaults(
    entry: Mapping[str, Any], causality: str, units: Mapping[str, Any]
) -> dict[str, Any]:
    """Returns an entry of interface.toml with the values that follow from name, causality and unit.

    Parameters are fields of nested structures: {leg}.{joint}.mass is leg[leg].link[joint].mass.
    Others are arrays over their axes: {leg}.foot.force[i] is foot.force[leg][i].
    """
    name = entry["name"]
    defaults: dict[str, Any] = {"size": 3} if "[i]" in name else {}
    if "type" not in entry:
        unit = entry.get("unit", "1")
        if unit not in units:
            raise unknown_name("unit", unit, units, where=f"interface.toml: {name}")
        usual = units[unit].get("nominal", 1.0) if isinstance(units[unit], dict) else 1.0
        defaults |= {"unit": unit, "nominal": usual}
    if causality == "parameter":
        place = re.sub(r"_\{(\w+)\}", r"[\1]", name)
        place = place.replace("{leg}.", "leg[leg].").replace("{joint}.", "link[joint].")
        path = place.replace("leg[leg].", "legs[leg].").replace("link[joint].", "links[joint].")
        own = path.startswith(ROOTS)
        defaults |= {"field": f"definition.{place}", "start": path if own else f"robot.{path}"}
    else:
        axes = "".join(f"[{axis or 'i'}]" for axis in AXIS.findall(name))
        defaults |= {"field": f"{causality}.{plain_name(name)}{axes}"}
    if causality == "input":
        defaults |= {"start": 0.0}
    return defaults | dict(entry)


def own_axes(entry: Mapping[str, Any], axes: Mapping[str, list[str]]) -> dict[str, list[str]]:
    """Returns the labels of the axes in an entry's name, in the order of the name."""
    labels = dict(axes) | {"i": [str(i + 1) for i in range(entry.get("size", 0))]}
    return {axis or "i": labels[axis or "i"] for axis in AXIS.findall(entry["name"])}


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
