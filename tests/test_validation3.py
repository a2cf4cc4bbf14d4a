"""`hexapod validate` on FMI 3.0 FMUs: sound ones pass, each damage is found."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from command import Call

from hexapod_cosim.cosim.export import export_fmu
from hexapod_cosim.cosim.validation import find_problems
from hexapod_cosim.models.robot import load_robot

Members = dict[str, bytes]


@pytest.fixture(scope="module")
def sound3(plant_build: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return export_fmu(load_robot("phantomx_mk4"), tmp_path_factory.mktemp("sound3") / "sound.fmu", fmi=3)


def replaced(name: str, old: bytes, new: bytes) -> Callable[[Members], None]:
    def damage(members: Members) -> None:
        assert old in members[name]
        members[name] = members[name].replace(old, new, 1)

    return damage


def without(name: str) -> Callable[[Members], None]:
    def damage(members: Members) -> None:
        del members[name]

    return damage


def test_a_sound_fmu_has_no_problems(sound3: Path, call: Call) -> None:
    assert find_problems(sound3) == []
    assert call("validate", sound3)[0] == 0


@pytest.mark.parametrize(
    ("damage", "expected"),
    [
        (replaced("modelDescription.xml", b'variability="fixed"', b'variability="fluid"'), "fluid"),
        (replaced("modelDescription.xml", b'start="0.7"', b'start="0.75"'), "start_values.txt"),
        (replaced("resources/start_values.txt", b"{", b"{0"), "GUID"),
        (without("resources/start_values.txt"), "start_values.txt is missing"),
        (without("sources/src/plant.c"), "sources/src/plant.c"),
        (without("sources/buildDescription.xml"), "buildDescription.xml"),
        (replaced("sources/buildDescription.xml", b'<SourceFile name="src/plant.c" />', b""), "not listed"),
        (replaced("terminalsAndIcons/terminalsAndIcons.xml", b'variableName="angle_ref"', b'variableName="nothing"'), "nothing"),
        (without("documentation/index.html"), "documentation"),
    ],
)
def test_each_damage_is_found(sound3: Path, tmp_path: Path, damage: Callable[[Members], None], expected: str) -> None:
    with zipfile.ZipFile(sound3) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    damage(members)
    damaged = tmp_path / "damaged.fmu"
    with zipfile.ZipFile(damaged, "w") as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    assert any(expected in problem for problem in find_problems(damaged)), find_problems(damaged)


def test_a_damaged_binary_is_found(sound3: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(sound3) as archive:
        library = next(name for name in archive.namelist() if name.startswith("binaries/"))
        members = {name: archive.read(name) for name in archive.namelist()}
    members[library] = members[library][:4] + b"damaged"
    damaged = tmp_path / "damaged.fmu"
    with zipfile.ZipFile(damaged, "w") as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    assert find_problems(damaged)
