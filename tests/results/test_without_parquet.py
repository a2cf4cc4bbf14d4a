"""Without pyarrow, which the extras `parquet` and `studies` bring, everything but Parquet works."""

from __future__ import annotations

from pathlib import Path

import pytest
from command import QUICK, Call, assert_refused

from hexapod_cosim.cosim.common import installation
from hexapod_cosim.cosim.results.folder import read_result
from hexapod_cosim.cosim.results.recordings import read_parquet
from hexapod_cosim.models import HexapodError


@pytest.fixture(autouse=True)
def _without_pyarrow(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(installation, "find_spec", lambda name: None)


def test_a_run_is_recorded_as_csv_and_its_report_is_made_again(call: Call, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    assert call("simulate", "stand", "-o", folder, *QUICK)[0] == 0
    assert {path.name for path in folder.glob("results.*")} == {"results.csv"}
    assert len(read_result(folder).view.recording.time) == 41
    assert call("report", folder)[0] == 0
    assert (folder / "report.html").is_file()


def test_parquet_is_refused_before_the_run_and_the_extra_named(call: Call, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    outcome = call("simulate", "stand", "--format", "parquet", "-o", folder, *QUICK)
    assert_refused(outcome, "got 'no pyarrow'", "outputs.formats", "WHEEL.whl[parquet]")
    assert not folder.exists()


def test_a_parquet_file_cannot_be_read_and_the_extra_is_named(tmp_path: Path) -> None:
    with pytest.raises(HexapodError, match=r"results.parquet.*got 'no pyarrow'.*\[parquet\]"):
        read_parquet(tmp_path / "results.parquet")
