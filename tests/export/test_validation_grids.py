"""The problems that `hexapod validate` finds in the grids of an FMU's resources."""

from __future__ import annotations

import struct
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from command import Call

from hexapod_cosim.cosim.export.export import export_fmu
from hexapod_cosim.cosim.validate.grids import grid_problems
from hexapod_cosim.cosim.validate.validation import find_problems
from hexapod_cosim.models import load_robot
from hexapod_cosim.models.ground.table import read_terrain

FIRST, SECOND = "resources/terrain/1.terrain", "resources/terrain/2.terrain"
HEAD = 128  # bytes before the heights
NAN = struct.pack("<d", float("nan"))


@pytest.fixture(scope="module", params=[2, 3])
def sound(
    request: pytest.FixtureRequest, plant_build: Path, tmp_path_factory: pytest.TempPathFactory
) -> Path:
    """Returns an FMU with two grids, of either version of the standard."""
    folder = tmp_path_factory.mktemp("sound")
    robot = load_robot("athena")
    patch = {"x": 0.0, "y": 0.0, "size": 1.0, "mu": 0.3}
    robot = replace(robot, terrain=read_terrain({"kind": "rubble", "patch": [patch]}, "test"))
    other = read_terrain({"kind": "wave"}, "test").surface
    assert other is not None
    return export_fmu(robot, folder / "sound.fmu", fmi=request.param, terrains=[other])


Change = Callable[[dict[str, bytes]], object]


def changed(source: Path, target: Path, change: Change) -> Path:
    """Writes a copy of an archive whose files are changed; returns its path."""
    with zipfile.ZipFile(source) as old:
        files = {name: old.read(name) for name in old.namelist()}
    change(files)
    with zipfile.ZipFile(target, "w") as new:
        for name, data in files.items():
            new.writestr(name, data)
    return target


def patched(name: str, at: int, value: bytes) -> Change:
    """Returns a change that overwrites bytes of a file; `at` < 0 counts from the end."""

    def change(files: dict[str, bytes]) -> None:
        data = bytearray(files[name])
        at_byte = at % len(data)
        data[at_byte : at_byte + len(value)] = value
        files[name] = bytes(data)

    return change


def problems(source: Path, change: Change) -> list[str]:
    """Returns the problems of the grids among an archive's changed files."""
    with zipfile.ZipFile(source) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    change(files)
    return list(grid_problems(files))


def test_sound_grids_have_no_problems(sound: Path) -> None:
    assert find_problems(sound) == []


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            patched(SECOND, HEAD + 16, NAN),
            "resources/terrain/2.terrain: wave: a height that is no number: got 'nan in row 0,"
            " column 2', expected finite heights; fill the holes of the map first",
        ),
        (
            lambda files: files.update({SECOND: files[SECOND][:-8]}),
            "resources/terrain/2.terrain: not a grid file: got '52608 bytes instead of 52616',"
            " expected an undamaged grid file of version 1, which begins with hxGrid01;"
            " export the FMU again",
        ),
        (
            patched(SECOND, 8, struct.pack("<q", 12)),
            "resources/terrain/2.terrain: not a grid file: got '52616 bytes instead of 7904',"
            " expected an undamaged grid file of version 1, which begins with hxGrid01;"
            " export the FMU again",
        ),
        (
            patched(FIRST, -128, struct.pack("<d", -0.3)),
            "resources/terrain/1.terrain: material 1: mu is -0.3, expected at least 0, or NaN"
            " for none",
        ),
        (
            lambda files: files.update({"resources/terrain/3.terrain": files.pop(SECOND)}),
            "resources/terrain/2.terrain is missing: grids are numbered from 1 without a gap",
        ),
        (
            lambda files: files.pop(FIRST),
            "resources/start_values.txt: the FMU starts on grid 1, but resources/terrain/1.terrain"
            " is missing; grids in the archive: 2",
        ),
        (
            lambda files: files.update({"resources/terrain/notes.txt": b"text"}),
            "resources/terrain/notes.txt is no name of a grid file; expected"
            " resources/terrain/1.terrain, 2.terrain, ...",
        ),
    ],
)
def test_damaged_and_missing_grids_are_named(sound: Path, change: Change, message: str) -> None:
    assert message in problems(sound, change)


def test_validate_reads_the_grids_of_both_versions(sound: Path, tmp_path: Path) -> None:
    bad = changed(sound, tmp_path / "bad.fmu", lambda files: files.update({SECOND: b"no grid"}))
    assert (
        "resources/terrain/2.terrain: not a grid file: got \"7 bytes that begin with b'no grid'\","
        " expected an undamaged grid file of version 1, which begins with hxGrid01;"
        " export the FMU again"
    ) in find_problems(bad)


def test_a_grid_with_a_wrong_checksum_is_named(sound: Path, tmp_path: Path, call: Call) -> None:
    bad = tmp_path / "bad.fmu"
    data = bytearray(sound.read_bytes())
    with zipfile.ZipFile(sound) as archive:
        info = archive.getinfo(SECOND)
    name_size, extra = struct.unpack_from("<HH", data, info.header_offset + 26)
    data[info.header_offset + 30 + name_size + extra + info.compress_size // 2] ^= 0xFF
    bad.write_bytes(data)
    code, out, _ = call("validate", bad)
    assert code == 1
    assert "resources/terrain/2.terrain is damaged" in out
