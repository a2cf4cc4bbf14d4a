"""The controller FMU is what its description says, takes and refuses calls as an FMU does, and is
exported by a command.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from command import Call
from controller_fmus import outputs, packed, walk
from fmpy import simulate_fmu
from fmpy.validation import validate_fmu
from gains import PERIOD, make_gains

from hexapod_cosim.controller import make_gait, save_gains
from hexapod_cosim.cosim.export.plant import export_controller
from hexapod_cosim.cosim.export.validation import find_problems
from hexapod_cosim.cosim.interface.controller import ControllerSetup
from hexapod_cosim.cosim.interface.names import joint_names
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.master.sensors import MEASURED
from hexapod_cosim.cosim.master.signals import COMMANDED, COMMANDS
from hexapod_cosim.cosim.run.plan import make_setup
from hexapod_cosim.models import LEG_NAMES, FmuError, HexapodError, load_robot


@pytest.fixture(scope="module")
def compliant_fmu(plant_build: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    robot = load_robot("athena")
    setup = ControllerSetup(
        robot=robot, gait=make_gait(robot), period=PERIOD, gains=make_gains(robot)
    )
    return export_controller(setup, tmp_path_factory.mktemp("controller") / "controller.fmu")


@pytest.fixture
def fmu(compliant_fmu: Path) -> Iterator[Fmu]:
    """Returns the controller FMU before initialization."""
    with Fmu(compliant_fmu, name="controller") as instance:
        yield instance


def test_validation_finds_no_problems(compliant_fmu: Path) -> None:
    assert validate_fmu(compliant_fmu) == []
    assert find_problems(compliant_fmu) == []


def test_the_fmi_3_fmu_gives_the_same_walk(
    plant_build: Path, tmp_path: Path, compliant_fmu: Path
) -> None:
    robot = load_robot("athena")
    setup = ControllerSetup(
        robot=robot, gait=make_gait(robot), period=PERIOD, gains=make_gains(robot)
    )
    path = export_controller(setup, tmp_path / "controller.fmu", fmi=3)
    assert validate_fmu(path) == []
    walks, steps = (
        [],
        {
            "stop_time": 1.0,
            "output_interval": PERIOD,
            "step_size": PERIOD,
            "start_values": {"command.vx": 0.05},
        },
    )
    for fmu, angle_ref in ((path, "angle_ref"), (compliant_fmu, "RR.tibia.angle_ref")):
        found = simulate_fmu(str(fmu), output=[angle_ref], **steps)
        walks.append(np.array([np.ravel(row[1])[-1] for row in found]))
    np.testing.assert_array_equal(walks[0], walks[1])
    assert np.ptp(walks[0]) > 0.1  # rad


def test_its_variables_have_the_plants_names_units_and_directions_reversed(
    fmu: Fmu, athena_fmu: Path
) -> None:
    with Fmu(athena_fmu) as plant:
        names = [name for name in fmu.variables if not name.startswith("command.")]
        sensed = [name for name in names if fmu.variables[name].causality == "input"]
        given = [
            *(name for names in COMMANDED.values() for name in names),
            *joint_names("acceleration_ref"),
        ]
        assert set(sensed) == {
            name for key in ("angle", "foot_force", "quaternion") for name in MEASURED[key]
        }
        assert {plant.variables[name].causality for name in sensed} == {"output"}
        assert {
            (plant.variables[name].causality, fmu.variables[name].causality) for name in given
        } == {("input", "output")}
        for name in [*sensed, *given]:
            assert plant.variables[name].unit == fmu.variables[name].unit


def test_outputs_follow_inputs_at_once_where_the_description_says_so_and_nowhere_else(
    fmu: Fmu,
) -> None:
    fmu.initialise(0.0, 60.0)
    walk(fmu, 0, 10)  # not yet longer than feet that feel a force in the air are believed
    plain, flags = outputs(fmu), fmu.block(fmu.names("output", "Boolean"))
    flags.get()
    swinging, before = fmu.block([f"{leg}.swinging" for leg in LEG_NAMES]), flags.values.copy()
    swinging.get()
    standing = LEG_NAMES[swinging.values.tolist().index(0)]
    force, turn = fmu.block([f"{standing}.foot.force[3]"]), fmu.block(["torso.quaternion[2]"])
    for block, value in ((force, 12.0), (turn, 0.02)):
        block.get()
        old = block.values.copy()
        block.values[:] = value
        block.set()
        assert (outputs(fmu) != plain).any()
        flags.get()
        np.testing.assert_array_equal(
            flags.values, before
        )  # depends on commands only, except in fallback
        block.values[:] = old
        block.set()
        np.testing.assert_array_equal(outputs(fmu), plain)
    depends = {unknown.variable.name: unknown.dependencies for unknown in fmu.description.outputs}
    assert [variable.name for variable in depends["LF.swinging"]] == COMMANDS


def test_every_parameter_is_tunable_before_the_start(tmp_path: Path, compliant_fmu: Path) -> None:
    """The kinematic athena's FMU with the parameters of the compliant phantomx in a ripple gait
    equals the FMU that is exported for it.
    """
    athena, other = load_robot("athena"), load_robot("phantomx_mk4")
    wanted = ControllerSetup(
        robot=other,
        gait=make_gait(other, "ripple"),
        period=0.004,
        gains=make_gains(other, period=0.004),
    )
    plain = ControllerSetup(robot=athena, gait=make_gait(athena), period=PERIOD)
    with packed(wanted, tmp_path) as exported:
        parameters, expected = exported.parameters(), walk(exported, 0, 300, h=0.004)
    with Fmu(export_controller(plain, tmp_path / "plain.fmu")) as parametrised:
        assert parametrised.variables.keys() == exported.variables.keys()
        parametrised.set_parameters(parameters)
        parametrised.initialise(0.0, 60.0)
        np.testing.assert_array_equal(walk(parametrised, 0, 300, h=0.004), expected)


def test_saved_restored_and_serialised_states_continue_bit_for_bit(
    fmu: Fmu, compliant_fmu: Path
) -> None:
    fmu.initialise(0.0, 60.0)
    walk(fmu, 0, 123)
    slave = fmu._slave
    state = slave.getFMUState()
    data = slave.serializeFMUState(state)
    rest = walk(fmu, 123, 150)
    slave.setFMUState(state)
    np.testing.assert_array_equal(walk(fmu, 123, 150), rest)
    slave.freeFMUState(state)
    with Fmu(compliant_fmu, name="other") as other:
        other.initialise(0.0, 60.0)
        other._slave.setFMUState(other._slave.deSerializeFMUstate(data))
        np.testing.assert_array_equal(walk(other, 123, 150), rest)


def test_commands_are_steps_so_derivatives_of_inputs_are_refused(fmu: Fmu) -> None:
    assert not fmu.description.coSimulation.canInterpolateInputs
    fmu.initialise(0.0, 1.0)
    reference = fmu.references(["command.vx"])
    with pytest.raises(Exception, match="fmi2SetRealInputDerivatives failed"):
        fmu._slave.setRealInputDerivatives(reference, [1], [0.1])
    assert fmu.log.messages[-1] == (
        "fmi2SetRealInputDerivatives: got a call, expected none, as the model description does not "
        "offer it"
    )


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"gait.duty": 1.0}, "gait.duty: got 1, expected a finite number in"),
        ({"gains.limits.torque": 0.0}, "gains.limits.torque"),
        ({"control": "manual"}, "choice for control"),
    ],
)
def test_parameters_out_of_range_are_refused(
    fmu: Fmu, values: dict[str, object], said: str
) -> None:
    with pytest.raises(HexapodError, match=said):
        fmu.set_parameters(values)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"period": 0.6}, "period: got 0.6, expected less than 0.5 s"),
        ({"servo.kp": 0.0}, "servo.kp: got 0, expected more than 0 except under"),
        ({"RM.tibia.stance": 3.0}, "RM.tibia.stance: got 3, expected an angle between"),
    ],
)
def test_parameters_that_do_not_fit_together_are_refused_at_initialisation(
    fmu: Fmu, values: dict[str, float], said: str
) -> None:
    fmu.set_parameters(values)
    with pytest.raises(FmuError, match=said):
        fmu.initialise(0.0, 1.0)


def test_the_export_command_writes_the_controller_that_simulate_uses(
    call: Call, tmp_path: Path
) -> None:
    robot, path, gains = load_robot("phantomx_mk4"), tmp_path / "c.fmu", tmp_path / "gains.toml"
    save_gains(make_gains(robot), gains)
    code, said, _ = call(
        "export",
        "--controller",
        "compliant",
        "--robot",
        robot.name,
        "--gait",
        "ripple",
        "--gains",
        gains,
        "-o",
        path,
    )
    assert code == 0
    assert str(path) in said
    setup = make_setup(
        robot, control="compliant", period=PERIOD, gait="ripple", gains=make_gains(robot)
    )
    assert path.read_bytes() == export_controller(setup, tmp_path / "same.fmu").read_bytes()
    assert call("validate", path)[0] == 0
