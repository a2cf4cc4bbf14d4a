"""Prepares docstrings for Sphinx: characters of formulas are escaped, `names` become code.

Our docstrings are plain text with formulas (|v_t|, f_n, x*y) and sections of Google's style, which
sphinx.ext.napoleon converts. A comment to the right of a field is its description.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from sphinx.pycode import parser

OURS = "hexapod_cosim."
SECTIONS = ("Args:", "Returns:", "Raises:")
COMMENT = re.compile(r"^\s*#:? *(?!noqa|type:|fmt:)(.*)\r?\n?$")


def converted(lines: list[str]) -> Iterator[str]:
    """Yields the lines of a docstring; indented ones outside sections are formulas."""
    place = "text"  # "text", "formula" or a section
    for line in lines:
        if line.strip() and not line.startswith("    "):
            if place != "text":
                yield ""
            place = line if line in SECTIONS else "text"
        elif line.strip() and place == "text":
            place = "formula"
            yield from ("", "::", "")
        yield line if place == "formula" else escaped(line)


def escaped(line: str) -> str:
    """Escapes the markup of a line, except code."""
    parts = re.split(r"``?([^`]+)``?", line)
    return "".join(
        f"``{part}``" if place % 2 else re.sub(r"([\\*|_])", r"\\\1", part)
        for place, part in enumerate(parts)
    )


def process(
    _app: Any, _what: str, name: str, _object: Any, _options: Any, lines: list[str]
) -> None:
    """Converts a docstring in place."""
    if name.startswith(OURS):
        lines[:] = converted(lines)


def setup(app: Any) -> dict[str, bool]:
    """Registers the extension with Sphinx; napoleon's conversion comes after it."""
    parser.comment_re = COMMENT  # Sphinx's own pattern requires "#:"
    app.connect("autodoc-process-docstring", process, priority=100)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
