"""Draws the rooms of the code and the arrows between them: docs/images/rooms.svg.

usage: python tools/rooms.py [--check]

Rooms are the folders of Python modules and of C sources. An arrow goes from a room to each room
that it imports or includes; one that follows from the others is left out. --check writes nothing
and exits with 1 if the picture does not show what the code imports.
"""

from __future__ import annotations

import argparse
import ast
import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PICTURE = ROOT / "docs" / "images" / "rooms.svg"
PACKAGE = "hexapod_cosim"
C_NAMES = {
    path.parent.relative_to(ROOT).as_posix(): " ".join(path.relative_to(ROOT).parts[1:-1])
    for path in sorted([*ROOT.glob("extensions/*/*/src"), ROOT / "cosim" / "master" / "src"])
}
C_ROOMS = ("fmi", "plant_fmu", "controller/fmu", *C_NAMES)
SHARED = (
    "range_check.h",
    "message.h",
    "inside.h",
    "legs.h",
    "status.h",
    "shared_work.h",
)  # the headers that all C rooms share
HEADERS = "shared headers (C)"  # their box
INCLUDE = re.compile(r'^\s*#\s*include\s+"([^"]+)"', re.MULTILINE)

BOX, GAP, ROW = (142, 30), 18, 58  # px    size of a box, between boxes, between rows
MARGIN = 16  # px    around the picture
STYLE = """
  text { font: 13px sans-serif; text-anchor: middle; fill: #1b2430; }
  rect { fill: #eef3f8; stroke: #4a6a8a; rx: 6px; }
  rect.c { fill: #f6efe2; stroke: #957132; }
  path { fill: none; stroke: #8296aa; stroke-width: 1.2; marker-end: url(#tip); }
  @media (prefers-color-scheme: dark) {
    text { fill: #e6edf3; } rect { fill: #1d2b3a; } rect.c { fill: #33291a; }
  }
"""

Arrows = Mapping[str, frozenset[str]]  # room -> the rooms it imports or includes


def main() -> int:
    """Writes or checks the picture; returns the exit code."""
    parser = argparse.ArgumentParser(description="Draws the rooms of the code and their arrows.")
    parser.add_argument("--check", action="store_true", help="write nothing; exit with 1 if stale")
    check = parser.parse_args().check
    text = drawn(arrows())
    if PICTURE.is_file() and PICTURE.read_text(encoding="utf-8") == text:
        return 0
    name = PICTURE.relative_to(ROOT)
    print(f"{name}: {'stale; run tools/rooms.py' if check else 'written'}")
    if not check:
        PICTURE.write_text(text, encoding="utf-8", newline="\n")
    return int(check)


def arrows() -> Arrows:
    """Returns every room and the rooms that it imports or includes."""
    found: dict[str, set[str]] = {}
    for path in python_files():
        room = python_room(path.relative_to(ROOT).with_suffix("").parts)
        if room is not None:
            found.setdefault(room, set()).update(imported_rooms(path))
    for room in C_ROOMS:
        found[box_of(room)] = included_rooms(room)
    found[HEADERS] = set()
    return {room: frozenset(others - {room}) for room, others in sorted(found.items())}


def python_files() -> Iterator[Path]:
    """Returns the modules of the Python package."""
    for folder in ("models", "controller", "cosim", "extensions"):
        yield from sorted((ROOT / folder).rglob("*.py"))


def python_room(parts: tuple[str, ...]) -> str | None:
    """Returns the room of a module, or None for the package above the rooms.

    parts: of the module's name.
    """
    if parts[0] not in ("cosim", "extensions"):
        return parts[0]
    if len(parts) < 3 or parts[-1] == "__init__":
        return None
    return parts[1] if parts[0] == "cosim" else f"{parts[1]} (extension)"


