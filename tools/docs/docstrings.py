"""Converts docstrings to reStructuredText for Sphinx.

Our docstrings are plain text with formulas (|v_t|, f_n, x*y). Characters that are markup in
reStructuredText are escaped, `names` become code, indented formulas stay unchanged, and Args become
fields. A comment to the right of a field is the description of the field.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from sphinx.pycode import parser

OURS = "hexapod_cosim."
INDENT = 4
ARGUMENT = re.compile(r"^ {4}\*{0,2}([\w, .]+): (.*)")
SECTIONS = ("Args:", "Returns:")
COMMENT = re.compile(r"^\s*#:? *(?!noqa|type:|fmt:)(.*)\r?\n?$")


def converted(lines: list[str]) -> Iterator[str]:
    """Yields the lines of a docstring in reStructuredText."""
    place = "text"  # the meaning of indented lines: "text", "formula" or a section
    for line in lines:
        indented = line.startswith(" " * INDENT)
        if line.strip() and not indented:
            if place != "text":
                yield ""
            place = line if line in SECTIONS else "text"
            yield "" if line in SECTIONS else escaped(line)
        elif indented and place in SECTIONS:
            yield from _field(line, place)
        elif indented and place == "text":
            place = "formula"
            yield from ("", "::", "", line)
        else:
            yield line


def _field(line: str, section: str) -> Iterator[str]:
    """Yields the fields of a line of a section, one for each argument."""
    found = ARGUMENT.match(line) if section == "Args:" else None
    if found:
        yield from (f":param {name}: {escaped(found[2])}" for name in found[1].split(", "))
    elif section == "Returns:" and not line.startswith(" " * (INDENT + 1)):
        yield f":returns: {escaped(line.strip())}"
    else:
        yield escaped(line)


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
    """Registers the extension with Sphinx."""
    parser.comment_re = COMMENT  # Sphinx's own pattern requires "#:"
    app.connect("autodoc-process-docstring", process)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
