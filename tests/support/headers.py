"""Reads structures, constants and functions of this project's C headers into ctypes."""

from __future__ import annotations

import ctypes as ct
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
NOISE = re.compile(
    r'/\*.*?\*/|^[ \t]*#(?:[^\n]*\\\n)*[^\n]*$|extern "C" \{', re.DOTALL | re.MULTILINE
)
ENUM = re.compile(r"(?:typedef )?enum\s*\w*\s*\{(.*?)\}\s*(\w*);", re.DOTALL)
STRUCT = re.compile(r"typedef struct\s*\w*\s*\{(.*?)^\}\s*(\w+);", re.DOTALL | re.MULTILINE)
FUNCTION = re.compile(r"HX_API\s+([\w\s]+?[\s*]+)(\w+)\(([^;]*)\);")
FIELD = re.compile(
    r"struct \{(?P<inner>.*?)\}\s*(?P<own>\w+);|(?P<type>(?:const )?\w+ )(?P<names>[^;]+);",
    re.DOTALL,
)
PLAIN: dict[str, Any] = {
    "double": ct.c_double,
    "int": ct.c_int,
    "unsigned": ct.c_uint,
    "size_t": ct.c_size_t,
    "uint64_t": ct.c_uint64,
    "void": None,
}


class Header:
    """Declarations of header files: `types` and `constants` by their names in C."""

    def __init__(self, *paths: str) -> None:
        self.types: dict[str, Any] = dict(PLAIN)
        self.constants: dict[str, int] = {}
        text = "\n".join((ROOT / path).read_text(encoding="utf-8") for path in paths)
        self._text = NOISE.sub("", text)
        for match in re.finditer(f"{ENUM.pattern}|{STRUCT.pattern}", self._text, STRUCT.flags):
            if match[4]:
                self.types[match[4]] = self._structure(match[4], match[3])
            else:
                self._read_enum(match[1])
                self.types[match[2]] = ct.c_int

    def _read_enum(self, text: str) -> None:
        value = -1
        for item in filter(None, map(str.strip, text.split(","))):
            name, _, given = (part.strip() for part in item.partition("="))
            value = self._number(given) if given else value + 1
            self.constants[name] = value

    def _number(self, text: str) -> int:
        """Evaluates an integer expression of constants and sizes."""
        sized = re.sub(r"sizeof\((\w+)\)", lambda m: str(ct.sizeof(self.types[m[1]])), text)
        return int(eval(sized.replace("/", "//"), {}, self.constants))

    def _structure(self, name: str, text: str) -> type[ct.Structure]:
        fields = [field for match in FIELD.finditer(text) for field in self._fields(match)]
        return type(name, (ct.Structure,), {"_fields_": fields})

    def _fields(self, match: re.Match[str]) -> Iterator[tuple[str, Any]]:
        if match["own"]:
            yield match["own"], self._structure(match["own"], match["inner"])
            return
        for declarator in match["names"].split(","):
            kind = self._type(match["type"] + declarator.strip())
            name, *sizes = re.findall(r"\w+", declarator)
            for size in reversed(sizes):
                kind *= self._number(size)
            yield name, kind

    def _type(self, declaration: str) -> Any:
        """Returns the type of a declaration; arrays of parameters are pointers."""
        words = [word for word in re.findall(r"\w+", declaration) if word != "const"]
        stars = declaration.count("*")
        if stars == 0:
            return self.types[words[0]]
        if words[0] in {"char", "void"} or words[0] not in self.types:
            return ct.c_char_p if words[0] == "char" else ct.c_void_p
        kind = self.types[words[0]]
        for _ in range(stars):
            kind = ct.POINTER(kind)
        return kind

    def bind(self, library: ct.CDLL) -> ct.CDLL:
        """Declares the types of the functions that a library has; may be called repeatedly."""
        for result, name, arguments in FUNCTION.findall(self._text):
            function = getattr(library, name, None)
            if function is not None:
                given = [text for text in arguments.split(",") if text.strip() != "void"]
                function.restype = self._type(f"{result} x")
                function.argtypes = [self._parameter(text) for text in given]
        return library

    def _parameter(self, text: str) -> Any:
        return self._type(text.replace("[", "*", 1) if "[" in text else text)
