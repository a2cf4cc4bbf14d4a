"""Declares the structures, constants and statuses of hexapod.h and controller.h in ctypes.

They are read from the headers, so that they cannot differ from what the compiler sees.
"""

from __future__ import annotations

import ctypes as ct
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
HEADERS = (
    ROOT / "plant_fmu/include/hexapod/legs.h",
    ROOT / "plant_fmu/include/hexapod/status.h",
    ROOT / "plant_fmu/include/hexapod/hexapod.h",
    ROOT / "controller/fmu/include/hexapod/controller.h",
)
COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
ENUM = re.compile(r"enum(?: \w+)? \{([^}]*)\}")
STRUCTURE = re.compile(r"typedef struct \w+ \{(.*?)\n\} (\w+);", re.DOTALL)
INNER = re.compile(r"struct \{([^}]*)\} (\w+);")
FIELD = re.compile(r"(\w+) ([^;{}]+);")
NAME = re.compile(r"(\w+)((?:\[\w+\])*)")
Kinds = dict[str, Any]


def record(name: str, *fields: tuple[str, Any]) -> type[ct.Structure]:
    """Makes a structure type with these fields."""
    return type(name, (ct.Structure,), {"_fields_": list(fields)})


def constants_of(text: str, known: Mapping[str, int]) -> dict[str, int]:
    """Returns known constants and the enumerators of a header, without sizes of structures."""
    found = dict(known)
    for body in ENUM.findall(text):
        number = -1
        for item in filter(None, (part.strip() for part in body.split(","))):
            name, _, value = (part.strip() for part in item.partition("="))
            try:
                number = number + 1 if not value else eval(value, {}, found)
            except (NameError, SyntaxError):  # a size of a structure
                continue
            found[name] = number
    return found


def fields_of(body: str, kinds: Kinds, constants: Mapping[str, int]) -> list[tuple[str, Any]]:
    """Returns the fields of a structure's body, with structures without a name inside."""
    inner: Kinds = {}

    def named(match: re.Match[str]) -> str:
        kind = record(match[2], *fields_of(match[1], kinds, constants))
        inner[f"struct_{match[2]}"] = kind
        return f"struct_{match[2]} {match[2]};"

    found = []
    for kind, names in FIELD.findall(INNER.sub(named, body)):
        for name, sizes in NAME.findall(names):
            type_: Any = inner.get(kind) or kinds[kind]
            for size in reversed(re.findall(r"\w+", sizes)):
                type_ = type_ * (int(size) if size.isdigit() else constants[size])
            found.append((name, type_))
    return found


def declared() -> tuple[Kinds, dict[str, int]]:
    """Returns the structure types and the constants of all headers, by their names in C."""
    kinds: Kinds = {"double": ct.c_double, "int": ct.c_int}
    kinds |= {"size_t": ct.c_size_t, "int64_t": ct.c_int64, "char": ct.c_char}
    constants: dict[str, int] = {}
    for path in HEADERS:
        text = COMMENT.sub("", path.read_text(encoding="utf-8"))
        text = text.replace("const char *", "pointer ")
        constants = constants_of(text, constants)
        for body, name in STRUCTURE.findall(text):
            kinds[name] = record(
                name, *fields_of(body, kinds | {"pointer": ct.c_char_p}, constants)
            )
    return kinds, constants


KINDS, CONSTANTS = declared()
HxDefinition, HxInput, HxOutput = (KINDS[f"hx{name}"] for name in ("Definition", "Input", "Output"))
HxCoordinates, HxSoilDefinition = KINDS["hxCoordinates"], KINDS["hxSoilDefinition"]
HxControllerInput, HxControllerOutput = KINDS["hxControllerInput"], KINDS["hxControllerOutput"]
HxRange = KINDS["hxRange"]
LEGS, JOINTS, BODIES = (CONSTANTS[f"HX_{name}"] for name in ("LEGS", "JOINTS", "BODIES"))
BODY_STATE, MULTIPLIERS = CONSTANTS["HX_BODY_STATE"], CONSTANTS["HX_MULTIPLIERS"]
MESSAGE_SIZE, CONE_BINS = CONSTANTS["HX_MESSAGE_SIZE"], CONSTANTS["HX_CONE_BINS"]
OK, INVALID_ARGUMENT, INVALID_MODEL, STEP_TOO_SMALL, NOT_FINITE, OUT_OF_MEMORY, BAD_STATE = range(7)

Real = ct.c_double
Doubles = ct.POINTER(Real)
PerLeg, PerJoint = Real * LEGS, (Real * JOINTS) * LEGS
