"""Tests that damaged binaries end a process of their own, and that grid files with numbers out of
their ranges are refused by name.
"""

from __future__ import annotations

import ctypes as ct
import importlib
import struct
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from grids import BLOCKS, SMOOTH, Ground, grid_bytes

from hexapod_cosim.cosim.common.own_process import ProcessEndedError, call_in_process
from hexapod_cosim.cosim.control.fmu_instance import open_controller_fmu
from hexapod_cosim.cosim.export.plant import export_controller, export_fmu
from hexapod_cosim.cosim.run.plan import make_setup
from hexapod_cosim.models import FmuError, load_robot

LOADED, EXECUTABLE = 1, 1  # PT_LOAD and PF_X of an ELF segment


def without_code(data: bytes) -> bytes:
    """Returns a library of 64 bits with zeros for the contents of its executable segments.

    Headers and symbols stay, so that all functions of the standard are found.
    """
    changed = bytearray(data)
    table = struct.unpack_from("<Q", data, 32)[0]
    size, number = struct.unpack_from("<HH", data, 54)
    for place in range(table, table + size * number, size):
        kind, flags, offset, _, _, length = struct.unpack_from("<IIQQQQ", data, place)
        if kind == LOADED and flags & EXECUTABLE:
            changed[offset : offset + length] = bytes(length)
    assert changed != data
    return bytes(changed)


def damaged(path: Path) -> Path:
    """Replaces the binaries of an FMU by ones of equal length that hold no code."""
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            library = name.startswith("binaries/") and name.endswith(".so")
            archive.writestr(name, without_code(data) if library else data)
    return path


@pytest.fixture(scope="module", params=[2, 3])
def plant(
    plant_build: Path, tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest
) -> Path:
    """A plant FMU of FMI 2.0 or 3.0 with a damaged binary."""
    path = tmp_path_factory.mktemp("damaged") / "athena.fmu"
    return damaged(export_fmu(load_robot("athena"), path, fmi=request.param))


@pytest.fixture(scope="module", params=[2, 3])
def controller(
    plant_build: Path, tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest
) -> Path:
    """A controller FMU of FMI 2.0 or 3.0 with a damaged binary."""
    path = tmp_path_factory.mktemp("damaged") / "controller.fmu"
    setup = make_setup(load_robot("athena"), control="kinematic", period=0.005)
    return damaged(export_controller(setup, path, fmi=request.param))


def run(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """Runs a command of hexapod in a process of its own."""
    return subprocess.run(
        [sys.executable, "-m", "hexapod_cosim.cosim.cli", *map(str, arguments)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip


def test_a_run_refuses_a_plant(plant: Path, tmp_path: Path) -> None:
    done = run("simulate", "walk_flat", "--fmu", plant, "-o", tmp_path / "out")
    assert done.returncode == 1, done
    assert "ends the process that loads it: got 'SIGSEGV'" in " ".join(done.stderr.split())
    assert not (tmp_path / "out").exists()


def test_a_run_refuses_a_controller(controller: Path, tmp_path: Path) -> None:
    for choice in (("--control", controller), ("--set", f"control={controller}")):
        done = run("simulate", "walk_flat", *choice, "-o", tmp_path / "out")
        assert done.returncode == 1, done
        assert "ends the process that loads it: got 'SIGSEGV'" in " ".join(done.stderr.split())


def test_an_archive_of_fmi3_may_not_leave_its_folder(plant_build: Path, tmp_path: Path) -> None:
    setup = make_setup(load_robot("athena"), control="kinematic", period=0.005)
    path = export_controller(setup, tmp_path / "odd.fmu", fmi=3)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("../evil", b"x")
    with pytest.raises(FmuError, match="would write outside its folder"):
        open_controller_fmu(path)


FUNCTIONS = """
import os, signal, time

def crash(path): os.kill(os.getpid(), signal.SIGABRT)
def fail(path): raise ValueError(f"no {path.name}")
def wait(path): time.sleep(60)
def name_of(path): print("words of the function"); return [path.name]
"""


def test_a_process_returns_what_the_function_does_or_says_how_it_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "functions_of_a_test.py").write_text(FUNCTIONS, encoding="utf-8")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))  # of the new process
    monkeypatch.syspath_prepend(tmp_path)
    functions = importlib.import_module("functions_of_a_test")
    place = tmp_path / "a file"
    assert call_in_process(functions.name_of, place) == ["a file"]
    with pytest.raises(ProcessEndedError, match="SIGABRT"):
        call_in_process(functions.crash, place)
    with pytest.raises(ProcessEndedError, match=r"exit code 1 \(ValueError: no a file\)"):
        call_in_process(functions.fail, place)
    with pytest.raises(ProcessEndedError, match=r"no result after 0\.2 s"):
        call_in_process(functions.wait, place, limit=0.2)


# Every number of a grid file that is out of its range is refused by its name.

HEAD = struct.Struct("<8s4q3d64s")
NAN, INFINITE = float("nan"), float("inf")
ROWS, COLS, KIND, MATERIALS, X0, Y0, CELL = range(1, 8)  # their places in the head


def with_head(place: int, value: float, kind: int = SMOOTH) -> bytes:
    """Returns a grid file of 3 x 4 heights with another number in its head."""
    file = grid_bytes(np.zeros((3, 4)), cell=0.1, kind=kind)
    head = list(HEAD.unpack_from(file))
    head[place] = value
    return HEAD.pack(*head) + file[HEAD.size :]


