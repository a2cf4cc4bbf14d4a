"""Messages of a page: what is read, and that all else is refused."""

from __future__ import annotations

from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hexapod_cosim.extensions.live.messages import (
    Action,
    Change,
    Drive,
    MessageError,
    Push,
    read_message,
)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"type": "drive", "forward": 1, "speed": 0.5}', Drive(forward=1, speed=0.5)),
        ('{"type": "push", "y": -5.5}', Push(y=-5.5)),
        ('{"type": "set", "key": "gait", "value": "wave"}', Change("gait", "wave")),
        ('{"type": "set", "key": "friction", "value": 0.4}', Change("friction", 0.4)),
        (b'{"type": "do", "action": "record"}', Action("record")),
    ],
)
def test_each_kind_of_message_is_read(text: str | bytes, message: object) -> None:
    assert read_message(text) == message


@pytest.mark.parametrize(
    "text",
    [
        "nonsense",
        b"\xff\x00",
        "[1]",
        "{}",
        '{"type": "fly"}',
        '{"type": ["drive"]}',
        '{"type": "drive", "forward": 1.5}',
        '{"type": "drive", "forward": true}',
        '{"type": "drive", "forward": NaN}',
        '{"type": "drive", "speed": -0.1}',
        '{"type": "drive", "jump": 1}',
        '{"type": "push", "x": "5"}',
        '{"type": "push", "x": 1e300}',
        '{"type": "set", "key": "mass", "value": "1"}',
        '{"type": "set", "key": "gait", "value": 1}',
        '{"type": "set", "key": "friction", "value": -1}',
        '{"type": "do", "action": "jump"}',
        "[" * 4000,
    ],
)
def test_what_is_no_message_is_refused(text: str | bytes) -> None:
    with pytest.raises(MessageError, match=r"not a message of the page: got .* expected JSON"):
        read_message(text)


@given(st.text() | st.binary())
def test_any_text_is_read_or_refused(text: str | bytes) -> None:
    with suppress(MessageError):
        read_message(text)
