"""Lines that fit a terminal: broken between words there, and left as they are in files and
pipes.
"""

from __future__ import annotations

import os
import textwrap
from typing import TextIO

USUAL = 80  # columns
LEAST = 20
INDENT = "  "  # of what a broken line goes on with


def columns_of(stream: TextIO) -> int | None:
    """Width of the terminal behind a stream, which COLUMNS overrules; None where there is no
    terminal.
    """
    if not stream.isatty():
        return None
    told = os.environ.get("COLUMNS", "")
    if told.isdecimal() and int(told):
        return max(int(told), LEAST)
    try:
        return max(os.get_terminal_size(stream.fileno()).columns, LEAST)
    except (OSError, ValueError):  # a stand-in for one
        return USUAL


def fitted(text: str, stream: TextIO) -> str:
    """A line, or more of them, for this stream. Words, such as paths, stay whole."""
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
