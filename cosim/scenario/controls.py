"""Reads the text that names a control: a built-in one, a class of a Python file, or an FMU.

    compliant               a built-in control
    law.py:Cpg              the class Cpg of a Python file
    controller.fmu          a controller FMU
    fast=law.py:Cpg         the same class under the label "fast"
    kinematic@chosen        in the gait and stance that compliant control chooses
    compliant@own           in those of the robot file

The label is the name of a run's column in tables, figures and reports. Without one it is the name
of the built-in control or of the class with what follows "@", or the file name of the FMU without
".fmu". What follows "@" holds where the scenario names neither gait nor stance.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from hexapod_cosim.cosim.common.files import RESERVED_NAMES
from hexapod_cosim.cosim.scenario.records import CHOSEN, CONTROLS, OWN
from hexapod_cosim.models import ScenarioError, suggestion
from hexapod_cosim.models.errors import refuse_path

BUILTIN, PYTHON, FMU = "builtin", "python", "fmu"
LAW = "law"  # key of [control] that names the control
MAP = "map"  # key of [control] with the names that a controller FMU uses
LABELLED = re.compile(r"(?P<label>[^=]*)=(?P<text>.*)", re.DOTALL)
OBJECT = re.compile(r"object:(?P<name>[^\W\d]\w*)")  # that a Python program gave
CLASS = re.compile(r"(?P<path>.+\.py):(?P<name>[^\W\d]\w*)")
FORBIDDEN = re.compile(r'[\x00-\x1f\x7f/\\:*?"<>|=]')  # in a label: it becomes a folder's name
MAX_LABEL = 60  # characters
FORMS = "a built-in control, law.py:Class or controller.fmu"
AT = "@"  # between a control and its walk
WALKS = (OWN, CHOSEN)
CHOOSER = "compliant"  # the control that chooses a walk


@dataclass(frozen=True, kw_only=True)
class Control:
    """A control as the user named it; the file of a law or FMU is not opened yet."""

    label: str
    kind: str  # BUILTIN, PYTHON or FMU
    text: str  # that parse_control() reads again; paths in it are absolute
    # of the Python file or the FMU; None for a built-in control and for an object in memory
    path: Path | None
    name: str  # of the built-in control, of the class, or of the FMU without ".fmu"
    walk: str = ""  # of WALKS: gait and stance where the scenario names none; "": its own choice

    @property
    def is_builtin(self) -> bool:
        """Whether the control belongs to this package."""
        return self.kind == BUILTIN

    @property
    def chooses(self) -> bool:
        """Whether it walks as compliant control chooses, where the scenario names no walk."""
        own = CHOSEN if self.is_builtin and self.name == CHOOSER else OWN
        return (self.walk or own) == CHOSEN

    def walking(self, walk: str) -> Control:
        """Returns this control under its label in one of WALKS; an FMU has a walk of its own."""
        if self.walk or self.kind == FMU:
            return self
        text = f"{self.label}={self.text.split('=', 1)[-1]}{AT}{walk}"
        return replace(self, text=text, walk=walk)


def parse_control(text: str, *, where: str, base: Path | None = None) -> Control:
    """Returns the control that a text names.

    Args:
        text: `[LABEL=]NAME[@WALK]`, `[LABEL=]law.py:Class[@WALK]` or `[LABEL=]controller.fmu`.
        where: place of the text, for messages.
        base: folder that a relative path starts from; None: the current folder.

    Raises:
        ScenarioError: the text has none of these forms, or the label cannot name a folder.
    """
    match = LABELLED.fullmatch(text.strip())
    label, plain = (
        (None, text.strip()) if match is None else (match["label"].strip(), match["text"])
    )
    plain, at = split_walk(plain.strip())
    kind, name, path = _named(plain, where=where, base=base)
    target = plain if path is None else f"{path}:{name}" if kind == PYTHON else str(path)
    full = f"{target}{at}" if label is None else f"{label}={target}{at}"
    own = f"{name}{at}" if label is None else label
    _check_label(own, where=where)
    walk = at.removeprefix(AT)
    return Control(label=own, kind=kind, text=full, path=path, name=name, walk=walk)


def split_walk(text: str) -> tuple[str, str]:
    """Returns the text of a control without its walk, and "@" with the walk or "".

    A controller FMU has a walk of its own, so that no other can be asked for.
    """
    plain, at, walk = text.rpartition(AT)
    named = walk in WALKS and not plain.endswith(".fmu")
    return (plain, at + walk) if named else (text, "")


def reference_of(label: str, labels: Sequence[str]) -> str:
    """Returns which of several controls, by label, one of them is compared with.

    It is the first one in the walk of the label: kinematic@chosen for compliant@chosen. Where that
    is missing, and for the first control in another walk, it is the first one itself.
    """
    first, at, walk = labels[0].partition(AT)[0], *label.partition(AT)[1:]
    twin = f"{first}{at}{walk}"
    return twin if twin in labels and twin != label else labels[0]


@lru_cache(maxsize=256)
def control_of(text: str) -> Control:
    """Returns the control of a text that was checked before."""
    return parse_control(text, where="control")


def distinct_controls(controls: Sequence[Control], *, where: str) -> tuple[Control, ...]:
    """Returns the controls. Raises ScenarioError when two of them have one label."""
    labels = [control.label for control in controls]
    for label in labels:
        if labels.count(label) > 1:
            raise ScenarioError(
                "two controls with one label",
                got=label,
                expected="a label for each control",
                fix=f"give one of them another label: other={label}",
                where=where,
            )
    return tuple(controls)


def parse_controls(
    texts: Sequence[str], *, where: str, base: Path | None = None
) -> tuple[Control, ...]:
    """Returns the controls of several texts. Raises ScenarioError, also for equal labels."""
    controls = [parse_control(text, where=where, base=base) for text in texts]
    return distinct_controls(controls, where=where)


def _named(text: str, *, where: str, base: Path | None) -> tuple[str, str, Path | None]:
    """Returns kind, name and file of a control's text without its label."""
    match = CLASS.fullmatch(text)
    if match is not None:
        return PYTHON, match["name"], _absolute(match["path"], base)
    match = OBJECT.fullmatch(text)
    if match is not None:
        return PYTHON, match["name"], None
    if text.endswith(".fmu"):
        path = _absolute(text, base)
        return FMU, path.stem, path
    if text.endswith(".py"):
        fix = f"name its class: {text}:MyController"
        raise ScenarioError(
            "a Python file without the name of a class", got=text, expected=FORMS, fix=fix,
            where=where,
        )  # fmt: skip
    if text not in CONTROLS:
        fix = suggestion(text, CONTROLS, otherwise="name a class as law.py:Class")
        walks = " or ".join(f"{AT}{walk}" for walk in WALKS)
        expected = f"one of {', '.join(CONTROLS)}, or law.py:Class, with {walks} or without, "
        expected += "or controller.fmu"
        raise ScenarioError("unknown control", got=text, expected=expected, fix=fix, where=where)
    return BUILTIN, text, None


