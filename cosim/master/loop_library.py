"""Loads the co-simulation library (cosim/master/src) with the structures of its headers.

Structures, constants and functions are read from the headers, so that nothing is listed twice. The
reader knows what this project's headers use.
"""

from __future__ import annotations

import ctypes as ct
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

from hexapod_cosim.cosim.common.plant_files import BUILD, LOOP, shared_library
from hexapod_cosim.models import FmuError

HEADERS = Path(__file__).parent / "include" / "hexapod"
# each uses structures of those before it
ORDER = ("macro_step.h", "sensors.h", "master.h")
_NOISE = re.compile(
    r'/\*.*?\*/|^[ \t]*#(?:[^\n]*\\\n)*[^\n]*$|extern "C" \{', re.DOTALL | re.MULTILINE
)
_DEFINITION = re.compile(r"^#define (\w+) (\d+)$", re.MULTILINE)
_BLOCK = re.compile(
    r"enum\s*(?P<enum>\w*)\s*\{(?P<items>.*?)\}"
    r"|typedef struct\s*\w*\s*\{(?P<members>.*?)^\}\s*(?P<name>\w+);",
    re.DOTALL | re.MULTILINE,
)
_FUNCTION = re.compile(r"HX_API\s+([\w\s]+?[\s*]+)(\w+)\(([^;]*)\);")
_MEMBER = re.compile(
    r"struct \{(?P<inner>.*?)\}\s*(?P<own>\w+);|(?P<type>(?:const )?\w+ )(?P<names>[^;]+);",
    re.DOTALL,
)
_PLAIN: dict[str, Any] = {
    "double": ct.c_double,
    "int": ct.c_int,
    "unsigned": ct.c_uint,
    "size_t": ct.c_size_t,
    "uint64_t": ct.c_uint64,
    "void": None,
}


class Header:
    """Declarations of header files, by their names in C.

    Args:
        paths: of headers, each of which may use the declarations of those before it.
        base: other headers, whose declarations these may use.

    Attributes:
        types: plain types, enumerations and structures. A pointer in a structure is an address.
        constants: numbers of enumerations and definitions.
    """

    def __init__(self, *paths: Path, base: Header | None = None) -> None:
        self.types: dict[str, Any] = dict(base.types if base else _PLAIN)
        self.constants: dict[str, int] = dict(base.constants if base else {})
        text = "\n".join(path.read_text(encoding="utf-8") for path in paths)
        self.constants |= {name: int(value) for name, value in _DEFINITION.findall(text)}
        self._text = _NOISE.sub("", text)
        for block in _BLOCK.finditer(self._text):
            if block["name"]:
                self.types[block["name"]] = self._structure(block["name"], block["members"])
            else:
                self._read_enum(block["items"])
                self.types[block["enum"]] = ct.c_int

    def _read_enum(self, text: str) -> None:
        value = -1
        for item in filter(None, map(str.strip, text.split(","))):
            name, _, given = (part.strip() for part in item.partition("="))
            value = self._number(given) if given else value + 1
            self.constants[name] = value

    def _number(self, text: str) -> int:
        """Evaluates an integer expression of constants and sizes."""
        sized = re.sub(r"sizeof\((\w+)\)", lambda m: str(ct.sizeof(self.types[m[1]])), text)
        return int(eval(sized.replace("/", "//"), {"__builtins__": {}}, self.constants))

    def _structure(self, name: str, text: str) -> type[ct.Structure]:
        fields = [field for member in _MEMBER.finditer(text) for field in self._fields(member)]
        return type(name, (ct.Structure,), {"_fields_": fields})

    def _fields(self, member: re.Match[str]) -> Iterator[tuple[str, Any]]:
        if member["own"]:
            yield member["own"], self._structure(member["own"], member["inner"])
            return
        base = member["type"].removeprefix("const ").strip()
        for declarator in member["names"].split(","):
            kind = _address(base) if "*" in declarator else self.types[base]
            name, *sizes = re.findall(r"\w+", declarator)
            for size in reversed(sizes):
                kind *= self._number(size)
            yield name, kind

    def bind(self, library: ct.CDLL) -> ct.CDLL:
        """Declares the types of the functions that a library has; may be called repeatedly."""
        for result, name, arguments in _FUNCTION.findall(self._text):
            function = getattr(library, name, None)
            if function is not None:
                given = [text for text in arguments.split(",") if text.strip() != "void"]
                function.restype = self._type(result)
                function.argtypes = [self._type(text) for text in given]
        return library

    def _type(self, declaration: str) -> Any:
        """Returns the type of a parameter or a result; arrays are addresses."""
        base = declaration.replace("const ", "").replace("*", " ").split()[0]
        stars = declaration.count("*") + declaration.count("[")
        if stars == 0:
            return self.types[base]
        known = self.types.get(base)
        is_structure = isinstance(known, type) and issubclass(known, ct.Structure)
        return ct.POINTER(known) if is_structure and stars == 1 else _address(base)


def _address(base: str) -> Any:
    """Returns the type of a pointer that is passed on and not followed."""
    return ct.c_char_p if base == "char" else ct.c_void_p


@cache
def loop_header() -> Header:
    """Returns what the library's headers declare."""
    return Header(*(HEADERS / name for name in ORDER))


def load_loop(name: str, header: Header, part: str, size: str, structure: str) -> ct.CDLL:
    """Returns a library, with its functions declared, if its structures are those of its headers.

    Args:
        name: of the library, which contains the co-simulation loop.
        header: its declarations.
        part: hx_<part>_layout() returns the version of the structures, HX_<PART>_LAYOUT is it.
        size: the function that returns the size of the structure.
        structure: name of the structure that holds all others.

    Raises FmuError when the library is missing or has other structures.
    """
    path = shared_library(name)
    library = header.bind(ct.CDLL(str(path)))
    layout = f"hx_{part}_layout"
    want = header.constants[layout.upper()], ct.sizeof(header.types[structure])
    got = 0, 0
    if hasattr(library, layout) and hasattr(library, size):
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


@cache
def master_library() -> ct.CDLL:
    """Returns the library for runs. Raises FmuError as load_loop()."""
    return load_loop(LOOP, loop_header(), "master", "hx_master_size", "hxMaster")
