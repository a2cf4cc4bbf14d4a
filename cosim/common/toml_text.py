"""TOML written from nested tables, for the scenario as run: the standard library reads TOML
only.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any

BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")


def to_toml(table: Mapping[str, Any]) -> str:
    """The text of a table of booleans, numbers, strings, lists, tables and lists of tables.
    Reading it gives the table back.
    """
    return "\n".join(_lines(table, ())).strip() + "\n"


def _lines(table: Mapping[str, Any], path: tuple[str, ...]) -> list[str]:
    """Plain values first: TOML would read them as the last sub-table's otherwise."""
    tables = {
        key: value
        for key, value in table.items()
        if isinstance(value, Mapping) or _is_tables(value)
    }
    lines = [f"{_key(key)} = {_value(value)}" for key, value in table.items() if key not in tables]
    for key, value in tables.items():
        inner = (*path, key)
        name = ".".join(map(_key, inner))
        heading, entries = (
            (f"[{name}]", [value]) if isinstance(value, Mapping) else (f"[[{name}]]", value)
        )
        for entry in entries:
            lines += ["", heading, *_lines(entry, inner)]
    return lines


def _is_tables(value: Any) -> bool:
    return (
        isinstance(value, list | tuple)
        and len(value) > 0
        and all(isinstance(entry, Mapping) for entry in value)
    )


def _key(key: str) -> str:
    return key if BARE_KEY.fullmatch(key) else json.dumps(key)


def _value(value: Any) -> str:
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_value, value)) + "]"
    if isinstance(value, float):
        return repr(value)  # shortest text that reads back the same
    return json.dumps(value, ensure_ascii=False)