def imported_rooms(path: Path) -> Iterator[str]:
    """Returns the rooms whose modules a file imports, at its top or within functions."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(f"{PACKAGE}."):
            for alias in node.names:
                parts = (*(node.module or "").split(".")[1:], alias.name)
                room = python_room(parts)
                if room is not None:
                    yield room


def included_rooms(room: str) -> set[str]:
    """Returns the rooms whose headers the C files of a room include."""
    headers = {other: {path.name for path in c_files(other)} for other in C_ROOMS}
    own, found = headers[room], set()
    for path in c_files(room):
        for name in INCLUDE.findall(path.read_text(encoding="utf-8")):
            file = Path(name).name
            if file in SHARED:
                found.add(HEADERS)
            elif file not in own and "generated" not in name:
                found |= {box_of(other) for other in C_ROOMS if file in headers[other]}
    return found


def box_of(room: str) -> str:
    """Returns the name of a C room in the picture."""
    return f"{C_NAMES.get(room, room)} (C)"


def c_files(room: str) -> list[Path]:
    """Returns the C sources and headers of a room, except generated ones."""
    files = (ROOT / room).rglob("*.[ch]")
    return sorted(path for path in files if "generated" not in path.parts)


def reduced(found: Arrows) -> Arrows:
    """Returns the arrows without those that follow from others."""

    def below(room: str) -> frozenset[str]:
        further = [below(other) for other in found[room]]
        return found[room].union(*further)

    return {
        room: frozenset(
            other
            for other in others
            if not any(other in below(third) for third in others - {other})
        )
        for room, others in found.items()
    }


def levels(found: Arrows) -> dict[str, int]:
    """Returns the row of each room: one above the highest room that it imports.

    Raises ValueError when rooms import each other in a circle.
    """
    known: dict[str, int] = {}

    def level(room: str, path: tuple[str, ...] = ()) -> int:
        if room in path:
            raise ValueError(f"a circle of imports: {' -> '.join((*path, room))}")
        if room not in known:
            known[room] = 1 + max(
                (level(other, (*path, room)) for other in found[room]), default=-1
            )
        return known[room]

    for room in found:
        level(room)
    return known


def drawn(found: Arrows) -> str:
    """Returns the picture as SVG: rows of boxes, those that import nothing at the bottom."""
    rows: dict[int, list[str]] = {}
    for room, level in levels(found).items():
        rows.setdefault(level, []).append(room)
    width = max(len(row) for row in rows.values()) * (BOX[0] + GAP) - GAP + 2 * MARGIN
    top = max(rows)
    height = top * ROW + BOX[1] + 2 * MARGIN
    places: dict[str, tuple[float, float]] = {}  # px    the middle of each box
    few = reduced(found)
    for level in range(top + 1):
        row = ordered(rows[level], few, places)
        span = len(row) * (BOX[0] + GAP) - GAP
        for k, room in enumerate(row):
            x = (width - span) / 2 + k * (BOX[0] + GAP) + BOX[0] / 2
            places[room] = x, MARGIN + (top - level) * ROW + BOX[1] / 2
    lines = [arrow(places[room], places[other]) for room in few for other in sorted(few[room])]
    boxes = [box(room, *places[room]) for room in few]
    return "\n".join([*_head(width, height), *lines, *boxes, "</svg>", ""])


def ordered(
    row: Iterable[str], few: Arrows, places: Mapping[str, tuple[float, float]]
) -> list[str]:
    """Returns a row from left to right, each room near the middle of what it imports."""

    def middle(room: str) -> tuple[float, str]:
        below = [places[other][0] for other in few[room]]
        return (sum(below) / len(below) if below else 0.0), room

    return sorted(row, key=middle)


def arrow(start: tuple[float, float], end: tuple[float, float]) -> str:
    """Returns a curve from the lower edge of one box to the upper edge of another."""
    (x0, y0), (x1, y1) = (start[0], start[1] + BOX[1] / 2), (end[0], end[1] - BOX[1] / 2 - 2)
    bend = (y1 - y0) / 2
    return f'<path d="M{x0:g} {y0:g} C{x0:g} {y0 + bend:g} {x1:g} {y1 - bend:g} {x1:g} {y1:g}"/>'


def box(room: str, x: float, y: float) -> str:
    """Returns a room as a box with its name."""
    kind = ' class="c"' if room.endswith("(C)") else ""
    left, top = x - BOX[0] / 2, y - BOX[1] / 2
    shape = f'<rect{kind} x="{left:g}" y="{top:g}" width="{BOX[0]}" height="{BOX[1]}"/>'
    return f'{shape}<text x="{x:g}" y="{y + 4:g}">{room}</text>'


def _head(width: float, height: float) -> list[str]:
    tip = '<path d="M0 0 L6 3 L0 6" style="marker-end: none"/>'
    return [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}">',
        f"<style>{STYLE}</style>",
        '<defs><marker id="tip" viewBox="0 0 6 6" refX="6" refY="3" markerWidth="7" '
        f'markerHeight="7" orient="auto">{tip}</marker></defs>',
    ]


if __name__ == "__main__":
    sys.exit(main())