def _absolute(text: str, base: Path | None) -> Path:
    path = Path(text).expanduser()
    return (path if path.is_absolute() or base is None else base / path).resolve()


def _check_label(label: str, *, where: str) -> None:
    """Raises ScenarioError for a label that cannot be the name of a folder of results."""
    if (
        not label
        or len(label) > MAX_LABEL
        or FORBIDDEN.search(label)
        or label.strip(". ") != label
        or label in RESERVED_NAMES
    ):
        raise ScenarioError(
            "not a label of a control",
            got=label,
            expected=f"1 to {MAX_LABEL} characters that can name a folder of results, "
            "and no name of a file of results",
            fix="write --control mine=law.py:Class",
            where=where,
        )


def read_control(value: Any, where: str) -> tuple[Control, dict[str, Any]]:
    """Returns the control of a scenario's key `control`, and the parameters of its table.

    The value is a text, or a table with the text under `law` and the parameters beside it. Raises
    ScenarioError.
    """
    table = value if isinstance(value, Mapping) else {LAW: value}
    text = table.get(LAW, CONTROLS[0])
    if not isinstance(text, str):
        raise ScenarioError(
            "wrong type",
            got=text,
            expected=f"a text in quotes: {FORMS}",
            where=where if table is not value else f"{where}.{LAW}",
        )
    parameters = {key: item for key, item in table.items() if key != LAW}
    return parse_control(text, where=where), parameters


def table_with_control(table: Mapping[str, Any], text: str) -> dict[str, Any]:
    """Returns a scenario's tables with another control; the parameters of [control] stay."""
    value = table.get("control")
    return {**table, "control": {**value, LAW: text} if isinstance(value, Mapping) else text}


def control_beside(value: Any, folder: Path) -> Any:
    """Returns the value of `control` with a relative path made absolute if a file lies there.

    Raises ScenarioError for a text that is no path of any system.
    """
    if isinstance(value, Mapping):
        return {**value, LAW: control_beside(value[LAW], folder)} if LAW in value else value
    if not isinstance(value, str):
        return value
    label, equals, text = value.rpartition("=")
    text, at = split_walk(text)
    path, colon, name = text.rpartition(":") if CLASS.fullmatch(text) else (text, "", "")
    near = folder / path
    refuse_path(near, "a control", ScenarioError)
    return f"{label}{equals}{near.resolve()}{colon}{name}{at}" if near.is_file() else value
