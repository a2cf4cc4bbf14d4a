"""The controllers in Python and C have the same files, constants and equations, and few files name
a part, so that it can be added or removed by editing these.
"""

from __future__ import annotations

import ast
import re
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest

from hexapod_cosim.controller import Parts

ROOT = Path(__file__).resolve().parents[2]
PYTHON, C = ROOT / "controller", ROOT / "controller/fmu/src"
FOLDERS = ("walk", "sense", "comply")  # of the parts
PARTS = sorted(f"{folder}/{file.stem}" for folder in FOLDERS for file in (C / folder).glob("*.h"))
CONSTANT = re.compile(r"(\w+) = (-?[\d.e+-]+)(?=[,;])")
CITATION = re.compile(r"\bC(\d+)(?: to C(\d+))?\b")
# Python takes these from math.tau and from the plant's GEAR_SPEED
C_ONLY_CONSTANTS = {"whole_turn", "gear_speed"}
EQUATIONS = set(range(1, 60))


def test_every_part_has_its_twin() -> None:
    files = (file for folder in FOLDERS for file in (PYTHON / folder).glob("[a-z]*.py"))
    assert sorted(f"{file.parent.name}/{file.stem}" for file in files) == PARTS


@pytest.mark.parametrize("part", PARTS)
def test_constants_have_the_same_names_and_values(part: str) -> None:
    declared = re.findall(
        r"^static const double ([^;]*;)",
        (C / f"{part}.h").read_text(encoding="utf-8"),
        re.MULTILINE,
    )
    ours = {name: float(value) for line in declared for name, value in CONSTANT.findall(line)}
    theirs = python_constants(PYTHON / f"{part}.py")
    for name in ours.keys() - C_ONLY_CONSTANTS:
        assert theirs.get(name.removeprefix("hx_")) == ours[name], name


def python_constants(file: Path) -> dict[str, float]:
    """Returns the numbers that a module assigns to names, also several in a line."""
    found: dict[str, Any] = {}
    for node in ast.parse(file.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign):
            pairs = [(node.targets[0], node.value)]
            if isinstance(node.targets[0], ast.Tuple) and isinstance(node.value, ast.Tuple):
                pairs = list(zip(node.targets[0].elts, node.value.elts, strict=True))
            found |= {
                target.id.lower(): value.value
                for target, value in pairs
                if isinstance(target, ast.Name) and isinstance(value, ast.Constant)
            }
    return found


def cited(text: str) -> set[int]:
    """Returns the numbers of the equations that a text cites."""
    found = set()
    for first, last in CITATION.findall(text):
        found |= set(range(int(first), int(last or first) + 1))
    return found


def test_each_equation_of_the_pages_is_numbered_once_and_in_order() -> None:
    found = []
    for page in (ROOT / "docs/control").glob("*.md"):
        tags = re.findall(r"\\tag\{C(\d+)\}", page.read_text(encoding="utf-8"))
        numbers = [int(tag) for tag in tags]
        assert numbers == sorted(numbers), page.name
        found += numbers
    assert sorted(found) == sorted(EQUATIONS)


@pytest.mark.parametrize(("folder", "kind"), [(PYTHON, "*.py"), (C, "*.[ch]")])
def test_each_equation_is_cited_and_each_citation_exists(folder: Path, kind: str) -> None:
    text = "\n".join(file.read_text(encoding="utf-8") for file in folder.rglob(kind))
    assert cited(text) == EQUATIONS


MOST_FILES = 6  # that are written by hand and name a part, of code and pages
# what names a part in code besides its switch: modules, structures, functions, gains of its own
# (of [support] the hand-over: its filters' times are also those of other parts)
HOLD = r"walk\.hold|\bHold\b|hx_hold_|hxHold|HoldGains|/hold\.h|gains\.hold\b"
NAMES = {
    "support": r"comply\.support|\bSupport\b|hx_support_|hxSupport|/support\.h|handover_time",
    "touchdown": r"sense\.touchdown|\bTouchdown\b|hx_touchdown_|hxTouchdown|/touchdown\.h",
    "posture": HOLD,
    "path": HOLD,
    "sway": r"\bsway\b|\bSway\b|hx_sway_|hxSway",
    "fallback": r"sense\.trust|\bTrust\b|hx_trust_|hxTrust|SensorWatch|hx_sensor_watch|/trust\.h",
    "limits": r"LimitGains|limit_gains",
    "squeeze": r"planned_squeeze|PlannedSqueeze",
    "paper_share": r"height_share|share_limit|sag_limit",
    "paper_pid": r"yield_share|return_rate",
    "paper_suspension": r"paper\.(damping|return_time|limit)\b|model->(damping|limit)\b",
}


def sources() -> list[Path]:
    """The files of the controller that are written by hand, and its pages."""
    folders = (
        (ROOT / "controller", "*.*"),
        (ROOT / "docs", "control*.md"),
        (ROOT / "docs/control", "*.md"),
    )
    kinds = {".py", ".c", ".h", ".toml", ".txt", ".md"}
    files = {file for folder, name in folders for file in folder.rglob(name)}
    return sorted(file for file in files if file.suffix in kinds and "generated" not in file.parts)


def names(file: Path, part: str) -> bool:
    """Whether a file names a part."""
    switch = rf"`(compliance\.)?{part}\b"
    if file.suffix != ".md":
        switch = rf"parts(\.|->){part}\b|^    {part}: Annotated|{NAMES[part]}"
    return re.search(switch, file.read_text(encoding="utf-8"), re.MULTILINE) is not None


@pytest.mark.parametrize("part", [item.name for item in fields(Parts)])
def test_few_files_name_a_part(part: str) -> None:
    found = [file.relative_to(ROOT) for file in sources() if names(file, part)]
    assert len(found) <= MOST_FILES, [str(file) for file in found]
    assert Path("controller/gains.py") in found
    assert {file.suffix for file in found} >= {".py", ".h", ".md"}
