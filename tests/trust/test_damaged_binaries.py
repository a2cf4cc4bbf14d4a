"""Tests that a binary of full length with damaged contents ends a process of its own, and not the
process that asked for it.
"""

from __future__ import annotations

import importlib
import struct
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from hexapod_cosim.cosim.common.own_process import ProcessEndedError, call_in_process
from hexapod_cosim.cosim.control.fmu_instance import open_controller_fmu
from hexapod_cosim.cosim.export.plant import export_controller, export_fmu
from hexapod_cosim.cosim.run.controller_setup import make_setup
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
