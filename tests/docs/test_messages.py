"""Errors of the product say at least two of what was got, what was expected and what to do; names
that are proposed are near to the given one.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from pages import parsed

from hexapod_cosim.cosim.master.recorder import ColumnError, Recording
from hexapod_cosim.models.errors import nearest_name

ROOT = Path(__file__).parents[2]
FOLDERS = ("models", "plant_fmu", "fmi", "controller", "cosim", "extensions", "packaging")
PARTS = {"got", "expected", "fix"}
CLASSES_GIVEN = {"error", "kind"}  # parameters that are a class of errors
# a message of another program or of a user's code, which is quoted as it is, or our own message
QUOTED = {
    ("cosim/master/fmu_block.py", "failure"): "what the FMU logged",
    ("cosim/master/fmu.py", "step_failure"): "what the FMU logged",
    ("cosim/master/fmu.py", "_set_one_by_one"): "what the FMU logged: name, value, range",
    ("cosim/control/fmu_instance.py", "called"): "what the FMU logged",
    ("cosim/control/python_law.py", "_explained"): "the exception of the user's code",
    ("cosim/cli/runs.py", "run_into"): "the message of the error that ended the run",
    ("extensions/live/robot.py", "__init__"): "the message of the controller's error",
    ("cosim/cli/export.py", "validate"): "UnsoundFmuError itself gives the three",
}
Place = tuple[str, str]


@cache
def _trees() -> dict[str, ast.Module]:
    """The product's modules by path."""
    files = [path for folder in FOLDERS for path in (ROOT / folder).rglob("*.py")]
    return {path.relative_to(ROOT).as_posix(): parsed(path) for path in files}


def _name(node: ast.expr) -> str:
    return str(getattr(node, "id", getattr(node, "attr", "")))


def _error_classes() -> set[str]:
    """The names of HexapodError and of all classes derived from it."""
    classes = [
        (node.name, {_name(base) for base in node.bases})
        for tree in _trees().values()
        for node in ast.walk(tree)
        if isinstance(node, ast.ClassDef)
    ]
    found, before = {"HexapodError"}, set[str]()
    while found != before:
        before = set(found)
        found |= {name for name, bases in classes if bases & before}
    return found


def _calls(node: ast.AST, function: str) -> Iterator[tuple[str, ast.Call]]:
    """The calls below a node, with the innermost function that each stands in."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Call):
            yield function, child
        inner = child.name if isinstance(child, ast.FunctionDef) else function
        yield from _calls(child, inner)


def _errors() -> Iterator[tuple[Place, int, set[str]]]:
    """Place, line and given parts of each error that the product makes."""
    classes = _error_classes() | CLASSES_GIVEN
    for path, tree in _trees().items():
        for function, call in _calls(tree, ""):
            given = {keyword.arg for keyword in call.keywords if keyword.arg is not None}
            all_given = len(given) == len(call.keywords)  # none as **facts
            if _name(call.func) in classes and call.args and all_given:
                yield (path, function), call.lineno, given & PARTS


def test_each_error_gives_two_of_got_expected_and_fix() -> None:
    errors = list(_errors())
    short = {f"{place[0]}:{line}" for place, line, given in errors if len(given) < 2}
    quoted = {f"{place[0]}:{line}" for place, line, _ in errors if place in QUOTED}
    assert len(errors) > 250
    assert not sorted(short - quoted)


def test_no_quoted_message_is_listed_in_vain() -> None:
    short = {place for place, _, given in _errors() if len(given) < 2}
    present = {place for place in QUOTED if (ROOT / place[0]).is_file()}
    assert present <= short


COLUMNS = ("time", "torso.position[1]", "torso.roll", "LF.foot.force[3]", "LF.foot.contact")


@pytest.mark.parametrize(
    ("name", "near"),
    [
        ("torso.pos", "torso.position[1]"),  # torso.roll is more similar
        ("torso.position[4]", "torso.position[1]"),
        ("LF.foot", "LF.foot.force[3]"),
        ("LF.foot.contct", "LF.foot.contact"),
        ("tim", "time"),
        ("to", None),
        ("", None),
    ],
)
def test_a_name_that_continues_the_given_one_is_the_nearest(name: str, near: str | None) -> None:
    assert nearest_name(name, COLUMNS) == near


def test_a_name_that_shares_a_few_letters_is_no_nearest_one() -> None:
    assert nearest_name("trot", ("tripod", "ripple", "wave", "amble")) is None
    assert nearest_name("tripdo", ("tripod", "ripple", "wave", "amble")) == "tripod"
    assert nearest_name("my", ("law", "mu")) == "mu"


def test_an_unknown_column_is_refused_with_the_nearest_name() -> None:
    with pytest.raises(ColumnError, match=r"got 'torso\.pos'; did you mean 'torso\.position\[1\]'"):
        Recording(COLUMNS, np.zeros((2, 5))).column("torso.pos")
    with pytest.raises(ColumnError, match=r"got 'servo'; record it: outputs\.csv names"):
        Recording(COLUMNS, np.zeros((2, 5))).column("servo")
