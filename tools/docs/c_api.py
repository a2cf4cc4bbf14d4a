"""Writes the reference of the C API: the declarations of the public headers with their comments."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HEADERS = (
    "plant_fmu/include/hexapod/hexapod.h",
    "controller/fmu/include/hexapod/controller.h",
    "plant_fmu/include/hexapod/status.h",
    "plant_fmu/include/hexapod/legs.h",
    "plant_fmu/include/hexapod/range_check.h",
    "plant_fmu/include/hexapod/message.h",
    "plant_fmu/include/hexapod/inside.h",
)
COMMENT = re.compile(r"/\*(.*?)\*/", flags=re.DOTALL)
NOISE = re.compile(r'^(#.*|extern "C" \{|\}|)$')
TYPE = re.compile(r"^(?:typedef )?(struct|enum)\s*(\w*)")


def page() -> str:
    """Returns the page on all headers."""
    return "\n".join(_lines()) + "\n"


def _lines() -> Iterator[str]:
    yield (
        "# C\n\nThe plant and the controller without FMI: a shared library each, C11, no "
        "dependencies. Made from the headers.\n"
    )
    for header in HEADERS:
        yield f"## {Path(header).name}\n"
        yield from _header((ROOT / header).read_text(encoding="utf-8"))


def _header(text: str) -> Iterator[str]:
    first = COMMENT.match(text)
    if first:
        yield _prose(first[1]).partition(" - ")[2] + "\n"
        text = text[first.end() :]
    for block in _blocks(text):
        comment, code = _split(block)
        found = TYPE.match(code)
        if code.startswith("HX_API") or re.match(r"^(const )?\w[\w *]*\w+\(.*\);", code):
            yield from _functions(comment, code)
        else:
            title = re.search(r"\}\s*(\w+);\s*$", code) or (found if found and found[2] else None)
            if title:
                yield f"### {title[title.lastindex or 1]}\n"
            yield comment + "\n" if comment else ""
            yield f"```c\n{code}\n```\n"


def _blocks(text: str) -> Iterator[str]:
    """Yields declarations with the comments before them; blank lines in braces do not end them."""
    lines: list[str] = []
    for line in text.splitlines():
        bare = COMMENT.sub("", line)
        if NOISE.match(line.strip()) and not _open(lines):
            if lines:
                yield "\n".join(lines)
            lines = []
        elif bare or lines or line:
            lines.append(line)
    if lines:
        yield "\n".join(lines)


def _open(lines: list[str]) -> bool:
    text = COMMENT.sub("", "\n".join(lines))
    return text.count("{") > text.count("}")


def _split(block: str) -> tuple[str, str]:
    found = COMMENT.match(block)
    return (_prose(found[1]), block[found.end() :].strip()) if found else ("", block.strip())


def _functions(comment: str, code: str) -> Iterator[str]:
    """Yields functions that share a comment; a comment after a function belongs to it alone."""
    if comment:
        yield comment + "\n"
    for prototype, own in re.findall(
        r"(?:HX_API )?(.*?\));((?:[ \t]*/\*.*?\*/)?)", code, flags=re.DOTALL
    ):
        inner = " ".join(COMMENT.sub("", prototype).replace("HX_API ", "").split())
        notes = [_prose(text) for text in COMMENT.findall(prototype + own)]
        yield f"```{{c:function}} {inner}\n{'. '.join(note for note in notes if note)}\n```\n"


def _prose(comment: str) -> str:
    text = " ".join(re.sub(r"^\s*\*\s?", "", line).strip() for line in comment.strip().splitlines())
    for character in "*_|<>[]":
        text = text.replace(character, "\\" + character)
    return text
