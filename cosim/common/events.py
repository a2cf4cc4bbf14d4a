"""Event sinks: functions that take messages about what a program waits for or corrects by
itself.
"""

from __future__ import annotations

from collections.abc import Callable

EventSink = Callable[[str], None]


def ignore_event(_text: str) -> None:
    """An event sink that ignores every message."""
