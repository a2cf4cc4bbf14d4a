"""What a page may send: every message is checked, and what is none is refused in a sentence."""

from __future__ import annotations

import json
from contextlib import suppress
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hexapod_cosim.extensions.live.protocol import (
    Action,
    Change,
    Drive,
    Ping,
    Push,
    read_message,
)
from hexapod_cosim.models import HexapodError


def read(**table: Any) -> Any:
    return read_message(json.dumps(table))


def test_each_kind_of_message_is_read() -> None:
    drive = read(type="drive", forward=1, left=-0.5, turn=0.25, speed=0.5, height=-1, stamp=7.5)
    assert drive == Drive(1.0, -0.5, 0.25, -1.0, 0.5, 7.5)
    assert read(type="push", force=[1, -2.5, 0]) == Push((1.0, -2.5, 0.0))
    assert read(type="set", key="gait", value="wave") == Change("gait", "wave")
    assert read(type="set", key="friction", value=1) == Change("friction", 1.0)
    assert read(type="do", action="record") == Action("record")
    assert read(type="ping", stamp=3) == Ping(3.0)


def test_a_drive_moves_when_an_axis_and_the_speed_are_not_zero() -> None:
    assert read(type="drive", turn=0.1).moves
    assert not read(type="drive", height=1).moves
    assert not read(type="drive", forward=1, speed=0).moves


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("", "not a message"),
        ("[]", "expected a JSON object"),
        ("{", "expected JSON"),
        ('{"type": "drive", "forward": NaN}', "the number NaN"),
        ('{"type": "drive", "forward": 1e999}', "expected a number from -1 to 1"),
        ('{"type": "drive", "forward": 1.5}', "got '1.5'"),
        ('{"type": "drive", "forward": true}', "not a value of forward"),
        ('{"type": "drive", "speed": -0.1}', "expected a number from 0 to 1"),
        ('{"type": "push", "force": [1, 2]}', "expected three numbers"),
        ('{"type": "push", "force": [1, 2, "3"]}', "not a value of z"),
        ('{"type": "set", "key": "gravity", "value": 0}', "unknown setting"),
        ('{"type": "set", "key": "friction", "value": "slippery"}', "not a value of friction"),
        ('{"type": "set", "key": "gait", "value": 3}', "not a value of gait"),
        ('{"type": "do", "action": "recrod"}', "did you mean 'record'?"),
        ('{"type": 3}', "unknown type of a message"),
        ("[" * 5000, "too long a message"),
        ("[" * 4000, "not a message"),
    ],
)
def test_what_is_no_message_is_refused_with_what_was_got_and_expected(text: str, part: str) -> None:
    with pytest.raises(HexapodError) as caught:
        read_message(text)
    assert part in str(caught.value)
    assert len(str(caught.value)) < 500


@settings(max_examples=60, deadline=None)
@given(st.one_of(st.text(), st.binary(), st.recursive(st.none() | st.floats(), st.lists).map(str)))
def test_any_text_is_read_or_refused(text: str | bytes) -> None:
    with suppress(HexapodError):  # no other exception
        assert read_message(text) is not None


@settings(max_examples=60, deadline=None)
@given(
    st.dictionaries(
        st.sampled_from(["type", "forward", "force", "key", "value", "action", "stamp"]),
        st.one_of(
            st.sampled_from(["drive", "push", "set", "do", "ping", "gait"]),
            st.floats(),
            st.lists(st.floats(), max_size=4),
            st.none(),
        ),
    )
)
def test_any_table_is_read_or_refused(table: dict[str, Any]) -> None:
    with suppress(HexapodError):  # no other exception
        assert read_message(json.dumps(table)) is not None
