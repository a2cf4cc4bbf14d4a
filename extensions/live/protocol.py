"""Reads the messages that a page sends: JSON objects with a `type`, checked key by key.

    {"type": "drive", "forward": 1, "left": 0, "turn": 0, "speed": 0.5, "height": 0, "stamp": 12.5}
    {"type": "push", "force": [0, 5, 0]}
    {"type": "set", "key": "gait", "value": "ripple"}
    {"type": "do", "action": "record"}
    {"type": "ping", "stamp": 12.5}

A page is not trusted: sizes, types and ranges are checked here, names in `robot.py`.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from hexapod_cosim.models import HexapodError, unknown_name

MOST_BYTES = 4096  # of a message
LONGEST_TEXT = 200  # characters of a value
ACTIONS = ("place", "pause", "resume", "record", "stop", "replay")
KEYS = ("control", "gait", "friction", "ground")  # of `set`
AXES = ("forward", "left", "turn", "height")  # of `drive`, from -1 to 1


class MessageError(HexapodError):
    """A page sent something that is no message."""


@dataclass(frozen=True)
class Drive:
    """What the driver asks for, as shares of the largest command; `stamp` is echoed [ms]."""

    forward: float = 0.0  # -1 to 1
    left: float = 0.0
    turn: float = 0.0
    height: float = 0.0
    speed: float = 1.0  # 0 to 1, factor of the three above
    stamp: float = 0.0

    @property
    def moves(self) -> bool:
        """Whether the robot is asked to walk or turn."""
        return (self.forward, self.left, self.turn) != (0.0, 0.0, 0.0) and self.speed > 0.0


@dataclass(frozen=True)
class Push:
    """A force on the torso, world axes [N]."""

    force: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Change:
    """A new value of a setting of the walk."""

    key: str  # one of KEYS
    value: str | float


@dataclass(frozen=True)
class Action:
    """A button: one of ACTIONS."""

    name: str


@dataclass(frozen=True)
class Ping:
    """A request for an echo of the stamp [ms] by the loop."""

    stamp: float


Message = Drive | Push | Change | Action | Ping


def read_message(text: str | bytes) -> Message:
    """Returns the message in a text. Raises MessageError."""
    if len(text) > MOST_BYTES:
        raise MessageError(
            "too long a message", got=f"{len(text)} bytes", expected=f"at most {MOST_BYTES}"
        )
    try:
        table = json.loads(text, parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as error:
        raise MessageError("not a message", got=str(error)[:80], expected="JSON") from error
    if not isinstance(table, dict):
        raise MessageError("not a message", got=type(table).__name__, expected="a JSON object")
    kind = table.get("type")
    if not isinstance(kind, str) or kind not in READERS:
        raise unknown_name("type of a message", str(kind)[:LONGEST_TEXT], READERS)
    return READERS[kind](table)


def _refuse_constant(name: str) -> float:
    raise ValueError(f"the number {name}")


def _drive(table: dict[str, Any]) -> Drive:
    axes = {name: _number(table, name, -1.0, 1.0, default=0.0) for name in AXES}
    speed = _number(table, "speed", 0.0, 1.0, default=1.0)
    return Drive(**axes, speed=speed, stamp=_stamp(table))


def _push(table: dict[str, Any]) -> Push:
    force = table.get("force")
    if not isinstance(force, list) or len(force) != 3:
        raise MessageError("not a force", got=_short(force), expected="three numbers [N]")
    parts = dict(zip("xyz", force, strict=True))
    x, y, z = (_number(parts, axis, -1e6, 1e6) for axis in "xyz")
    return Push((x, y, z))


def _change(table: dict[str, Any]) -> Change:
    key, value = table.get("key"), table.get("value")
    if not isinstance(key, str) or key not in KEYS:
        raise unknown_name("setting", str(key)[:LONGEST_TEXT], KEYS)
    if key == "friction":
        return Change(key, _number({key: value}, key, 0.0, 10.0))
    if not isinstance(value, str) or len(value) > LONGEST_TEXT:
        raise MessageError(f"not a value of {key}", got=_short(value), expected="a name")
    return Change(key, value)


def _action(table: dict[str, Any]) -> Action:
    name = table.get("action")
    if not isinstance(name, str) or name not in ACTIONS:
        raise unknown_name("action", str(name)[:LONGEST_TEXT], ACTIONS)
    return Action(name)


def _ping(table: dict[str, Any]) -> Ping:
    return Ping(_stamp(table))


def _stamp(table: dict[str, Any]) -> float:
    return _number(table, "stamp", 0.0, 1e15, default=0.0)


def _number(
    table: dict[str, Any], key: str, low: float, high: float, *, default: float | None = None
) -> float:
    """Returns a finite number of a table within [low, high]. Raises MessageError."""
    value = table.get(key, default)
    if isinstance(value, int | float) and not isinstance(value, bool) and low <= value <= high:
        return float(value)
    expected = f"a number from {low:g} to {high:g}"
    raise MessageError(f"not a value of {key}", got=_short(value), expected=expected)


def _short(value: Any) -> str:
    return repr(value)[:80]


READERS: dict[str, Callable[[dict[str, Any]], Message]] = {
    "drive": _drive,
    "push": _push,
    "set": _change,
    "do": _action,
    "ping": _ping,
}
