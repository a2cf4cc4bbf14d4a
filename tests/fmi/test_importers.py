"""Runs a short form of `make test-importers`: fmpy, the project's master and the C importer of
examples/ repeat one recorded walk.
"""

from __future__ import annotations

import dataclasses
import os
import shutil
import subprocess
from pathlib import Path

import fmpy
import numpy as np
import pytest

from hexapod_cosim.cosim.export.plant import export_fmu
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.results.recordings import read_csv, write_csv
from hexapod_cosim.models import load_robot
from tools.importers.capabilities import adjoint, tuned, updated
from tools.importers.compare import ROUND_OFF, largest_difference
from tools.importers.walk import STEP, ReferenceRun, record

DURATION = 0.6  # s; long enough for the ramp, a lift-off and a touch-down
MOST_LINES = 72  # of the C importer
ROOT = Path(__file__).resolve().parents[2]
SOURCE, README = ROOT / "examples" / "importer.c", ROOT / "README.md"


@pytest.fixture(scope="module")
def walk(plant_build: Path, tmp_path_factory: pytest.TempPathFactory) -> ReferenceRun:
    return record(tmp_path_factory.mktemp("walk"), duration=DURATION)


@pytest.fixture(scope="module")
def importer(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Compiles the C importer with the command in its first lines."""
    program = tmp_path_factory.mktemp("importer") / "importer"
    compiler = os.environ.get("CC") or next(
        found for name in ("cc", "gcc", "clang") if (found := shutil.which(name))
    )
    headers = Path(fmpy.__file__).parent / "c-code"
    done = subprocess.run(
        [
            compiler,
            "-std=gnu11",
            "-Wall",
            "-Werror",
            str(SOURCE),
            "-I",
            str(headers),
            "-ldl",
            "-o",
            str(program),
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return program


def run(*command: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(word) for word in command], capture_output=True, text=True, check=False
    )


def test_the_recorded_walk_lifts_and_sets_down_feet(walk: ReferenceRun) -> None:
    contact = walk.reference.columns(
        [f"{leg}.foot.contact" for leg in ("LF", "LM", "LR", "RF", "RM", "RR")]
    )
    changes = np.diff(contact, axis=0)
    assert (changes < 0.0).any()
    assert (changes > 0.0).any()


def test_our_master_and_fmpy_give_the_same_walk(walk: ReferenceRun) -> None:
    assert largest_difference(walk.recorded, walk.reference)[0] <= ROUND_OFF


def test_a_delay_of_one_step_exceeds_round_off(walk: ReferenceRun) -> None:
    commands = read_csv(walk.inputs)
    late = np.vstack([commands.data[:1], commands.data[:-1]])
    late[:, 0] = commands.time
    folder = walk.folder / "late"
    folder.mkdir()
    delayed = dataclasses.replace(walk, inputs=folder / "inputs.csv")
    write_csv(Recording(commands.names, late), delayed.inputs)
    found = delayed.replay(walk.recorded.time, np.full(len(walk.recorded.time), STEP))
    assert largest_difference(found, walk.reference)[0] > 1e6 * ROUND_OFF


def test_the_c_importer_walks_as_fmpy_does(
    walk: ReferenceRun, importer: Path, tmp_path: Path
) -> None:
    done = run(importer, walk.unpacked, walk.inputs)
    assert done.returncode == 0, done.stderr
    (tmp_path / "outputs.csv").write_text(done.stdout, encoding="utf-8")
    found = read_csv(tmp_path / "outputs.csv")
    # the importer reads outputs after it has set the inputs of the next step, which act directly on
    # torques and accelerations but not on positions
    names = [
        name
        for name in found.names
        if name.endswith((".angle", ".speed", ".foot.normal_force")) or name.startswith("torso.")
    ]
    reference = walk.reference.columns(names)
    scale = np.maximum(np.abs(reference).max(axis=0), 1e-3)
    assert len(names) > 40
    assert found.time == pytest.approx([0.0, *walk.reference.time], abs=1e-12)
    assert np.abs(found.columns(names)[1:] - reference).max(axis=0) / scale == pytest.approx(
        0.0, abs=ROUND_OFF
    )


def test_the_c_importer_has_the_lines_that_the_readme_says() -> None:
    lines = SOURCE.read_text(encoding="utf-8").splitlines()
    assert len(lines) <= MOST_LINES
    assert f"a C program of {MOST_LINES} lines" in README.read_text(encoding="utf-8")


def test_the_c_importer_refuses_a_short_row_and_takes_names_without_quotes(
    walk: ReferenceRun, importer: Path, tmp_path: Path
) -> None:
    commands = tmp_path / "commands.csv"
    commands.write_text(
        "time,LF.coxa.angle_ref,LM.coxa.angle_ref\n0,0.1,0.1\n0.005,0.1\n", encoding="utf-8"
    )
    done = run(importer, walk.unpacked, commands)
    assert done.returncode == 1
    assert "a row of too few commands" in done.stderr
    assert len(done.stdout.splitlines()) == 3  # names, and the rows before each of two steps


@pytest.mark.parametrize(
    ("words", "said"), [((), "modelDescription.xml"), (("no_such_folder",), "folder")]
)
def test_the_c_importer_reports_missing_files(
    importer: Path, tmp_path: Path, words: tuple[str, ...], said: str
) -> None:
    done = subprocess.run(
        [str(importer), *words], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert said in done.stderr


def test_fmpy_tunes_is_told_between_and_gets_adjoint_derivatives(
    plant_build: Path, walk: ReferenceRun, tmp_path: Path
) -> None:
    fmu3 = export_fmu(load_robot("athena"), tmp_path / "athena.fmu", fmi=3)
    for found in (tuned(walk.fmu, fmu3), updated(fmu3), adjoint(fmu3)):
        assert found.agrees, found
