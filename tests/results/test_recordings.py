"""Recordings as files: the same bits from Parquet and CSV, units of columns, commands for
importers.
"""

from __future__ import annotations

import csv
from pathlib import Path

import fmpy
import numpy as np
import pyarrow.csv
import pyarrow.parquet
import pytest
from command import QUICK, Call, assert_refused
from fmpy.util import read_csv as fmpy_read_csv

from hexapod_cosim.cosim.common import installation
from hexapod_cosim.cosim.interface.descriptions import read_description
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.results.columns import heading, known_columns
from hexapod_cosim.cosim.results.folder import RESULTS, read_result
from hexapod_cosim.cosim.results.recordings import (
    read_csv,
    read_parquet,
    read_recording,
    write_csv,
    write_parquet,
    write_recording,
)
from hexapod_cosim.models import HexapodError

AWKWARD = [
    0.0,
    -0.0,
    1.0,
    1.0 / 3.0,
    0.1,
    -1e-300,
    5e-324,
    1.7976931348623157e308,
    123456789.123456789,
    np.nan,
    np.inf,
    -np.inf,
]
TABLES = {"csv": read_csv, "parquet": read_parquet}


@pytest.fixture(scope="module")
def folder(plant_build: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Runs a short compliant walk with `hexapod simulate`."""
    from hexapod_cosim.cosim.cli import main  # noqa: PLC0415

    folder = tmp_path_factory.mktemp("recorded") / "out"
    assert main(["simulate", "walk_flat", "--control", "compliant", "-o", str(folder), *QUICK]) == 0
    return folder


def numbers() -> Recording:
    rng = np.random.default_rng(1)
    # any double there is
    bits = rng.integers(0, 2**64, (1000, 3), dtype=np.uint64).view(np.float64)
    data = np.vstack([np.tile(AWKWARD, (3, 1)).T, np.where(np.isnan(bits), np.nan, bits)])
    return Recording(("time", "torso.position[1]", "LF.foot.contact"), data)


@pytest.mark.parametrize("kind", TABLES)
def test_every_number_reads_back_the_same_bits(tmp_path: Path, kind: str) -> None:
    recording = numbers()
    (path,) = write_recording(recording, tmp_path, "results", formats=[kind])
    again = TABLES[kind](path)
    assert again.names == recording.names
    assert again.data.tobytes() == recording.data.tobytes()
    assert list(tmp_path.iterdir()) == [path]


def test_every_column_of_a_run_has_a_unit_and_a_meaning(folder: Path) -> None:
    assert set(read_parquet(folder / "results.parquet").names) <= set(known_columns())
    schema = pyarrow.parquet.read_schema(folder / "results.parquet")
    assert all(field.metadata[b"unit"] and field.metadata[b"description"] for field in schema)


def test_the_header_of_the_csv_file_names_the_units(folder: Path) -> None:
    with (folder / "results.csv").open(encoding="utf-8", newline="") as file:
        header = next(csv.reader(file))
    assert header[0] == "time [s]"
    assert {
        "torso.position[1] [m]",
        "solver.steps [1]",
        "LF.coxa.torque [N.m]",
        "LF.foot.contact [1]",
    } <= set(header)
    assert header == [heading(name) for name in read_parquet(folder / "results.parquet").names]


def test_the_commands_are_the_fmus_inputs_under_their_own_names(
    folder: Path, athena_fmu: Path
) -> None:
    commands, variables = (
        read_csv(folder / "commands.csv"),
        read_description(athena_fmu).modelVariables,
    )
    inputs = [one.name for one in variables if one.causality == "input"]
    faults = [name for name in inputs if name.endswith((".weakness", ".lock"))]
    assert len(faults) == 36  # of servos, which this walk does not set
    assert commands.names == ("time", *(name for name in inputs if name not in faults))
    assert fmpy_read_csv(folder / "commands.csv").dtype.names == commands.names
    assert np.array_equal(commands.data, read_csv(folder / "results.csv").columns(commands.names))


def test_fmpy_with_the_recorded_commands_walks_the_recorded_walk(
    folder: Path, athena_fmu: Path
) -> None:
    walk, height = fmpy_read_csv(folder / "commands.csv"), "torso.position[3]"
    result = fmpy.simulate_fmu(
        str(athena_fmu), stop_time=0.2, output_interval=0.005, input=walk, output=[height]
    )
    assert result[height] == pytest.approx(
        read_recording(folder, RESULTS).column(height), abs=1e-12
    )


@pytest.mark.parametrize("units", [True, False], ids=["units", "bare"])
def test_both_headers_are_read(tmp_path: Path, units: bool) -> None:
    recording = Recording(("time", "torso.position[1]", "made.up[2]"), np.array([[0.0, 1.0, 2.0]]))
    write_csv(recording, tmp_path / "a.csv", units=units)
    assert ("[m]" in (tmp_path / "a.csv").read_text()) == units
    assert read_csv(tmp_path / "a.csv").names == recording.names


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.csv", "", "not a recording"),
        ("a.csv", "x,y\n1,2\n", "time first"),
        ("a.csv", "time,x\n1\n", "expected 2 columns, got 1"),
        ("a.csv", "time,x\n1,two\n", "two"),
        ("a.csv", "time,x\n1,\n", "not a recording"),
        ("a.parquet", "no table", "not a recording"),
        ("a.parquet", "", "not a recording"),
    ],
)
def test_a_file_that_is_no_recording_is_refused(
    tmp_path: Path, name: str, text: str, said: str
) -> None:
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    with pytest.raises(HexapodError, match=said) as refused:
        TABLES[path.suffix[1:]](path)
    assert str(path) in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("kind", TABLES)
def test_a_missing_file_is_refused(tmp_path: Path, kind: str) -> None:
    with pytest.raises(HexapodError, match=r"no recording.*hexapod simulate"):
        TABLES[kind](tmp_path / f"results.{kind}")
    with pytest.raises(HexapodError, match=r"results.parquet or results.csv"):
        read_recording(tmp_path, "results")


def test_a_recording_without_rows_is_one(tmp_path: Path) -> None:
    empty = Recording(("time", "torso.roll"), np.zeros((0, 2)))
    write_parquet(empty, tmp_path / "a.parquet", about={})
    write_csv(empty, tmp_path / "a.csv")
    assert (
        read_parquet(tmp_path / "a.parquet").data.shape
        == read_csv(tmp_path / "a.csv").data.shape
        == (0, 2)
    )


@pytest.mark.parametrize(
    ("formats", "left"),
    [("['parquet']", {"results.parquet"}), ("['csv']", {"results.csv", "commands.csv"})],
)
def test_formats_can_be_chosen_and_either_is_read_back(
    call: Call, tmp_path: Path, formats: str, left: set[str]
) -> None:
    folder = tmp_path / "out"
    assert (
        call("simulate", "stand", "-o", folder, *QUICK, "--set", f"outputs.formats={formats}")[0]
        == 0
    )
    assert {path.name for path in folder.iterdir()} == {
        "metrics.json",
        "run.json",
        "scenario.toml",
    } | left
    assert len(read_result(folder).view.recording.time) == 41


# without pyarrow, which the extras `parquet` and `studies` bring, all but Parquet works


@pytest.fixture
def without_pyarrow(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(installation, "find_spec", lambda name: None)


@pytest.mark.usefixtures("without_pyarrow")
def test_a_run_is_recorded_as_csv_and_its_report_is_made_again(call: Call, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    assert call("simulate", "stand", "-o", folder, *QUICK)[0] == 0
    assert {path.name for path in folder.glob("results.*")} == {"results.csv"}
    assert len(read_result(folder).view.recording.time) == 41
    assert call("report", folder)[0] == 0
    assert (folder / "report.html").is_file()


@pytest.mark.usefixtures("without_pyarrow")
def test_parquet_is_refused_before_the_run_and_the_extra_named(call: Call, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    outcome = call("simulate", "stand", "--format", "parquet", "-o", folder, *QUICK)
    assert_refused(outcome, "got 'no pyarrow'", "outputs.formats", "WHEEL.whl[parquet]")
    assert not folder.exists()


@pytest.mark.usefixtures("without_pyarrow")
def test_a_parquet_file_cannot_be_read_and_the_extra_is_named(tmp_path: Path) -> None:
    with pytest.raises(HexapodError, match=r"results.parquet.*got 'no pyarrow'.*\[parquet\]"):
        read_parquet(tmp_path / "results.parquet")
