"""Exported FMUs in the stance that compliant control chooses, and the plant that stands in it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from command import Call

from hexapod_cosim.cosim.control.fmu_walk import walk_of_fmu
from hexapod_cosim.cosim.interface.names import joint_names, vector_names
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.run.single_run import simulate
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.models import load_robot

# a walk that names neither gait nor stance
SCENARIO = 'title = "level"\nduration = 2.0\n[command]\nvx = 0.08\n'
TORSO = (*vector_names("torso.position"), *vector_names("torso.quaternion", 4))


def exported(call: Call, path: Path, *options: object) -> Path:
    code, _, errors = call("export", "-o", path, *options)
    assert code == 0, errors
    return path


def test_an_exported_controller_walks_as_the_built_in_one(
    call: Call, tmp_path: Path, plant_build: Path
) -> None:
    chosen = ("--controller", "compliant", "--stance", "chosen", "--fmi", 3)
    path = exported(call, tmp_path / "controller.fmu", *chosen)
    (tmp_path / "level.toml").write_text(SCENARIO, encoding="utf-8")
    built_in, by_fmu = (
        simulate(load_scenario(tmp_path / "level.toml", overrides=[f"control={control}"]))
        for control in ("compliant", str(path))
    )
    walking = by_fmu.facts.walking
    assert (walking.gait, walking.stance) == ("amble", "controller FMU")
    assert walking.period == pytest.approx(1.5)
    expected, found = (run.outcome.recording.columns(TORSO) for run in (built_in, by_fmu))
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-9)


def test_the_plant_is_exported_in_the_same_stance(
    call: Call, tmp_path: Path, plant_build: Path
) -> None:
    controller = exported(
        call, tmp_path / "c.fmu", "--controller", "compliant", "--stance", "chosen"
    )
    stance = np.array(walk_of_fmu(controller).stance)
    own = np.array(load_robot("athena").stance)
    assert np.abs(stance - own).max() > 0.05  # rad
    with Fmu(exported(call, tmp_path / "p.fmu", "--stance", "chosen")) as plant:
        plant.initialise(0.0, 1.0)
        angles = plant.block(joint_names("angle"))
        angles.get()
        # the robot stands settled: its servos give way under its weight
        np.testing.assert_allclose(angles.values.reshape(6, 3), stance, rtol=0.0, atol=0.03)


def test_an_unknown_stance_is_refused(call: Call, tmp_path: Path) -> None:
    code, _, errors = call("export", "-o", tmp_path / "p.fmu", "--stance", "choosen")
    assert code == 1
    assert "unknown stance" in errors
    assert "did you mean 'chosen'" in errors
    assert not (tmp_path / "p.fmu").exists()
