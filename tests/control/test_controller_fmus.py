"""Tests controller FMUs, ours of FMI 2 and 3 and a foreign one: connection by names, walks, the
stance that they choose, and messages of each.
"""

from __future__ import annotations

import gc
import shutil
from pathlib import Path

import numpy as np
import pytest
from command import Call

from hexapod_cosim.cosim.control.fmu_law import stance_and_gait
from hexapod_cosim.cosim.export.plant import export_controller
from hexapod_cosim.cosim.interface.names import joint_names, vector_names
from hexapod_cosim.cosim.master.connection import connect, names_of_map, read_map
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.master.fmu_block import FmuVariable, StepError
from hexapod_cosim.cosim.run.plan import make_setup
from hexapod_cosim.cosim.run.runner import Runner
from hexapod_cosim.cosim.run.single_run import simulate
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.models import FmuError, load_robot

EXAMPLES = Path(__file__).resolve().parents[2] / "examples" / "controllers"
ANGLES = joint_names("angle_ref")


def real(name: str, causality: str = "output", size: int = 1) -> FmuVariable:
    return FmuVariable(name, causality, True, False, size)


def flag(name: str, causality: str) -> FmuVariable:
    return FmuVariable(name, causality, False, True, 1)


@pytest.fixture(scope="module")
def ours(tmp_path_factory: pytest.TempPathFactory, plant_build: Path) -> dict[int, Path]:
    """Our controller's FMU under kinematic control, by version of FMI."""
    folder = tmp_path_factory.mktemp("ours")
    setup = make_setup(load_robot("athena"), control="kinematic", period=0.005)
    return {fmi: export_controller(setup, folder / f"fmi{fmi}.fmu", fmi=fmi) for fmi in (2, 3)}


