"""Event sinks: functions that receive messages about waiting and automatic corrections."""

from __future__ import annotations

from collections.abc import Callable

EventSink = Callable[[str], None]


def ignore_event(_text: str) -> None:
    """Ignores a message: the event sink of callers that show none."""
