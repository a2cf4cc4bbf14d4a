"""CSV files of doubles that read back the same, without numpy: an importer's environment holds
the importer alone.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path


def read_columns(path: str | Path) -> tuple[list[str], list[list[float]]]:
    """Names of the columns, time first, and the rows."""
    with open(path, encoding="utf-8", newline="") as file:
        names, *rows = csv.reader(file)
    return names, [[float(text) for text in row] for row in rows]


def write_columns(path: str | Path, names: Sequence[str], rows: Iterable[Sequence[float]]) -> None:
    """Header of quoted names, then one line a row."""
    with open(path, "w", encoding="utf-8", newline="\n") as file:
        file.write(",".join(f'"{name}"' for name in names) + "\n")
        file.writelines(",".join(map(repr, row)) + "\n" for row in rows)