@pytest.fixture(scope="module")
def foreign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An FMU of pythonfmu, with the table of its names beside it."""
    from pythonfmu.builder import FmuBuilder  # noqa: PLC0415  a dependency of this test alone

    folder = tmp_path_factory.mktemp("foreign")
    FmuBuilder.build_FMU(EXAMPLES / "stride.py", dest=folder)
    shutil.copy(EXAMPLES / "Stride.toml", folder)
    return folder / "Stride.fmu"


def test_equal_names_are_connected_and_all_others_are_left_alone() -> None:
    variables = [
        real("LF.coxa.angle", "input"),
        real("command.vx", "input"),
        flag("LM.foot.contact", "input"),
        real("temperature", "input"),
        real("torso.position[1]", "input"),
        *map(real, ANGLES),
        real("mood"),
    ]
    found = connect(variables, {}, torque=False, where="test")
    assert found.inputs == [("LF.coxa.angle", ["LF.coxa.angle"]), ("command.vx", ["command.vx"])]
    assert found.flag_inputs == [("LM.foot.contact", ["LM.foot.contact"])]
    assert [theirs for theirs, _ in found.outputs] == ANGLES
    assert found.unconnected == ("temperature", "torso.position[1]")
    assert found.diagnostics == found.flags == []
    assert not found.is_scalar


def test_an_array_of_fmi_3_is_connected_as_a_whole() -> None:
    found = connect([real("q", size=18)], {"angle_ref": "q"}, torque=False, where="test")
    assert found.outputs == [("q", ANGLES)]
    assert not found.is_scalar


def test_a_table_with_places_for_leg_and_joint_names_all_joints() -> None:
    table = names_of_map({"{leg}.{joint}.angle_ref": "q_{leg}_{joint}"}, where="test")
    assert len(table) == 18
    assert table["RM.tibia.angle_ref"] == "q_RM_tibia"
    found = connect([real(name) for name in table.values()], table, torque=False, where="test")
    assert found.outputs[0] == ("q_LF_coxa", ["LF.coxa.angle_ref"])


def test_a_missing_joint_angle_is_named_with_what_the_fmu_has() -> None:
    variables = [real(name) for name in ANGLES if name != "RM.femur.angle_ref"]
    with pytest.raises(FmuError, match=r"no RM.femur.angle_ref; its outputs are LF.coxa.angle_ref"):
        connect(variables, {}, torque=False, where="test")
    torques = [real(name) for name in joint_names("torque_ref")]
    with pytest.raises(FmuError, match=r"no LF.coxa.angle_ref and 17 more"):
        connect(torques, {}, torque=False, where="test")
    assert len(connect(torques, {}, torque=True, where="test").outputs) == 18


def test_a_table_with_a_wrong_name_is_refused() -> None:
    with pytest.raises(FmuError, match=r"not a name of a measurement.*'LF.coxa.angle_ref'"):
        names_of_map({"LF.coxa.angel_ref": "q"}, where="test")
    with pytest.raises(FmuError, match="the map names a variable that the FMU lacks, for command"):
        connect([real("v", "input")], {"command.vx": "w"}, torque=False, where="test")


def test_a_file_without_a_table_beside_it_maps_nothing(tmp_path: Path) -> None:
    assert read_map(tmp_path / "x.fmu") == {}
    (tmp_path / "x.toml").write_text("[map\n")
    with pytest.raises(FmuError, match="not a TOML file"):
        read_map(tmp_path / "x.fmu")


@pytest.mark.parametrize("fmi", [2, 3])
def test_our_exported_controller_repeats_the_walk_of_the_built_in_control(
    fmi: int, ours: dict[int, Path]
) -> None:
    settings = ["duration=1", "sensors.foot_force_noise=0.1", "sensors.foot_force_delay=0.01"]
    reference = simulate(load_scenario("walk_flat", overrides=settings))
    given = simulate(load_scenario("walk_flat", overrides=[*settings, f"control={ours[fmi]}"]))
    assert given.recording.names == reference.recording.names
    # the two implementations agree to 1e-12 of a joint command; friction amplifies round-off
    assert np.abs(given.recording.data - reference.recording.data).max() < 1e-4
    assert given.facts.controller["kind"] == "fmu"


def test_the_loop_in_c_gives_the_same_bits_as_the_loop_in_python(
    ours: dict[int, Path], foreign: Path
) -> None:
    with Runner(everything=True) as runner:
        for path in (ours[2], foreign):
            plan = load_scenario("push", overrides=["duration=0.6", f"control={path}"])
            slow, fast = simulate(plan), runner.simulate(plan)
            assert fast.completed
            assert set(fast.recording.names) == set(slow.recording.names)
            same = fast.recording.columns(slow.recording.names)
            assert np.array_equal(same, slow.recording.data)


def test_a_foreign_controller_walks_and_takes_its_parameters(foreign: Path) -> None:
    settings = ["duration=2.5", f"control={foreign}"]
    plain = simulate(load_scenario("walk_flat", overrides=settings))
    slow = simulate(load_scenario("walk_flat", overrides=[*settings, "control.frequency=0.5"]))
    way = plain.recording.vector("torso.position")[-1, 0]
    assert way > 0.1
    assert slow.recording.vector("torso.position")[-1, 0] != pytest.approx(way, abs=1e-3)
    assert not any(name.startswith("controller.") for name in plain.recording.names)


def test_an_fmu_that_does_not_command_joints_is_refused(athena_fmu: Path) -> None:
    plan = load_scenario("walk_flat", overrides=[f"control={athena_fmu}"])
    with pytest.raises(FmuError, match="the controller FMU does not command every joint"):
        simulate(plan)


# Exported FMUs in the stance that compliant control chooses, and the plant that stands in it.

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
    stance = np.array(stance_and_gait(controller).stance)
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


# Errors of each of several FMUs in one process carry the messages of that FMU.

LONG = (1.5, 2.5)  # s    steps over the end


def test_each_fmu_reports_its_own_errors_alone_and_after_another_is_gone(athena_fmu: Path) -> None:
    with Fmu(athena_fmu) as first:
        with Fmu(athena_fmu) as second:
            for fmu, h in zip((first, second), LONG, strict=True):
                fmu.initialise(0.0, 1.0)
                with pytest.raises(StepError, match=f"got {h:g} s"):
                    fmu.step(0.0, h)
        gc.collect()
        with pytest.raises(StepError, match=r"got 1\.5 s"):
            first.step(0.0, LONG[0])
