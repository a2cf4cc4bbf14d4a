"""Wraps lines to the width of a terminal; files and pipes get them unchanged."""

from __future__ import annotations

import os
import textwrap
from typing import TextIO

USUAL = 80  # characters; where the width is unknown
LEAST = 20
INDENT = "  "  # of the continuation of a wrapped line


def columns_of(stream: TextIO) -> int | None:
    """Returns the width of a stream's terminal, or None if it is none; COLUMNS overrides it."""
    if not stream.isatty():
        return None
    given = os.environ.get("COLUMNS", "")
    if given.isdecimal() and int(given):
        return max(int(given), LEAST)
    try:
        return max(os.get_terminal_size(stream.fileno()).columns, LEAST)
    except (OSError, ValueError):  # no real terminal
        return USUAL


def fitted(text: str, stream: TextIO) -> str:
    """Returns text wrapped for this stream; words, such as paths, stay whole."""
    width = columns_of(stream)
    if width is None:
        return text
    wrapped = (
        textwrap.wrap(
            line, width, subsequent_indent=INDENT, break_long_words=False, break_on_hyphens=False
        )
        for line in text.split("\n")
    )
    return "\n".join("\n".join(lines) for lines in wrapped)
