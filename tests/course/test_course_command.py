"""The command `hexapod benchmark`: determinism, files, report, mistakes."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from command import Call, assert_refused

from hexapod_cosim.cosim.scenario.controls import parse_controls
from hexapod_cosim.extensions.course.records import load_course
from hexapod_cosim.extensions.course.runs import Run, run_course
from hexapod_cosim.extensions.course.store import read_table

KINEMATIC = ["--control", "kinematic"]
LAWS = parse_controls(["kinematic"], where="test")


@pytest.fixture(scope="module")
def runs(plant_build: Path) -> tuple[Run, ...]:
    course = load_course("tune", names=["rough_10", "turn"], seeds=2)
    return tuple(run_course(course, LAWS, workers=1))


def test_runs_do_not_depend_on_the_number_of_workers(runs: tuple[Run, ...]) -> None:
    course = load_course("tune", names=["rough_10", "turn"], seeds=2)
    parallel = tuple(run_course(course, LAWS, workers=2))
    assert repr(parallel) == repr(runs)
    assert [run.seed for run in runs] == [1000, 1001, 1000, 1001]
    assert all(run.success for run in runs)


def replayed(monkeypatch: pytest.MonkeyPatch, found: tuple[Run, ...]) -> None:
    """Makes the command get finished runs."""

    def again(*_: Any, **__: Any) -> Iterator[Run]:
        yield from found

    monkeypatch.setattr("hexapod_cosim.extensions.course.command.run_course", again)


CHOICE = ["--split", "tune", "--seeds", "2", "--case", "rough_10", "--case", "turn", *KINEMATIC]


def test_the_command_writes_json_runs_and_report(
    call: Call, tmp_path: Path, runs: tuple[Run, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    replayed(monkeypatch, runs)
    code, out, _ = call("benchmark", *CHOICE, "-o", str(tmp_path / "out"), "--json")
    content = json.loads(out)
    assert code == 0
    assert json.loads((tmp_path / "out" / "benchmark.json").read_text()) == content
    assert content["reference"] == "kinematic"
    assert content["course"]["split"] == "tune"
    assert content["seeds"] == [1000, 1001]
    assert list(content["cases"]) == ["rough_10", "turn"]
    rate = content["cases"]["turn"]["controls"]["kinematic"]["success"]
    assert (rate["successes"], rate["runs"]) == (2, 2)
    page = (tmp_path / "out" / "report.html").read_text()
    assert "rough_10, kinematic" in page
    assert page.count("color-mix") > 10
    table, _ = read_table(tmp_path / "out")
    assert repr(table.runs) == repr(runs)
    (tmp_path / "out" / "report.html").unlink()
    assert call("report", str(tmp_path / "out"))[0] == 0
    assert (tmp_path / "out" / "report.html").read_text() == page


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (["--control", "kinematc"], ["unknown control", "kinematic"]),
        (["--split", "train"], ["unknown split", "judge"]),
        (["--case", "rough_11"], ["unknown case", "rough_10"]),
    ],
)
def test_mistakes_are_told_before_anything_is_run(
    call: Call, tmp_path: Path, words: list[str], parts: list[str]
) -> None:
    assert_refused(call("benchmark", *words, "-o", str(tmp_path / "out")), *parts)
    assert not (tmp_path / "out").exists()


def test_an_incomplete_result_and_one_of_another_course_are_refused(
    call: Call, tmp_path: Path, runs: tuple[Run, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    replayed(monkeypatch, runs)
    call("benchmark", *CHOICE, "-o", str(tmp_path / "out"))
    (tmp_path / "out" / "runs.csv").rename(tmp_path / "runs.csv")
    refused = call("report", str(tmp_path / "out"))
    assert_refused(refused, "damaged result: got 'No such file or directory'", "runs.csv")
    (tmp_path / "runs.csv").rename(tmp_path / "out" / "runs.csv")
    path = tmp_path / "out" / "benchmark.json"
    content = json.loads(path.read_text())
    content["course"]["hash"] = "0" * 64
    path.write_text(json.dumps(content))
    assert_refused(call("report", str(tmp_path / "out")), "another course", "run `hexapod")
