"""Tests that an FMU of somebody else does no harm: archives that leave their folder or fill the
disk, binaries that are cut short, XML with entities.

Each ends in a finding of `hexapod validate` and in an error of `hexapod simulate --fmu`.
"""

from __future__ import annotations

import io
import stat
import subprocess
import sys
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

from hexapod_cosim.cosim.common import archives
from hexapod_cosim.cosim.export.plant import export_fmu
from hexapod_cosim.cosim.export.validation import find_problems
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.models import FmuError, load_robot

BINARY = "binaries/linux64/hexapod.so"
DESCRIPTION = "modelDescription.xml"
Change = Callable[[zipfile.ZipFile], None]


@pytest.fixture(scope="module")
def members(plant_build: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """The files of a valid FMU."""
    path = export_fmu(load_robot("athena"), tmp_path_factory.mktemp("fmu") / "athena.fmu")
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def packed(path: Path, members: Mapping[str, bytes], change: Change | None = None) -> Path:
    """Writes an archive of these files, and what `change` adds."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            archive.writestr(name, data)
        if change is not None:
            change(archive)
    return path


def refusal(path: Path) -> str:
    """Returns the message with which a run refuses an FMU; nothing is left unpacked."""
    with pytest.raises(FmuError) as caught:
        Fmu(path)
    return str(caught.value)


def findings(path: Path) -> list[str]:
    """Returns the problems of an FMU, or the message with which it is refused."""
    try:
        return find_problems(path)
    except FmuError as error:
        return [str(error)]


def entry(name: str, kind: int = stat.S_IFREG) -> zipfile.ZipInfo:
    """Returns an archive's entry of a kind of file, with its name as it stands."""
    info = zipfile.ZipInfo("x")
    info.filename = info.orig_filename = name
    info.external_attr = (kind | 0o644) << 16
    info.compress_type = zipfile.ZIP_DEFLATED
    return info


@pytest.mark.parametrize(
    "name",
    ["/etc/x", "../x", "a/../../x", "a//x", "./x", "binaries/.", "C:/x", "a\\x", "sources/.."],
)
def test_a_path_that_leaves_the_archive_is_refused(
    members: dict[str, bytes], tmp_path: Path, name: str
) -> None:
    path = packed(
        tmp_path / "odd.fmu", members, lambda archive: archive.writestr(entry(name), b"x")
    )
    assert "the archive would write outside its folder" in refusal(path)
    problems = findings(path)
    assert any("would write outside its folder" in problem for problem in problems)
    assert not any("unexpected" in problem for problem in problems)


@pytest.mark.parametrize("kind", [stat.S_IFLNK, stat.S_IFIFO, stat.S_IFCHR, stat.S_IFSOCK])
def test_a_link_or_device_is_refused(members: dict[str, bytes], tmp_path: Path, kind: int) -> None:
    path = packed(
        tmp_path / "odd.fmu",
        members,
        lambda archive: archive.writestr(entry("resources/x", kind), b"/etc/passwd"),
    )
    assert "the archive has a link or a device: got 'resources/x'" in refusal(path)
    assert any("a link or a device" in problem for problem in findings(path))


@pytest.mark.parametrize(
    "names", [("resources/a", "resources/a/"), ("resources/a", "resources/a/b")]
)
def test_files_that_overwrite_each_other_are_refused(
    members: dict[str, bytes], tmp_path: Path, names: tuple[str, str]
) -> None:
    path = packed(tmp_path / "odd.fmu", members | dict.fromkeys(names, b"x"))
    assert "cannot be unpacked" in refusal(path)


def test_the_stated_limits_hold() -> None:
    assert archives.MEMBERS == 10_000
    assert archives.MEMBER_SIZE == 268_435_456
    assert archives.TOTAL_SIZE == 536_870_912

    def found(members: list[zipfile.ZipInfo]) -> list[str]:
        return [what for what, _, _ in archives.unsafe_members(members)]

    many = [zipfile.ZipInfo(f"resources/{number}") for number in range(10_001)]
    assert found(many[:-1]) == []
    assert found(many) == ["the archive has too many files"]
    large = [zipfile.ZipInfo(f"resources/{number}") for number in range(3)]
    for member in large:
        member.file_size = 178_956_970
    assert found(large) == []
    large[0].file_size += 3
    assert found(large) == ["the archive is too large unpacked"]


def test_a_stated_size_bounds_what_is_unpacked(tmp_path: Path) -> None:
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("zeros", bytes(10**6))
    lying = data.getvalue().replace((10**6).to_bytes(4, "little"), (1000).to_bytes(4, "little"))
    (tmp_path / "lie.zip").write_bytes(lying)
    with pytest.raises(FmuError, match="cannot be unpacked: got"):
        archives.unpack(tmp_path / "lie.zip", tmp_path)
    assert (tmp_path / "zeros").stat().st_size <= 1000


@pytest.mark.parametrize("share", [0.001, 0.9])
def test_a_binary_cut_short_is_a_finding_and_ends_no_process(
    members: dict[str, bytes], tmp_path: Path, share: float
) -> None:
    cut = members[BINARY][: int(share * len(members[BINARY]))]
    path = packed(tmp_path / "cut.fmu", members | {BINARY: cut})
    for arguments in (
        ("validate", str(path)),
        ("simulate", "walk_flat", "--fmu", str(path), "-o", str(tmp_path / "out")),
    ):
        done = subprocess.run(
            [sys.executable, "-m", "hexapod_cosim.cosim.cli", *arguments],
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 1, done
        said = done.stdout + done.stderr
        assert "missing at its end" in said or "cut short" in said or "no library" in said
        assert "unexpected" not in said


@pytest.mark.parametrize(("name", "fmi"), [("../evil", 2), ("9lives", 2), ("a/b", 3)])
def test_a_model_identifier_that_leaves_the_archive_is_refused(
    plant_build: Path, tmp_path: Path, name: str, fmi: int
) -> None:
    whole = export_fmu(load_robot("athena"), tmp_path / "athena.fmu", fmi=fmi)
    with zipfile.ZipFile(whole) as archive:
        members = {member: archive.read(member) for member in archive.namelist()}
    text = members[DESCRIPTION].decode()
    changed = text.replace('modelIdentifier="hexapod"', f'modelIdentifier="{name}"')
    path = packed(tmp_path / "odd.fmu", members | {DESCRIPTION: changed.encode()})
    assert "modelIdentifier is" in findings(path)[0]
    if fmi == 2:
        assert "modelIdentifier is no file's name" in refusal(path)


def test_xml_with_a_document_type_or_another_encoding_is_refused(
    members: dict[str, bytes], tmp_path: Path
) -> None:
    text = members[DESCRIPTION].decode()
    bomb = '<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]>'
    head, rest = text.split("\n", 1)
    entities = f"{head}\n{bomb}\n{rest}".encode()
    for data, got in ((entities, "<!DOCTYPE"), (text.encode("utf-16"), "another encoding")):
        path = packed(tmp_path / "odd.fmu", members | {DESCRIPTION: data})
        with pytest.raises(FmuError, match=got):
            find_problems(path)
        assert got in refusal(path)
