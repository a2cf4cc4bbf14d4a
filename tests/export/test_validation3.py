"""The problems that `hexapod validate` finds in FMI 3.0 FMUs."""

from __future__ import annotations

import re
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from command import Call

from hexapod_cosim.cosim.export.export import export_fmu
from hexapod_cosim.cosim.validate.validation import find_problems
from hexapod_cosim.models.robot import load_robot

Members = dict[str, bytes]


@pytest.fixture(scope="module")
def sound3(plant_build: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return export_fmu(
        load_robot("phantomx_mk4"), tmp_path_factory.mktemp("sound3") / "sound.fmu", fmi=3
    )


def replaced(name: str, old: bytes, new: bytes) -> Callable[[Members], None]:
    def damage(members: Members) -> None:
        assert old in members[name]
        members[name] = members[name].replace(old, new, 1)

    return damage


def without(name: str) -> Callable[[Members], None]:
    def damage(members: Members) -> None:
        del members[name]

    return damage


def added(name: str) -> Callable[[Members], None]:
    return lambda members: members.update({name: b"x"})


def described(before: str, old: str, new: str) -> Callable[[Members], None]:
    """Returns modelDescription.xml with `new` in place of the first match of `old` after a match of
    `before`.
    """

    def damage(members: Members) -> None:
        pattern = f"({before}){old}".encode()
        members["modelDescription.xml"], count = re.subn(
            pattern, rb"\g<1>" + new.encode(), members["modelDescription.xml"], count=1
        )
        assert count == 1

    return damage


def test_a_valid_fmu_has_no_problems(sound3: Path, call: Call) -> None:
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
        (
            replaced("sources/buildDescription.xml", b'<SourceFile name="src/plant.c" />', b""),
            "not listed",
        ),
        (
            replaced(
                "terminalsAndIcons/terminalsAndIcons.xml",
                b'variableName="angle_ref"',
                b'variableName="nothing"',
            ),
            "nothing",
        ),
        (without("documentation/index.html"), "documentation"),
        (
            described(r'name="friction.mu"[^>]*max="', "100.0", "0.1"),
            "friction.mu: start 0.7 is not within min 0.0 and max 0.1",
        ),
        (described(r'name="friction.mu"[^>]*nominal="', "1.0", "0.0"), "friction.mu: nominal is 0"),
        (
            described(r'name="friction.mu"[^>]*min="', "0.0", "1e9"),
            "friction.mu: min 1000000000.0 is above max",
        ),
        (described(r'name="friction.mu"[^>]*max="', "100.0", "INF"), "friction.mu: max is inf"),
        (
            described(r'name="friction.mu"[^>]*unit="', "1", "furlong"),
            "friction.mu: unit 'furlong' is not defined",
        ),
        (
            described(r'<Unit name="', "N/m1.5", "furlong"),
            "unit 'furlong' is defined, but no variable has it",
        ),
        (
            described(r'name="angle_ref"[^>]*displayUnit="', "deg", "gon"),
            "angle_ref: display unit 'gon' is not defined for 'rad'",
        ),
        (
            described(r'name="angle_ref"[^>]*unit="', "rad", "m"),
            "angle_ref: unit 'm' is not that of its type 'Angle'",
        ),
        (
            described(r'name="angle_ref"[^>]*declaredType="', "Angle", "Bend"),
            "angle_ref: declared type 'Bend' is not defined",
        ),
        (
            described(r'name="angle_ref"[^>]*declaredType="', "Angle", "ServoMode"),
            "declared type 'ServoMode' is no Float64",
        ),
        (
            described(r'name="contact.law"[^>]*start="', "1", "9"),
            "contact.law: start 9 is no item of its type",
        ),
        (
            described(r'name="friction.mu"[^>]*description="', r'[^"]*', ""),
            "friction.mu has no description",
        ),
        (
            described(r'name="', "friction.slope", "friction.mu"),
            "friction.mu stands for 2 variables",
        ),
        (
            described(r'name="friction.slope" valueReference="', r"\d+", "4329"),
            "variables share a value reference",
        ),
        (
            described(r'name="initial.position"[^>]*start="', r"\S+ ", ""),
            "initial.position: 2 start values, expected 3",
        ),
        (
            described(r'<Output [^>]*dependencies="', "1273 1283", "1283 1273"),
            "dependencies are not ascending",
        ),
        (
            described(r'<Output [^>]*dependencies="', "1273 1283", "1273 12345"),
            "a dependency is not one of the",
        ),
        (
            described(r'<Output valueReference="', "1000", "999"),
            "ModelStructure/Output 999: no such variable",
        ),
        (
            described(r'<Output valueReference="', "1000", "18"),
            "ModelStructure/Output 18: speed_ref is no output",
        ),
        (
            described(r'<ContinuousStateDerivative valueReference="', "8004", "8007"),
            "does not name each derivative of a state once",
        ),
        (described(r'stopTime="', r'[^"]*', "-1"), "make no experiment"),
        (described(r'instantiationToken="', r'[^"]*', ""), "the instantiationToken is empty"),
        (without("sources/src/tangent.h"), 'includes "tangent.h", which is not in the archive'),
        (
            without("documentation/diagram.png"),
            "documentation/diagram.png, the robot's picture, is missing",
        ),
        (without("terminalsAndIcons/icon.png"), "terminalsAndIcons/icon.png is missing"),
        (added("sources/fmi3Functions.h"), "which importers have themselves"),
        (added("binaries/amiga64/hexapod.so"), "is no platform of the standard"),
    ],
)
def test_each_damage_is_found(
    sound3: Path, tmp_path: Path, damage: Callable[[Members], None], expected: str
) -> None:
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
