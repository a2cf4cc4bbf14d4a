"""Reads the messages that a page sends: JSON objects with a `type`.

    {"type": "drive", "forward": 1, "left": 0, "turn": 0, "speed": 0.5, "height": 0}
    {"type": "push", "x": 0, "y": 5, "z": 0}
    {"type": "set", "key": "gait", "value": "ripple"}
    {"type": "do", "action": "record"}
    {"type": "leg", "leg": 0}

A page is not trusted: types and ranges are checked here, names in `settings.py`.
"""

from __future__ import annotations

import json
from dataclasses import dataclass

from hexapod_cosim.models import LEG_NAMES, HexapodError

ACTIONS = ("place", "pause", "resume", "record", "stop")
KEYS = ("control", "gait", "friction", "ground")  # of `set`
MOST_FRICTION = 10.0
MOST_FORCE = 1e6  # N


class MessageError(HexapodError):
    """A page sent something that is no message."""


@dataclass(frozen=True)
class Drive:
    """What the driver asks for, as shares of the largest command."""

    forward: float = 0.0  # -1 to 1
    left: float = 0.0
    turn: float = 0.0
    height: float = 0.0
    speed: float = 1.0  # 0 to 1, factor of the first three

    def __post_init__(self) -> None:
        """Raises ValueError for a share that is out of range."""
        for share in (self.forward, self.left, self.turn, self.height):
            _check(share, -1.0, 1.0)
        _check(self.speed, 0.0, 1.0)


@dataclass(frozen=True)
class Push:
    """A force on the torso, world axes [N]."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0

    def __post_init__(self) -> None:
        """Raises ValueError for a force that is out of range."""
        for part in (self.x, self.y, self.z):
            _check(part, -MOST_FORCE, MOST_FORCE)


@dataclass(frozen=True)
class Change:
    """A new value of a setting of the walk."""

    key: str  # one of KEYS
    value: str | float

    def __post_init__(self) -> None:
        """Raises ValueError for an unknown key or a value of another type."""
        if self.key == "friction":
            _check(self.value, 0.0, MOST_FRICTION)
        elif self.key not in KEYS or not isinstance(self.value, str):
            raise ValueError(self.key)


@dataclass(frozen=True)
class Action:
    """A button of the page: one of ACTIONS."""

    action: str

    def __post_init__(self) -> None:
        """Raises ValueError for an unknown action."""
        if self.action not in ACTIONS:
            raise ValueError(self.action)


@dataclass(frozen=True)
class Leg:
    """A click on a leg (index in LEG_NAMES): it goes limp, or works again."""

    leg: int

    def __post_init__(self) -> None:
        """Raises ValueError for what is no leg."""
        if isinstance(self.leg, bool) or self.leg not in range(len(LEG_NAMES)):
            raise ValueError(self.leg)


Message = Drive | Push | Change | Action | Leg
KINDS: dict[str, type[Message]] = {
    "drive": Drive,
    "push": Push,
    "set": Change,
    "do": Action,
    "leg": Leg,
}


def read_message(text: str | bytes) -> Message:
    """Returns the message in a text. Raises MessageError."""
    try:
        table = json.loads(text)
        return KINDS[table.pop("type")](**table)
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise MessageError(
            "not a message of the page",
            got=f"{text[:80]!r}",
            expected=f"JSON with a type of {', '.join(KINDS)} and its values",
        ) from error


def _check(value: object, low: float, high: float) -> None:
    """Raises ValueError unless a value is a number from low to high; NaN is none."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        raise ValueError(value)
