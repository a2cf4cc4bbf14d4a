"""The loop with the plant's FMU: blocks of variables, a walk, and what is refused."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest

from hexapod_cosim.cosim.interface.names import joint_names
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.master.fmu_block import StepError
from hexapod_cosim.cosim.master.loop import COMPLETED
from hexapod_cosim.cosim.results.facts import Result
from hexapod_cosim.cosim.run.plant import apply_settings
from hexapod_cosim.cosim.run.single_run import simulate
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.models import FmuError, load_robot

SHORT = ("duration=0.5", "outputs.plots=false")


def scenario_of(*settings: str) -> Scenario:
    return load_scenario("walk_flat", overrides=settings)


def test_a_block_of_several_types_is_refused(athena_fmu: Path) -> None:
    message = r"connected variables of several types: got \['Enumeration', 'Real'\]"
    with Fmu(athena_fmu) as plant, pytest.raises(FmuError, match=message):
        plant.block(["torso.mass", "friction.law"])


def test_a_block_fills_the_buffer_it_is_given(athena_fmu: Path) -> None:
    names = joint_names("angle")
    with Fmu(athena_fmu) as plant:
        plant.initialise(0.0, 1.0)
        own, row = plant.block(names), np.full(40, np.nan)
        given = plant.block(names, row[3:21])
        own.get()
        given.get()
        np.testing.assert_array_equal(row[3:21], own.values)
        assert np.isnan(row[:3]).all()
        assert np.isnan(row[21:]).all()


@pytest.fixture(scope="module")
def walked(plant_build: Path) -> Result:
    return simulate(scenario_of(*SHORT))


def test_the_robot_sets_out_and_stays_up(walked: Result) -> None:
    assert walked.outcome.status == COMPLETED
    assert walked.facts.walk.upright
    position = walked.outcome.recording.vector("torso.position")
    assert position[-1, 0] - position[0, 0] > 0.002  # m: half a second, most of it ramp


def test_a_given_fmu_of_the_robot_walks_like_the_exported_one(
    walked: Result, athena_fmu: Path
) -> None:
    again = simulate(scenario_of(*SHORT), fmu=athena_fmu)
    np.testing.assert_array_equal(again.outcome.recording.data, walked.outcome.recording.data)


def test_the_fmu_of_another_robot_is_refused(athena_fmu: Path) -> None:
    with (
        Fmu(athena_fmu) as plant,
        pytest.raises(
            FmuError, match=r"the FMU holds another robot: torso\.mass: got 2\.6, expected 1\.52"
        ),
    ):
        apply_settings(plant, load_robot("phantomx_mk4"))


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (
            {"torso.mas": 1.0},
            "the FMU has no such variable: got 'torso.mas'; did you mean 'torso.mass'",
        ),
        (
            {"LF.coxa.angle": 1.0},
            "not a parameter: got 'LF.coxa.angle', expected a parameter, and this is an output",
        ),
        ({"torso.mass": -1.0}, r"athena.fmu: torso.mass: got -1"),
        (
            {"torso.mass": "heavy"},
            "parameter torso.mass is refused: got 'heavy', expected a number",
        ),
        ({"torso.mass": True}, "parameter torso.mass is refused: got True, expected a number"),
        ({"torso.mass": np.int64(-3)}, r"athena.fmu: torso.mass: got -3, expected a finite number"),
        (
            {"contact.law": "herz"},
            "unknown choice for contact.law: got 'herz'.*did you mean 'hertz'",
        ),
    ],
)
def test_a_wrong_parameter_is_refused_by_name(
    athena_fmu: Path, values: dict[str, object], message: str
) -> None:
    with Fmu(athena_fmu) as plant, pytest.raises(FmuError, match=message):
        plant.set_parameters(values)


@pytest.mark.parametrize("h", [-0.005, float("nan")])
def test_an_impossible_step_is_refused_with_the_fmus_message(athena_fmu: Path, h: float) -> None:
    with Fmu(athena_fmu) as plant:
        plant.initialise(0.0, 1.0)
        with pytest.raises(StepError, match=r"the step from 0 s: got '.+'"):
            plant.step(0.0, h)


def test_a_robot_that_cannot_be_is_refused_at_initialisation(athena_fmu: Path) -> None:
    with Fmu(athena_fmu) as plant:
        plant.set_parameters({"torso.inertia_xx": 10.0})
        with pytest.raises(FmuError, match="inertia"):
            plant.initialise(0.0, 1.0)


def make_zip(path: Path, members: dict[str, str]) -> Path:
    with zipfile.ZipFile(path, "w") as archive:
        for name, text in members.items():
            archive.writestr(name, text)
    return path


def test_what_is_no_fmu_is_refused_before_anything_is_loaded(
    tmp_path: Path, athena_fmu: Path
) -> None:
    plain = tmp_path / "plain.fmu"
    plain.write_text("no archive")
    with zipfile.ZipFile(athena_fmu) as archive:
        description = archive.read("modelDescription.xml").decode("utf-8")
    cases = {
        "no such FMU": tmp_path / "missing.fmu",
        "not an FMU": plain,
        "not an FMU: got .There is no item": make_zip(tmp_path / "empty.fmu", {"other.txt": ""}),
        "cannot be read": make_zip(tmp_path / "broken.fmu", {"modelDescription.xml": "<fmi"}),
        "got 'missing or wrong attributes'": make_zip(
            tmp_path / "old.fmu",
            {"modelDescription.xml": '<fmiModelDescription fmiVersion="1.0" guid="1"/>'},
        ),
        "the FMU cannot be loaded": make_zip(
            tmp_path / "hollow.fmu", {"modelDescription.xml": description}
        ),
    }
    for message, path in cases.items():
        folder = Path.cwd()
        with pytest.raises(FmuError, match=message):
            Fmu(path)
        assert Path.cwd() == folder
