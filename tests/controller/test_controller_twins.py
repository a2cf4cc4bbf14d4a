"""Compares the controllers in Python and C file by file: the same functions in the same order, the
same constants, the same equations.
"""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PYTHON, C = ROOT / "controller", ROOT / "controller_fmu/src"


def files_below(folder: Path, suffix: str) -> set[str]:
    """Returns the files of a folder and of its folders, without their suffixes."""
    return {
        path.relative_to(folder).with_suffix("").as_posix() for path in folder.rglob(f"*{suffix}")
    }


PAIRS = sorted(files_below(C, ".c") & files_below(PYTHON, ".py"))
# C has functions around the controller for tick times, saved states and refusals, and its own
# transcendental ones; Python has the constructor and `step`
ONLY_C = {"walk/schedule", "validation", "transcendental"}
# state.h declares what controller.c defines, and contains all types of the state
HEADERS = {"plane", "state", "transcendental"}
# numpy does for all legs what C does in a function for one leg, in a loop or as a sum
ONE_LEG = {
    "place_foot": "place_feet",
    "planned_foot": "planned_feet",
    "limit_joint": "limit_joints",
    "begin": "reset",
    "tick": "step",
    "change": "change_gait",
}
WITHOUT_TWIN = {
    *("total_weight", "plane_acceleration", "step_at"),
    *("linkage", "give_angles", "poses", "reach_all"),  # poses of one leg or of all at once
}
PREFIX = re.compile(
    r"^hx_((burden|compliance|compliant|contact_detector|sensor_watch|controller|gait"
    r"|hold|inverse_dynamics|leg_solver|landings"
    r"|paper|planned_squeeze|posture|support|sway|touchdown|load_adaptation"
    r"|command_ramp|fade|foot_paths)_)?"
)
FUNCTION = re.compile(r"^(?:static )?(?:const )?\w+ \*?(\w+)\([^;]*?\) \{", re.MULTILINE)
CONSTANT = re.compile(r"(\w+) = (-?[\d.e+-]+)(?=[,;])")
CITATION = re.compile(r"\bC(\d+)(?: to C(\d+))?\b")
# Python takes these from math.tau and from the plant's GEAR_SPEED
C_ONLY_CONSTANTS = {"turn", "gear_speed"}


def c_functions(stem: str) -> list[str]:
    names = (
        PREFIX.sub("", name)
        for name in FUNCTION.findall((C / f"{stem}.c").read_text(encoding="utf-8"))
    )
    return [ONE_LEG.get(name, name) for name in names if name not in WITHOUT_TWIN]


def python_functions(stem: str) -> list[str]:
    found = []
    for node in ast.parse((PYTHON / f"{stem}.py").read_text(encoding="utf-8")).body:
        members = node.body if isinstance(node, ast.ClassDef) else [node]
        found += [member.name for member in members if isinstance(member, ast.FunctionDef)]
    return ["compile" if name == "__init__" else name.lstrip("_") for name in found]


def is_in_order(few: list[str], many: list[str]) -> bool:
    """Returns whether `few` is a subsequence of `many`."""
    rest = iter(many)
    return all(name in rest for name in few)


def test_every_file_has_its_twin() -> None:
    assert files_below(C, ".c") - ONLY_C == set(PAIRS)
    headers = {name for name in PAIRS if name != "controller"} | {"validation"} | HEADERS
    assert files_below(C, ".h") == headers
    # files that only Python has
    own = {"plane", "memory", "gains", "parts", "size", "figure_style"}
    python = {
        name
        for name in files_below(PYTHON, ".py")
        if not name.startswith("design/") and not name.endswith("__init__")
    }
    assert python == own | set(PAIRS)


@pytest.mark.parametrize("stem", PAIRS)
def test_each_function_in_c_has_its_twin_in_python_in_the_same_order(stem: str) -> None:
    ours, theirs = c_functions(stem), python_functions(stem)
    if stem in {
        "sense/contact_detection",
        "controller",
        # C compiles no model of the detector; reset and step are last
    }:
        assert sorted(set(ours) - {"compile"}) == sorted(set(ours) & set(theirs) - {"compile"})
        return
    assert ours
    assert is_in_order(ours, theirs), [name for name in ours if name not in theirs]


@pytest.mark.parametrize("stem", PAIRS)
def test_constants_have_the_same_names_and_values(stem: str) -> None:
    declared = re.findall(
        r"^(?:static )?const double ([^;]*;)",
        (C / f"{stem}.c").read_text(encoding="utf-8"),
        re.MULTILINE,
    )
    ours = {
        name: float(value)
        for line in declared
        for name, value in CONSTANT.findall(line)
        if name not in C_ONLY_CONSTANTS
    }
    theirs = {}
    for node in ast.parse((PYTHON / f"{stem}.py").read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign):
            targets = (
                node.targets[0].elts if isinstance(node.targets[0], ast.Tuple) else node.targets
            )
            try:
                values = ast.literal_eval(node.value)
            except ValueError:
                continue
            for target, value in zip(
                targets,
                values if isinstance(values, tuple) and len(targets) > 1 else [values],
                strict=True,
            ):
                assert isinstance(target, ast.Name)
                theirs[target.id.lower()] = value
    for name, value in ours.items():
        assert theirs.get(name.removeprefix("hx_")) == value, name


def cited(text: str) -> set[int]:
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
    assert sorted(found) == list(range(1, 57))


def test_each_citation_exists_in_the_pages_and_each_equation_is_cited_by_both() -> None:
    known = set(range(1, 57))
    python, c = (
        {
            path: cited(path.read_text(encoding="utf-8"))
            for folder, kind in places
            for path in folder.rglob(kind)
        }
        for places in ([(PYTHON, "*.py")], [(C, "*.c"), (C, "*.h")])
    )
    for files in (python, c):
        for path, numbers in files.items():
            assert numbers <= known, f"{path.relative_to(ROOT)} cites {sorted(numbers - known)}"
    assert known - set[int]().union(*python.values()) == set()
    assert known - set[int]().union(*c.values()) == set()


def test_each_equation_that_the_picture_names_exists() -> None:
    assert cited((ROOT / "docs/images/control_loop.svg").read_text(encoding="utf-8")) <= set(
        range(1, 55)
    )
