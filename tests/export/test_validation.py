"""The problems that `hexapod validate` finds in FMUs of both versions of the standard."""

from __future__ import annotations

import re
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from command import Call

from hexapod_cosim.cosim.export.plant import export_fmu
from hexapod_cosim.cosim.export.validation import find_problems, result_problems
from hexapod_cosim.models import load_robot

Members = dict[str, bytes]
DESCRIPTION, STARTS = "modelDescription.xml", "resources/start_values.txt"


@pytest.fixture(scope="module")
def sound(plant_build: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An FMU without problems, of FMI 3.0, whose validation takes a third of that of FMI 2.0."""
    path = tmp_path_factory.mktemp("sound") / "sound.fmu"
    return export_fmu(load_robot("phantomx_mk4"), path, fmi=3)


@pytest.fixture(scope="module")
def sound2(plant_build: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An FMU of FMI 2.0 without problems."""
    return export_fmu(load_robot("phantomx_mk4"), tmp_path_factory.mktemp("sound2") / "sound.fmu")


def changed(source: Path, target: Path, change: Callable[[Members], object]) -> Path:
    """Writes a copy of an archive whose files are changed; returns its path."""
    with zipfile.ZipFile(source) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    change(members)
    with zipfile.ZipFile(target, "w") as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return target


def edited(member: str, pattern: bytes, new: bytes) -> Callable[[Members], None]:
    """Returns a change of the first match of a pattern in a file of the archive."""

    def change(members: Members) -> None:
        members[member], count = re.subn(pattern, new, members[member], count=1)
        assert count == 1

    return change


def library(members: Members) -> str:
    """Returns the path of the only binary."""
    (name,) = (name for name in members if name.startswith("binaries/"))
    return name


def test_a_sound_fmu_has_no_problems(sound: Path, sound2: Path, call: Call) -> None:
    for path in (sound, sound2):
        assert call("validate", path) == (0, f"{path}: no problems found\n", "")


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (edited(DESCRIPTION, b'causality="output"', b'causality="outputs"'), "outputs"),
        (edited(DESCRIPTION, b'name="friction.slope"', b'name="friction.mu"'), "not unique"),
        (edited(DESCRIPTION, b"<Output [^>]*>", b""), "ModelStructure"),
        (edited(DESCRIPTION, b'(Token)="[^"]*"', rb'\1="{other}"'), "got '{other}', expected"),
        (edited(STARTS, b"^[^\n]*", b"{wrong}"), "GUID: got '{"),
        (edited(STARTS, b"\n[0-9]+ ", b"\n99999 "), "start_values.txt: line 2"),
        (lambda members: members.pop(STARTS), "GUID"),
        (
            lambda members: members.update({library(members): b"no library"}),
            "Failed to load shared library",
        ),
        (
            lambda members: members.update({library(members): members[library(members)][:2000]}),
            "bytes are missing at its end'",
        ),
        (
            lambda members: members.update(
                {library(members): members[library(members)].replace(b"DoStep\0", b"DoStop\0")}
            ),
            "DoStep",
        ),
        (
            lambda members: members.update({library(members) + "x": members.pop(library(members))}),
            "Cannot find shared library",
        ),
    ],
)
def test_each_damage_is_found(
    sound: Path, tmp_path: Path, change: Callable[[Members], object], expected: str
) -> None:
    problems = find_problems(changed(sound, tmp_path / "damaged.fmu", change))
    assert any(expected in problem for problem in problems), problems


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (edited(DESCRIPTION, b'causality="output"', b'causality="outputs"'), "outputs"),
        (edited(DESCRIPTION, b'guid="[^"]*"', b'guid="{other}"'), "got '{other}', expected"),
        (
            lambda members: members.update({library(members): b"no library"}),
            "Failed to load shared library",
        ),
    ],
)
def test_damages_of_fmi_2_are_found(
    sound2: Path, tmp_path: Path, change: Callable[[Members], object], expected: str
) -> None:
    problems = find_problems(changed(sound2, tmp_path / "damaged.fmu", change))
    assert any(expected in problem for problem in problems), problems


def test_outputs_must_be_finite_and_every_step_be_taken() -> None:
    kinds = [("time", float), ("height", float, 2), ("steps", np.int32)]
    rows = [(0.001 * row, (1.0, 1.0), row) for row in range(6)]
    assert list(result_problems(np.array(rows, kinds))) == []
    rows[3] = (0.003, (1.0, float("nan")), 3)
    assert list(result_problems(np.array(rows, kinds))) == [
        "height: got nan within 5 steps, expected finite numbers"
    ]
    assert list(result_problems(np.array(rows[:3], kinds))) == [
        "binaries: the FMU takes no steps of 0.001 s: got 2, expected 5"
    ]
