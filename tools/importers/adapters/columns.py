"""Reads and writes CSV files of doubles without loss of digits.

It does not use numpy, since an importer's virtual environment contains the importer only.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path


def read_columns(path: str | Path) -> tuple[list[str], list[list[float]]]:
    """Returns the names of the columns, time first, and the rows."""
    with open(path, encoding="utf-8", newline="") as file:
        names, *rows = csv.reader(file)
    return names, [[float(text) for text in row] for row in rows]


def write_columns(path: str | Path, names: Sequence[str], rows: Iterable[Sequence[float]]) -> None:
    """Writes a header of quoted names and one line for each row."""
    with open(path, "w", encoding="utf-8", newline="\n") as file:
        file.write(",".join(f'"{name}"' for name in names) + "\n")
        file.writelines(",".join(map(repr, row)) + "\n" for row in rows)