@pytest.mark.parametrize(
    ("place", "value", "kind", "said"),
    [
        (KIND, 0, SMOOTH, "kind: got 0, expected 1 (smooth) or 2 (blocks)"),
        (KIND, 3, SMOOTH, "kind: got 3, expected 1 (smooth) or 2 (blocks)"),
        (ROWS, 1, SMOOTH, "rows: got 1, expected 2 to 1048576 for a smooth surface"),
        (ROWS, 0, BLOCKS, "rows: got 0, expected 1 to 1048576"),
        (ROWS, 1048577, BLOCKS, "rows: got 1048577, expected 1 to 1048576"),
        (ROWS, 1048577, SMOOTH, "rows: got 1048577, expected 2 to 1048576 for a smooth surface"),
        (COLS, 1, SMOOTH, "cols: got 1, expected 2 to 1048576 for a smooth surface"),
        (COLS, -1, BLOCKS, "cols: got -1, expected 1 to 1048576"),
        (COLS, 1048577, SMOOTH, "cols: got 1048577, expected 2 to 1048576 for a smooth surface"),
        (COLS, 1048577, BLOCKS, "cols: got 1048577, expected 1 to 1048576"),
        (MATERIALS, -1, BLOCKS, "materials: got -1, expected 0 to 255"),
        (MATERIALS, 256, BLOCKS, "materials: got 256, expected 0 to 255"),
        (X0, NAN, SMOOTH, "x0: got nan, expected -1e6 to 1e6 m"),
        (X0, -1.1e6, SMOOTH, "x0: got -1100000, expected -1e6 to 1e6 m"),
        (Y0, INFINITE, SMOOTH, "y0: got inf, expected -1e6 to 1e6 m"),
        (Y0, -INFINITE, SMOOTH, "y0: got -inf, expected -1e6 to 1e6 m"),
        (CELL, 0.0, SMOOTH, "cell: got 0, expected 1e-4 to 1000 m"),
        (CELL, 1001.0, SMOOTH, "cell: got 1001, expected 1e-4 to 1000 m"),
    ],
)
def test_a_number_of_the_head_out_of_its_range_is_named(
    core: ct.CDLL, place: int, value: float, kind: int, said: str
) -> None:
    with pytest.raises(ValueError, match="terrain grid") as caught:
        Ground(core, with_head(place, value, kind))
    assert str(caught.value) == f"terrain grid: {said}"


SOIL = 3  # column of the soil law in the table of materials, followed by its parameters
SINKING = [1.0, 1e6, 1.0, 0.5, 0.0, 0.6, 0.01, 1e6, 0.0, 0.0]  # a soil that is valid


def with_material(column: int, value: float, law: float = 0.0, kind: int = SMOOTH) -> bytes:
    """Returns a level grid of one material, whose table has another number in a column."""
    row = np.zeros(16)
    row[:3] = 0.5, NAN, NAN
    row[SOIL : SOIL + len(SINKING)] = SINKING
    row[SOIL] = law
    row[column] = value
    return grid_bytes(
        np.zeros((3, 4)), cell=0.1, kind=kind, material=np.ones((3, 4), np.uint8), table=row[None]
    )


@pytest.mark.parametrize(
    ("column", "value", "law", "said"),
    [
        (0, -0.1, 0.0, "mu: got -0.1, expected 0 to 100, or NaN"),
        (0, 101.0, 0.0, "mu: got 101, expected 0 to 100, or NaN"),
        (1, INFINITE, 0.0, "mu_static: got inf, expected 0 to 100, or NaN"),
        (1, -1.0, 0.0, "mu_static: got -1, expected 0 to 100, or NaN"),
        (2, 0.0, 0.0, "stiffness: got 0, expected 1e-3 to 1e14 N/m^1.5, or NaN"),
        (2, 1e15, 0.0, "stiffness: got 1e+15, expected 1e-3 to 1e14 N/m^1.5, or NaN"),
        (SOIL, 0.5, 0.5, "soil law: got 0.5, expected 0, 1, 2 or 3"),
        (SOIL, NAN, NAN, "soil law: got nan, expected 0, 1, 2 or 3"),
        (SOIL + 1, -1.0, 1.0, "number of a soil: got -1,"),
        (SOIL + 4, INFINITE, 2.0, "number of a soil: got inf,"),
        (SOIL + 3, 0.0, 1.0, "number of a soil: got 0,"),
        (SOIL + 6, 0.0, 3.0, "number of a soil: got 0,"),
        (SOIL + 7, 0.0, 2.0, "number of a soil: got 0,"),
        (SOIL + 9, NAN, 1.0, "number of a soil: got nan,"),
    ],
)
def test_a_number_of_a_material_out_of_its_range_is_named(
    core: ct.CDLL, column: int, value: float, law: float, said: str
) -> None:
    with pytest.raises(ValueError, match="terrain grid") as caught:
        Ground(core, with_material(column, value, law))
    assert str(caught.value).startswith(f"terrain grid: table: {said}")


def test_a_soil_of_blocks_is_refused(core: ct.CDLL) -> None:
    with pytest.raises(ValueError, match="soil law of blocks: got 1, expected 0"):
        Ground(core, with_material(SOIL, 1.0, 1.0, BLOCKS))
