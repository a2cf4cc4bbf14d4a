"""The hexapod command answers every mistake with one clear paragraph."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from command import Call, assert_refused

from hexapod_cosim.cosim.cli import main
from hexapod_cosim.models import load_robot


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["simulate", "walk_flt"], ["unknown scenario", "did you mean 'walk_flat'"]),
        (
            ["simulate", "--set", "gait.periode=1"],
            ["--set gait.periode: ", "did you mean 'period'"],
        ),
        (["simulate", "--set", "macro_step=-0.005"], ["macro_step", "got -0.005", "> 0"]),
        (["simulate", "--control", "complaint"], ["'complaint'", "did you mean 'compliant'"]),
        (["simulate", "--set", "torso.mas=3"], ["'torso.mas'", "did you mean 'torso.mass'"]),
        (
            ["simulate", "--set", "torso.push_force[1]=100"],
            ["--set torso.push_force[1]: not a parameter", "an input", "[[events]]"],
        ),
        (
            ["simulate", "--set", "outputs.csv=['torso.rol']"],
            ["outputs.csv", "did you mean 'torso.roll'"],
        ),
        (["simulate", "--gains", "missing.toml"], ["cannot read the gains", "missing.toml"]),
        (["simulate", "--fmu", "missing.fmu"], ["no such FMU", "missing.fmu", "hexapod export"]),
        (["compare", "--seeds", "0"], ["--seeds: ", "got 0", "1 to"]),
        (
            ["simulate", "--set", "friction.mu=0.4mm"],
            ["got '0.4mm'", "a number without a unit", "write a plain number"],
        ),
        (["design", "--set", "phase_margin=500"], ["phase_margin: ", "got 500", "< 180 [deg]"]),
        (["validate", "missing.fmu"], ["no such FMU"]),
        (["export", "--robot", "atena"], ["unknown robot", "did you mean 'athena'"]),
        (
            ["simulate", "--set", "command.vx=10 m/s"],
            ["walk_flat.toml: command: ", "got 'vx = 10 m/s'", "at most vx = 0.6", "tripod"],
        ),
        (["simulate", "--set", "duration=1e9"], ["too many macro-steps", "5000 s"]),
        (
            ["export", "-o", "a.urdf", "--fmi", "3", "--controller", "compliant"],
            ["options that do nothing for a robot's description", "got '--fmi --controller'"],
        ),
        (
            ["export", "--period", "0.005"],
            ["do nothing for the plant's FMU", "got '--period'", "--controller kinematic"],
        ),
        (["export", "-o", "."], ["got '.'", "ends in .fmu", "write -o athena.fmu"]),
        (["export", "--fmi", "7"], ["FMI version", "got 7"]),
        (["simulate", "--format", "hdf5"], ["--format: unknown format", "got 'hdf5'", "parquet"]),
        (["export", "--platforms", "amiga"], ["amiga"]),
        (["list", "robot"], ["'robot'", "did you mean 'robots'"]),
        (["compare", "--seeds", "x"], ["Invalid value 'x' for '--seeds'", "compare --help"]),
        (
            ["simulate", "--set", "duration", "3"],
            ["--set: not a setting", "got 'duration'", "write duration=VALUE"],
        ),
        (
            ["simulate", "--set", "gait=ripple"],
            ["got 'gait=ripple'", "gait.KEY=VALUE", "write gait.name=ripple"],
        ),
        (
            ["simulate", "athena.fmu"],
            ["an FMU is no scenario", "got 'athena.fmu'", "write --fmu athena.fmu"],
        ),
    ],
)
def test_a_mistake_gets_one_clear_paragraph(
    call: Call,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    parts: list[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert_refused(call(*arguments), *parts)
    assert not list(tmp_path.rglob("results*"))
    assert not list(tmp_path.rglob("*.fmu"))


@pytest.mark.parametrize(
    ("text", "place"),
    [
        (b"name = ", "1:8"),
        (b'[gait]\nname = "ripple\n', "2:15"),
        (b"[gait]\nperiod = [1,\n", "3:1"),
        (b"duration = 1\nduration = 2\n", "2:13"),
        (b"duration = 1\ntitle = '\xff'\n", "2:10"),
    ],
    ids=["value", "quote", "end", "twice", "encoding"],
)
@pytest.mark.parametrize(
    "words", [["simulate"], ["design", "--robot"], ["simulate", "--gains"]], ids=" ".join
)
def test_a_broken_toml_file_is_named_with_line_and_column(
    call: Call, tmp_path: Path, words: list[str], text: bytes, place: str
) -> None:
    path = tmp_path / "broken.toml"
    path.write_bytes(text)
    assert_refused(call(*words, path), f"{path}: not a TOML file", f"correct it at {path}:{place}")


def test_a_command_without_its_sub_command_shows_its_help(call: Call) -> None:
    code, out, err = call("controller")
    assert (code, out) == (2, "")
    assert err.startswith("Usage: hexapod controller [OPTIONS] COMMAND [ARGS]...\n")


def test_a_file_of_another_format_is_named_with_its_format(
    call: Call, tmp_path: Path, athena_fmu: Path
) -> None:
    (tmp_path / "arm.xml").write_text("<mujoco/>")
    expected = "a ZIP file, such as an FMU"
    gains = ["simulate", "--gains", athena_fmu]
    assert_refused(call(*gains), expected, "give the path of a gains file")
    assert_refused(
        call("export", "--robot", tmp_path / "arm.xml"),
        "got 'an XML file, such as a URDF without the ending .urdf or a MuJoCo model'",
        "give the path of a robot file",
    )


def test_an_unwritable_place_is_refused_before_the_run(call: Call, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    assert_refused(call("simulate", "-o", tmp_path / "file" / "out"), "cannot write", "-o")
    assert_refused(call("simulate", "-o", tmp_path / "file"), "cannot write")
    assert_refused(call("design", "-o", tmp_path / "file"), "cannot write")
    assert_refused(call("export", "-o", tmp_path / "file" / "a.fmu"), "cannot write")


def test_a_folder_named_like_an_fmu_is_refused_and_left_alone(call: Call, tmp_path: Path) -> None:
    folder = tmp_path / "athena.fmu"
    folder.mkdir()
    assert_refused(call("export", "-o", folder), "ends in .fmu", str(folder / "athena.fmu"))
    assert list(tmp_path.iterdir()) == [folder]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["simulate", "mine"], "mine: cannot read the scenario: got 'Is a directory'; give the"),
        (["export", "--robot", "mine"], "mine: cannot read the robot file: got 'Is a directory'"),
    ],
)
def test_a_folder_in_the_place_of_a_file_is_called_a_folder(
    call: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], message: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine").mkdir()
    assert_refused(call(*arguments), message)
    (tmp_path / "athena").mkdir()  # no obstacle to the package's own names
    assert load_robot("athena").name == "athena"


def test_a_folder_of_someone_elses_files_is_left_alone(call: Call, tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("precious")
    assert_refused(call("compare", "-o", tmp_path), "the folder holds other files", "thesis.tex")
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


def test_a_foreign_fmu_is_refused(call: Call, tmp_path: Path, athena_fmu: Path) -> None:
    arguments = ["simulate", "phantomx_walk", "--fmu", athena_fmu, "-o", tmp_path / "out"]
    assert_refused(
        call(*arguments), "the FMU holds another robot: torso.mass", "got 2.6", "hexapod export"
    )
    (tmp_path / "plain.fmu").write_text("no archive")
    assert_refused(
        call("simulate", "--fmu", tmp_path / "plain.fmu", "-o", tmp_path / "out"),
        "not an FMU",
        "plain.fmu",
    )


def test_an_unexpected_error_is_one_line_with_a_hint(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    def burst(*_: object, **__: object) -> None:
        raise ZeroDivisionError("by nought")

    monkeypatch.setattr("hexapod_cosim.cosim.cli.scenario_runs.load_scenario", burst)
    assert_refused(call("simulate"), "unexpected ZeroDivisionError: by nought", "--debug")
    with pytest.raises(ZeroDivisionError):
        main(["--debug", "simulate"])


# with --json: the same paragraph on stderr, and an object on stdout


@pytest.mark.parametrize(
    ("arguments", "code", "expected"),
    [
        (
            ["simulate", "walk_flt"],
            1,
            {
                "what": "unknown scenario",
                "got": "walk_flt",
                "fix": "did you mean 'walk_flat'?",
                "where": None,
            },
        ),
        (
            ["simulate", "--set", "macro_step=0"],
            1,
            {"got": 0, "expected": "a finite number > 0 and <= 0.1 [s]"},
        ),
        (
            ["simulate", "--speed", "3"],
            2,
            {
                "what": "not understood",
                "got": "No such option: --speed (Possible options: --set)",
                "fix": "write --set command.vx=0.12; `hexapod simulate --help` explains it",
            },
        ),
        (
            ["compare", "--seeds", "0"],
            1,
            {"got": 0, "expected": "1 to 10000", "fix": "write --seeds 10", "where": "--seeds"},
        ),
        (
            ["simulat"],
            2,
            {"what": "not understood", "got": "simulat", "fix": "did you mean 'simulate'?"},
        ),
        (["controller", "old"], 2, {"got": "old", "expected": "one of new"}),
        (
            ["simulate", "--robot", "my.toml"],
            2,
            {"fix": "write --set robot=athena; `hexapod simulate --help` explains it"},
        ),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_with_json_an_error_is_an_object_on_stdout_and_the_paragraph_on_stderr(
    call: Call,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    code: int,
    expected: dict[str, object],
) -> None:
    monkeypatch.chdir(tmp_path)
    returned, out, err = call(*arguments, "--json")
    printed = json.loads(out)
    assert returned == code
    assert {"error", "what", "got", "expected", "fix", "where", "exit_code"} <= printed.keys()
    assert printed["exit_code"] == code
    assert err == f"hexapod: {printed['error']}\n"
    assert all(
        part in printed["error"]
        for part in (printed["what"], printed["expected"] or "", printed["fix"] or "")
    )
    assert {key: printed[key] for key in expected} == expected


def test_with_json_an_interrupt_is_an_object_too(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("hexapod_cosim.cosim.cli.scenario_runs.load_scenario", interrupted)
    code, out, err = call("simulate", "--json")
    assert (code, err) == (130, "hexapod: interrupted\n")
    assert json.loads(out)["exit_code"] == 130
