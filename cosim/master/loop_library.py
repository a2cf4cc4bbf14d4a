"""Loads the co-simulation library (cosim/master/src) with the structures of its headers.

The structures for ctypes are read from the headers, so that no member is listed twice. The headers
are written for this short reader: a declaration ends with a semicolon, and the length of an array
is a number or a name of an enumeration.
"""

from __future__ import annotations

import ctypes as ct
import re
from functools import cache
from math import prod
from pathlib import Path
from typing import Any

from hexapod_cosim.cosim.common.plant_files import BUILD, LOOP, shared_library
from hexapod_cosim.models import FmuError

HEADERS = Path(__file__).parent / "include" / "hexapod"
# each uses structures of those before it
ORDER = ("macro_step.h", "sensors.h", "master.h")
_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
_BLOCK = re.compile(
    r"typedef struct (?P<name>\w+) \{(?P<members>.*?)\} \w+;|enum \w* ?\{(?P<list>.*?)\}"
    r"|#define (?P<constant>\w+) (?P<value>\d+)$",
    re.DOTALL | re.MULTILINE,
)
_MEMBER = re.compile(r"(?P<stars>\**)(?P<name>\w+)(?P<lengths>(\[\w+\])*)")
_TYPES: dict[str, Any] = {
    "double": ct.c_double,
    "int": ct.c_int,
    "unsigned": ct.c_uint,
    "size_t": ct.c_size_t,
}


class Header:
    """Structures by their names in C, and the numbers of enumerations and definitions."""

    def __init__(self) -> None:
        self.structures: dict[str, Any] = {}
        self.numbers: dict[str, int] = {}

    def read(self, text: str) -> None:
        """Adds what a header declares."""
        for found in _BLOCK.finditer(_COMMENT.sub("", text)):
            if found["name"]:
                self._add_structure(found["name"], found["members"])
            elif found["list"]:
                self._add_names(found["list"])
            else:
                self.numbers[found["constant"]] = int(found["value"])

    def _add_structure(self, name: str, members: str) -> None:
        fields = [
            field for line in members.split(";") if line.strip() for field in self._fields(line)
        ]
        self.structures[name] = type(name, (ct.Structure,), {"_fields_": fields})

    def _fields(self, line: str) -> list[tuple[str, Any]]:
        """Returns names and types of one declaration: `const double *low, *high`."""
        words = line.replace("const ", " ").strip()
        base, _, rest = words.partition(" ")
        fields = []
        for part in rest.split(","):
            member = _MEMBER.fullmatch(part.strip())
            assert member, f"not a declaration for this reader: {line}"
            fields.append((member["name"], self._type(base, member)))
        return fields

    def _type(self, base: str, member: re.Match[str]) -> Any:
        if member["stars"]:
            return ct.c_char_p if base == "char" else ct.c_void_p
        kind = _TYPES[base] if base in _TYPES else self.structures[base]
        for length in reversed(re.findall(r"\w+", member["lengths"])):
            kind *= self._number(length)
        return kind

    def _add_names(self, names: str) -> None:
        following = 0
        for item in filter(None, map(str.strip, names.split(","))):
            name, _, value = (part.strip() for part in item.partition("="))
            self.numbers[name] = self._number(value) if value else following
            following = self.numbers[name] + 1

    def _number(self, text: str) -> int:
        """Returns a sum of products of numbers and names."""
        return sum(
            prod(
                int(factor) if factor.isdigit() else self.numbers[factor]
                for factor in map(str.strip, term.split("*"))
            )
            for term in text.split("+")
        )


@cache
def read_headers(*more: Path) -> Header:
    """Returns what the library's headers declare, and those of an extension that use them."""
    header = Header()
    if more:  # whose structures hold the same ones
        header.structures |= read_headers().structures
        header.numbers |= read_headers().numbers
    for path in more or (HEADERS / name for name in ORDER):
        header.read(path.read_text(encoding="utf-8"))
    return header


def load_loop(part: str, size: str, structure: str, *more: Path) -> ct.CDLL:
    """Returns the library if its structures are those of the headers.

    Args:
        part: the part of the library: "master", or that of an extension.
        size: the function that returns the size of the structure.
        structure: name of the structure that holds all others of this part.
        more: headers of the extension.

    Raises FmuError when the library is missing or has other structures.
    """
    path, header = shared_library(LOOP), read_headers(*more)
    library = ct.CDLL(str(path))
    layout = f"hx_{part}_layout"
    want = header.numbers[layout.upper()], ct.sizeof(header.structures[structure])
    got = 0, 0
    if hasattr(library, layout) and hasattr(library, size):
        getattr(library, size).restype = ct.c_size_t
        got = int(getattr(library, layout)()), int(getattr(library, size)())
    if got != want:
        raise FmuError(
            "the co-simulation library is another version's",
            got=f"layout {got[0]} of {got[1]} bytes",
            expected=f"layout {want[0]} of {want[1]} bytes",
            fix=BUILD,
            where=str(path),
        )
    return library
