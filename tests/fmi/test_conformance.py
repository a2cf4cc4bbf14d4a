"""Tests that archives and documents of exported FMUs conform to the standard, and that each kind of
damage is found and named.
"""

from __future__ import annotations

import re
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from hexapod_cosim.cosim.export.export import export_fmu
from hexapod_cosim.cosim.validate.archive import PLATFORMS, archive_problems, standard_functions
from hexapod_cosim.models import list_robots, load_robot

DESCRIPTION, TERMINALS = "modelDescription.xml", "terminalsAndIcons/terminalsAndIcons.xml"
Change = Callable[[bytes], bytes]


@pytest.fixture(scope="module")
def good(plant_build: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return export_fmu(load_robot("athena"), tmp_path_factory.mktemp("good") / "athena.fmu")


def rewritten(
    source: Path,
    target: Path,
    change: Callable[[dict[str, bytes]], None],
    method: int = zipfile.ZIP_DEFLATED,
) -> Path:
    """Copies an FMU with changed members."""
    with zipfile.ZipFile(source) as old:
        members = {name: old.read(name) for name in old.namelist()}
    change(members)
    with zipfile.ZipFile(target, "w", method) as new:
        for name, content in members.items():
            new.writestr(name, content)
    return target


def replaced(old: str, new: str) -> Change:
    """Replaces the first `old`, which must exist, by `new`."""

    def change(data: bytes) -> bytes:
        assert old.encode() in data
        return data.replace(old.encode(), new.encode(), 1)

    return change


def substituted(pattern: str, new: str) -> Change:
    def change(data: bytes) -> bytes:
        text, count = re.subn(pattern.encode(), new.encode(), data, count=1, flags=re.DOTALL)
        assert count == 1
        return text

    return change


@pytest.mark.parametrize("robot", list_robots())
def test_every_robot_s_fmu_conforms(plant_build: Path, tmp_path: Path, robot: str) -> None:
    assert archive_problems(export_fmu(load_robot(robot), tmp_path / "robot.fmu")) == []


MASS = 'name="torso.mass".*?<Real [^>]*?'
DAMAGED_DESCRIPTIONS = [
    (replaced('causality="output"', 'causality="outputs"'), "is not an element of the set"),
    (
        substituted(f'({MASS})start="[^"]*"', r'\1start="-1.0"'),
        "torso.mass: start -1.0 is not within min 1e-09",
    ),
    (
        substituted(f'({MASS})min="[^"]*"', r'\1min="2e9"'),
        "torso.mass: min 2000000000.0 is above max",
    ),
    (substituted(f'({MASS})max="[^"]*"', r'\1max="INF"'), "torso.mass: max is inf"),
    (substituted(f'({MASS})nominal="[^"]*"', r'\1nominal="0.0"'), "torso.mass: nominal is 0"),
    (substituted(f'({MASS})unit="[^"]*"', r'\1unit="lb"'), "torso.mass: unit 'lb' is not defined"),
    (
        substituted(f'({MASS})unit="[^"]*"', r'\1unit="m"'),
        "torso.mass: unit 'm' is not that of its type 'Mass'",
    ),
    (
        substituted(f'({MASS})declaredType="[^"]*"', r'\1declaredType="Weight"'),
        "declared type 'Weight' is not defined",
    ),
    (
        substituted(f'({MASS})declaredType="[^"]*"', r'\1declaredType="ContactLaw"'),
        "declared type 'ContactLaw' is no Real",
    ),
    (
        replaced('displayUnit="deg/s"', 'displayUnit="rpm"'),
        "display unit 'rpm' is not defined for 'rad/s'",
    ),
    (
        replaced("<UnitDefinitions>", '<UnitDefinitions><Unit name="furlong" />'),
        "unit 'furlong' is defined, but no variable has it",
    ),
    (
        substituted(r'(<Enumeration declaredType="ContactLaw"[^>]*start=)"1"', r'\1"9"'),
        "contact.law: start 9 is no item",
    ),
    (substituted(r'description="Mass of the torso"', ""), "torso.mass has no description"),
    (replaced('name="torso.roll"', 'name="torso.yaw"'), "torso.yaw stands for 2 variables"),
    (
        substituted(r'modelIdentifier="hexapod"', 'modelIdentifier="my-robot"'),
        "modelIdentifier is 'my-robot', expected a C identifier",
    ),
    (substituted(r'guid="[^"]*"', 'guid=""'), "the guid is empty"),
    (
        substituted(r'(<Outputs>\s*<Unknown index=)"\d+"', r'\1"99999"'),
        "ModelStructure/Outputs index 99999: no such variable",
    ),
    (
        substituted(r'(<Outputs>\s*<Unknown index=)"\d+"', r'\1"1"'),
        "LF.coxa.angle_ref is no output",
    ),
    (
        substituted(r'(<Outputs>\s*<Unknown index="\d+")[^/]*', r'\1 dependencies="1 99999" '),
        "a dependency is not one of",
    ),
    (
        substituted(r'(<Outputs>\s*<Unknown index="\d+")[^/]*', r'\1 dependencies="2 1" '),
        "dependencies are not ascending",
    ),
    (
        substituted(
            r'(<Outputs>\s*<Unknown index="\d+")[^/]*',
            r'\1 dependencies="1 2" dependenciesKind="dependent" ',
        ),
        "does not tell one kind for each of 2",
    ),
    (
        substituted(r"(<InitialUnknowns>\s*)(<Unknown [^>]*>)", r"\1\2\2"),
        "ModelStructure/InitialUnknowns: indices are not ascending",
    ),
    (substituted(r'stopTime="[^"]*"', 'stopTime="-1"'), "make no experiment"),
    (substituted(r'<File name="src/plant.c" ?/>', ""), "sources/src/plant.c is not listed"),
    (
        replaced("src/plant.c", "src/robots.c"),
        "lists the source src/robots.c, which is not in the archive",
    ),
    (replaced("src/plant.c", "src/kernel.c"), "lists the source src/kernel.c more than once"),
]


@pytest.mark.parametrize(
    ("change", "part"), DAMAGED_DESCRIPTIONS, ids=[part for _, part in DAMAGED_DESCRIPTIONS]
)
def test_a_damaged_description_is_found(
    good: Path, tmp_path: Path, change: Change, part: str
) -> None:
    def damage(members: dict[str, bytes]) -> None:
        members[DESCRIPTION] = change(members[DESCRIPTION])

    found = archive_problems(rewritten(good, tmp_path / "bad.fmu", damage))
    assert any(part in problem for problem in found), found


BINARY = "binaries/linux64/hexapod.so"
DAMAGED_MEMBERS: list[tuple[str, Change | None, str]] = [
    (BINARY, lambda data: b"MZ" + data[2:], "is no library of linux64"),
    (BINARY, lambda data: data[:18] + b"\xb7\x00" + data[20:], "is no library of linux64"),
    (
        BINARY,
        lambda data: data.replace(b"\0fmi2CancelStep\0", b"\0fmi2CancelStop\0"),
        "lacks 1 functions of the standard: fmi2CancelStep",
    ),
    (
        BINARY,
        lambda data: data + b"/home/someone/hexapod/plant.c",
        "holds a path of the machine it was made on: /home/someone",
    ),
    (BINARY, None, "is missing: importers look for the modelIdentifier"),
    (
        "sources/src/method.h",
        None,
        'sources/src/method.c includes "method.h", which is not in the archive',
    ),
    ("sources/src/plant.c", None, "lists the source src/plant.c, which is not in the archive"),
    ("documentation/index.html", None, "documentation/index.html, the documentation, is missing"),
    ("documentation/index.html", lambda data: data + b"file:///Users/me", "holds a path"),
    ("documentation/licenses/license.txt", None, "the licence, is missing"),
    ("model.png", lambda data: b"GIF89a", "model.png is no PNG"),
    ("model.png", None, "model.png, the robot's picture, is missing"),
    ("terminalsAndIcons/icon.png", None, "terminalsAndIcons/icon.png is missing"),
    (TERMINALS, lambda data: b"<terminals>", "is no XML"),
    (TERMINALS, replaced('matchingRule="plug"', ""), "matchingRule"),
    (
        TERMINALS,
        replaced("LF.coxa.angle_ref", "LF.hip.angle_ref"),
        "terminal LF.command has 'LF.hip.angle_ref', which is no variable",
    ),
    (
        TERMINALS,
        replaced('memberName="coxa.angle_ref"', 'memberName="coxa.speed_ref"'),
        "members of terminal LF.command share a name",
    ),
    (TERMINALS, replaced('name="LM"', 'name="LF"'), "terminals of the FMU share a name"),
]


@pytest.mark.parametrize(
    ("member", "change", "part"), DAMAGED_MEMBERS, ids=[part for *_, part in DAMAGED_MEMBERS]
)
def test_a_damaged_member_is_found(
    good: Path, tmp_path: Path, member: str, change: Change | None, part: str
) -> None:
    def damage(members: dict[str, bytes]) -> None:
        content = members.pop(member)
        if change is not None:
            members[member] = change(content)
        elif member == BINARY:
            members["binaries/linux64/plant.so"] = content

    found = archive_problems(rewritten(good, tmp_path / "bad.fmu", damage))
    assert any(part in problem for problem in found), found


@pytest.mark.parametrize(
    ("name", "part"),
    [
        ("../outside.txt", "is no path inside the archive"),
        ("/absolute.txt", "is no path inside the archive"),
        ("documentation/größe.txt", "is not ASCII"),
        ("binaries/amiga64/hexapod.so", "is no platform of the standard"),
        ("sources/fmi2Functions.h", "which importers have themselves"),
        ("sources/src/new.c", "sources/src/new.c is not listed by CoSimulation"),
    ],
)
def test_unexpected_members_are_found(good: Path, tmp_path: Path, name: str, part: str) -> None:
    found = archive_problems(
        rewritten(good, tmp_path / "bad.fmu", lambda members: members.update({name: b"x"}))
    )
    assert any(part in problem for problem in found), found


def test_other_compression_links_and_doubles_are_found(good: Path, tmp_path: Path) -> None:
    packed = rewritten(good, tmp_path / "lzma.fmu", lambda members: None, zipfile.ZIP_LZMA)
    assert any("expected store or deflate" in problem for problem in archive_problems(packed))
    doubled = rewritten(good, tmp_path / "doubled.fmu", lambda members: None)
    link = zipfile.ZipInfo("documentation/link.html")
    link.external_attr = 0o120777 << 16
    with zipfile.ZipFile(doubled, "a") as archive:
        archive.writestr(link, "index.html")
        with pytest.warns(UserWarning, match="Duplicate"):
            archive.writestr("model.png", b"again")
    found = archive_problems(doubled)
    assert any("link.html is a link" in problem for problem in found)
    assert any("model.png is there more than once" in problem for problem in found)


def test_a_flipped_bit_is_found(good: Path, tmp_path: Path) -> None:
    data = bytearray(
        rewritten(
            good, tmp_path / "stored.fmu", lambda members: None, zipfile.ZIP_STORED
        ).read_bytes()
    )
    data[data.index(b"fmi2DoStep")] ^= 1
    (tmp_path / "flipped.fmu").write_bytes(data)
    assert any("is damaged" in problem for problem in archive_problems(tmp_path / "flipped.fmu"))


def test_libraries_of_every_platform_are_recognised_by_their_bytes(
    good: Path, tmp_path: Path
) -> None:
    symbols = b"\0".join(
        [
            b"",
            *(b"_" + name.encode() for name in standard_functions()),
            *map(str.encode, standard_functions()),
            b"",
        ]
    )
    # headers of libraries of 64 bits that list no parts
    heads = {
        ".so": b"\x7fELF\x02\x01" + bytes(12),
        ".dll": b"MZ" + bytes(58) + b"\x40\0\0\0" + b"PE\0\0",
        ".dylib": b"\xcf\xfa\xed\xfe",
    }

    def add(members: dict[str, bytes]) -> None:
        for platform, (suffix, _, _, machine) in PLATFORMS.items():
            members[f"binaries/{platform}/hexapod{suffix}"] = (
                heads[suffix] + machine + bytes(64) + symbols
            )

    assert archive_problems(rewritten(good, tmp_path / "all.fmu", add)) == []


@pytest.mark.parametrize(
    ("machines", "fine"), [((0x01000007, 0x0100000C), True), ((0x0100000C,), False)]
)
def test_a_universal_library_must_hold_the_folder_s_machine(
    good: Path, tmp_path: Path, machines: tuple[int, ...], fine: bool
) -> None:
    entries = b"".join(machine.to_bytes(4, "big") + bytes(16) for machine in machines)
    library = b"\xca\xfe\xba\xbe" + len(machines).to_bytes(4, "big") + entries + b"\0"
    library += b"".join(b"_" + name.encode() + b"\0" for name in standard_functions())
    change = {"binaries/darwin64/hexapod.dylib": library}
    assert (
        archive_problems(
            rewritten(good, tmp_path / "fat.fmu", lambda members: members.update(change))
        )
        == []
    ) == fine
