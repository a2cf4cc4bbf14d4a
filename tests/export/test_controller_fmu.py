"""The controller FMU walks the plant FMU as the Python controller does, and its model description
is correct.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command import Call
from fmpy import extract, read_model_description, simulate_fmu
from fmpy.fmi1 import FMICallException
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu
from gains import PERIOD, make_gains

from hexapod_cosim.controller import BodyCommand, JointCommand, Measurement, make_gait, save_gains
from hexapod_cosim.cosim.export.controller_export import export_controller
from hexapod_cosim.cosim.interface.controller_interface import (
    ControllerSetup,
    controller_parameters,
)
from hexapod_cosim.cosim.interface.names import joint_names, vector_names
from hexapod_cosim.cosim.master.fmu import Fmu, StepError
from hexapod_cosim.cosim.master.fmu_controller import COMMANDS, FmuController
from hexapod_cosim.cosim.master.loop import COMPLETED, JointController, run
from hexapod_cosim.cosim.master.recorder import Recorder, Recording
from hexapod_cosim.cosim.master.signals import COMMANDED, MEASURED, Signals
from hexapod_cosim.cosim.run.chosen_walk import known_robot
from hexapod_cosim.cosim.run.controller_setup import make_setup
from hexapod_cosim.cosim.run.run import make_sensor, open_plant
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.cosim.scenario.scenario import load_scenario
from hexapod_cosim.cosim.scenario.schedule import make_schedule
from hexapod_cosim.cosim.validate.validation import find_problems
from hexapod_cosim.models import LEG_NAMES, FmuError, HexapodError, load_robot

ANGLE, SPEED = 1e-12, 1e-12  # rad; of a servo's largest
ACCELERATION = 3e-12  # of what turns a servo's largest speed round within a period
TORQUE = 3e-12  # of a servo's largest: tests/controller/test_native_controller.py says why
# rad    of joint commands when both walk a plant of their own, whose motion answers to their last
# bits
CLOSED = 1e-12
MOTION = 1e-12  # m    of the torso, in the same walks


def setup_for(scenario: Scenario) -> ControllerSetup:
    robot = known_robot(scenario)
    gains = (
        None if scenario.control == "kinematic" else make_gains(robot, period=scenario.macro_step)
    )
    return ControllerSetup(
        robot=robot,
        gait=make_gait(robot, **dict(scenario.settings.get("gait", {}))),
        period=scenario.macro_step,
        gains=gains,
        parts=scenario.compliance,
    )


@contextmanager
def packed(
    setup: ControllerSetup,
    folder: Path,
    *,
    start: float = 0.0,
    stop: float = 60.0,
    **parameters: object,
) -> Iterator[Fmu]:
    """Yields the initialized controller FMU of a setup."""
    with Fmu(export_controller(setup, folder / "controller.fmu"), name="controller") as fmu:
        fmu.set_parameters({name.replace("__", "."): value for name, value in parameters.items()})
        fmu.initialise(start, stop)
        yield fmu


class Both:
    """The Python controller, and the FMU with the same inputs:

    records the largest differences of all joint commands.
    """

    def __init__(self, setup: ControllerSetup, fmu: Fmu) -> None:
        self.lead, self.other, self.fallback = (
            setup.build(),
            FmuController(fmu, period=setup.period),
            False,
        )
        self.worst, self.scale = (
            np.zeros(4),
            np.array([1.0, setup.robot.servo.speed_max, setup.robot.servo.torque_max, 1.0]),
        )
        self.scale[3] = 2.0 * setup.robot.servo.speed_max / setup.period

    def step(self, t: float, command: BodyCommand, measurement: Measurement) -> JointCommand:
        ours, theirs = (
            self.lead.step(t, command, measurement),
            self.other.step(t, command, measurement),
        )
        gaps = [
            np.abs(getattr(ours, name) - getattr(theirs, name)).max()
            for name in (*COMMANDED, "acceleration_ref")
        ]
        self.worst = np.maximum(self.worst, gaps / self.scale)
        for flag in ("swinging", "unreachable", "fallback"):
            np.testing.assert_array_equal(
                getattr(self.other.diagnostics, flag), getattr(self.lead.diagnostics, flag)
            )
        np.testing.assert_allclose(
            self.other.diagnostics.planned, self.lead.diagnostics.planned, atol=1e-12
        )
        self.fallback |= bool(self.lead.diagnostics.fallback.any())
        return ours


def walked(scenario: Scenario, controller: JointController) -> Recording:
    """Runs a scenario on the plant FMU with a controller and the master."""
    schedule = make_schedule(scenario)
    with open_plant(scenario) as plant:
        plant.initialise(scenario.start, scenario.start + scenario.duration)
        signals = Signals(plant, sensor=make_sensor(scenario, schedule))
        recorder = Recorder(signals, schedule.times, schedule.rows)
        outcome = run(plant, signals, controller, schedule, recorder, h=scenario.macro_step)
    assert outcome.status == COMPLETED, outcome.reason
    return outcome.recording


# ------------------------------------------------------------------------------------------------
# the same walk


FAULTS = 'events=[{time=1.5, leg="LM", fault="dead"}, {time=2.5, leg="RF", fault="stuck"}]'


@pytest.mark.usefixtures("plant_build")
@pytest.mark.parametrize(
    ("name", "settings", "falls_back"),
    [
        ("walk_flat", ["gait.name=ripple", "duration=6"], False),
        ("phantomx_walk", ["duration=6"], False),
        ("turn", ["duration=6", "command.roll=0.03"], False),
        ("push", ["duration=6"], None),
        (
            "walk_flat",
            [
                "duration=5",
                FAULTS,
                "sensors.foot_force_noise=0.05",
                "sensors.foot_force_delay=0.01",
            ],
            True,
        ),
    ],
)
def test_the_same_inputs_give_the_same_commands(
    tmp_path: Path, name: str, settings: list[str], falls_back: bool | None
) -> None:
    scenario = load_scenario(name, overrides=["control=compliant", *settings])
    setup = setup_for(scenario)
    with packed(setup, tmp_path, start=scenario.start) as fmu:
        both = Both(setup, fmu)
        walked(scenario, both)
    assert (both.worst <= [ANGLE, SPEED, TORQUE, ACCELERATION]).all(), both.worst
    assert falls_back is None or both.fallback == falls_back


@pytest.mark.usefixtures("plant_build")
@pytest.mark.parametrize("control", ["kinematic", "compliant"])
def test_plant_and_controller_fmu_walk_as_the_python_master_does(
    tmp_path: Path, control: str
) -> None:
    scenario = load_scenario("walk_flat", overrides=[f"control={control}"])
    setup = setup_for(scenario)
    with packed(setup, tmp_path) as fmu:
        ours, theirs = (
            walked(scenario, setup.build()),
            walked(scenario, FmuController(fmu, period=setup.period)),
        )
    position = vector_names("torso.position")
    assert (
        ours.columns(position)[-1, 0] - ours.columns(position)[0, 0] > 0.5
    )  # m, the distance walked
    np.testing.assert_allclose(
        theirs.columns(COMMANDED["angle_ref"]),
        ours.columns(COMMANDED["angle_ref"]),
        rtol=0.0,
        atol=CLOSED,
    )
    np.testing.assert_allclose(
        theirs.columns(COMMANDED["speed_ref"]),
        ours.columns(COMMANDED["speed_ref"]),
        rtol=0.0,
        atol=CLOSED,
    )
    torque_max = setup.robot.servo.torque_max
    np.testing.assert_allclose(
        theirs.columns(COMMANDED["torque_ref"]),
        ours.columns(COMMANDED["torque_ref"]),
        rtol=0.0,
        atol=TORQUE * torque_max,
    )
    np.testing.assert_allclose(
        theirs.columns(position), ours.columns(position), rtol=0.0, atol=MOTION
    )


# ------------------------------------------------------------------------------------------------
# what it says it is


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


def outputs(fmu: Fmu) -> np.ndarray:
    """Returns all Real outputs."""
    block = fmu.block(fmu.names("output"))
    block.get()
    return block.values.copy()


def give(fmu: Fmu, **values: float) -> None:
    """Sets inputs by name, with dots as a__b and brackets as a_1."""
    block = fmu.block([name.replace("__", ".") for name in values])
    block.values[:] = list(values.values())
    block.set()


def walk(fmu: Fmu, first: int, count: int, *, h: float = PERIOD) -> np.ndarray:
    """Returns outputs at communication points of a walk with unequal forces on the feet."""
    robot, found = load_robot("athena"), []
    block = fmu.block(
        [
            *COMMANDS,
            *(name for key in ("angle", "foot_force", "quaternion") for name in MEASURED[key]),
        ]
    )
    draws = np.random.default_rng(5).normal(size=(first + count, 6, 3))
    for k in range(first, first + count):
        force = draws[k] + [0.0, 0.0, 8.0]
        block.values[:] = np.concatenate(
            [
                [0.05, 0.0, 0.02, 0.0, 0.0, 0.0],
                robot.stance.ravel(),
                force.ravel(),
                [1.0, 0.0, 0.0, 0.0],
            ]
        )
        block.set()
        found.append(outputs(fmu))
        fmu.step(k * h, h)
    return np.array(found)


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
    with Fmu(export_controller(plain, tmp_path / "plain.fmu")) as told:
        assert told.variables.keys() == exported.variables.keys()
        told.set_parameters(parameters)
        told.initialise(0.0, 60.0)
        np.testing.assert_array_equal(walk(told, 0, 300, h=0.004), expected)


def gait_parameters(setup: ControllerSetup) -> dict[str, float]:
    found = controller_parameters(setup)
    return {name: value for name, value in found.items() if name.startswith("gait.")}


def test_the_gait_is_tunable_while_the_robot_walks(tmp_path: Path) -> None:
    """The FMU changes its gait as the Python controller does; other parameters stay fixed."""
    robot, measurement = load_robot("athena"), Measurement(angle=load_robot("athena").stance.copy())
    setup = ControllerSetup(robot=robot, gait=make_gait(robot), period=PERIOD)
    amble = replace(setup, gait=make_gait(robot, "amble"))
    command, lead = BodyCommand(vx=0.03), setup.build()
    with packed(setup, tmp_path) as fmu:
        walker, worst = FmuController(fmu, period=PERIOD), 0.0
        for k in range(800):
            if k == 330:
                fmu.set_parameters(gait_parameters(amble))
                lead.change_gait(amble.gait)
                with pytest.raises(FmuError, match=r"gains.slip.kp: got a value after init"):
                    fmu.set_parameters({"gains.slip.kp": 1.0})
            ours = lead.step(k * PERIOD, command, measurement)
            theirs = walker.step(k * PERIOD, command, measurement)
            worst = max(worst, float(np.abs(ours.angle_ref - theirs.angle_ref).max()))
        assert lead.gait is amble.gait
        assert worst < ANGLE
        tunable = [
            name for name, variable in fmu.variables.items() if variable.variability == "tunable"
        ]
        assert tunable == ["control", *gait_parameters(amble)]


def test_the_control_is_tunable_while_the_robot_walks(tmp_path: Path) -> None:
    """The FMU changes its control as the Python controller does, also together with the gait."""
    robot, measurement = load_robot("athena"), Measurement(angle=load_robot("athena").stance.copy())
    gains = make_gains(robot)
    setup = ControllerSetup(robot=robot, gait=make_gait(robot), period=PERIOD, gains=gains)
    amble = replace(setup, gait=make_gait(robot, "amble"))
    command, lead = BodyCommand(vx=0.03), setup.build()
    with packed(setup, tmp_path) as fmu:
        walker, worst = FmuController(fmu, period=PERIOD), 0.0
        for k in range(800):
            if k == 330:
                fmu.set_parameters({"control": 3.0})
                lead.change_control(gains, "paper")
            if k == 500:
                fmu.set_parameters({**gait_parameters(amble), "control": 1.0})
                lead.change_control(None)
                lead.change_gait(amble.gait)
            ours = lead.step(k * PERIOD, command, measurement)
            theirs = walker.step(k * PERIOD, command, measurement)
            worst = max(worst, float(np.abs(ours.angle_ref - theirs.angle_ref).max()))
        assert (lead.gait, lead.gains) == (amble.gait, None)
    assert worst < ANGLE


def test_a_gait_that_is_too_fast_is_refused_and_the_next_one_is_taken(tmp_path: Path) -> None:
    robot = load_robot("athena")
    setup = ControllerSetup(robot=robot, gait=make_gait(robot), period=PERIOD)
    with packed(setup, tmp_path) as fmu:
        expected = walk(fmu, 0, 300)
    with packed(setup, tmp_path) as fmu:
        first = walk(fmu, 0, 100)
        fmu.set_parameters({"gait.period": 0.008})
        with pytest.raises(StepError, match="gait's shorter phase; the state is unchanged"):
            fmu.step(100 * PERIOD, PERIOD)
        fmu.set_parameters({"gait.period": setup.gait.period})
        np.testing.assert_array_equal(np.vstack([first, walk(fmu, 100, 200)]), expected)


def test_the_gait_is_tunable_in_fmi_3_too(plant_build: Path, tmp_path: Path) -> None:
    robot = load_robot("athena")
    setup = ControllerSetup(robot=robot, gait=make_gait(robot), period=PERIOD)
    path = export_controller(setup, tmp_path / "controller.fmu", fmi=3)
    description = read_model_description(path)
    references = {one.name: one.valueReference for one in description.modelVariables}
    fmu = FMU3Slave(
        guid=description.guid,
        unzipDirectory=extract(path, str(tmp_path / "unpacked")),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="controller",
    )
    fmu.instantiate()
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    fmu.doStep(0.0, PERIOD)
    fmu.setFloat64([references["gait.step_height"]], [0.02])
    with pytest.raises(FMICallException):
        fmu.setFloat64([references["period"]], [0.01])
    fmu.doStep(PERIOD, PERIOD)
    assert fmu.getFloat64([references["gait.step_height"]]) == [0.02]
    fmu.terminate()
    fmu.freeInstance()


def test_a_custom_gait_of_a_patterns_offsets_is_that_pattern(tmp_path: Path) -> None:
    robot = load_robot("athena")
    setup = ControllerSetup(robot=robot, gait=make_gait(robot, "wave"), period=PERIOD)
    with packed(setup, tmp_path) as named:
        expected = walk(named, 0, 200)
    with packed(setup, tmp_path, gait__pattern="custom") as custom:
        np.testing.assert_array_equal(walk(custom, 0, 200), expected)


# ------------------------------------------------------------------------------------------------
# as an FMU


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


def test_a_reset_instance_equals_a_new_one(fmu: Fmu) -> None:
    fmu.initialise(0.0, 60.0)
    first = walk(fmu, 0, 150)
    fmu.reset()
    fmu.initialise(0.0, 60.0)
    np.testing.assert_array_equal(walk(fmu, 0, 150), first)


def test_communication_steps_of_any_length_end_at_the_same_walk(compliant_fmu: Path) -> None:
    """The inputs are constant. 7 ms is no multiple of the period."""
    found = []
    for h, count in ((PERIOD, 420), (0.02, 105), (0.007, 300), (2.1, 1)):
        with Fmu(compliant_fmu) as fmu:
            fmu.initialise(3.0, 60.0)
            give(fmu, command__vx=0.06)
            for k in range(count):
                fmu.step(3.0 + k * h, h)
            found.append(outputs(fmu))
    for other in found[1:]:
        np.testing.assert_array_equal(other, found[0])


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"gait.duty": 1.0}, "gait.duty: got 1, expected a finite number in"),
        ({"gains.suspension.mass": 0.0}, "gains.suspension.mass"),
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


def test_inputs_that_are_no_numbers_and_steps_back_are_refused(fmu: Fmu) -> None:
    fmu.initialise(0.0, 60.0)
    walk(fmu, 0, 5)
    before = outputs(fmu)
    with pytest.raises(
        FmuError, match=r"command.vx: got nan, expected a finite number in \[-10, 10\] m/s"
    ):
        give(fmu, command__vx=np.nan)
    with pytest.raises(StepError):
        fmu.step(0.0, PERIOD)
    np.testing.assert_array_equal(outputs(fmu), before)


# ------------------------------------------------------------------------------------------------
# command


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


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--controller", "complaint"], "did you mean 'compliant'?"),
        (["--controller", "kinematic", "--gait", "trot"], "gait"),
        (["--gait", "ripple"], "add --controller kinematic or compliant"),
        (["--controller", "kinematic", "--period", "0.7"], "impossible controller period"),
        (["--controller", "kinematic", "-o", "walk.zip"], "a name that ends in .fmu"),
    ],
)
def test_controllers_that_cannot_be_exported_are_refused_with_a_message(
    call: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    code, _, error = call("export", *arguments)
    assert code != 0
    assert said in error
    assert list(tmp_path.iterdir()) == []


def test_gains_of_another_robot_give_a_warning_and_kinematic_control_takes_none(
    call: Call, tmp_path: Path
) -> None:
    save_gains(make_gains(load_robot("phantomx_mk4")), tmp_path / "gains.toml")
    where = ("--gains", tmp_path / "gains.toml", "-o", tmp_path / "c.fmu")
    code, _, error = call("export", "--controller", "compliant", *where)
    assert code == 0
    assert "designed for robot 'phantomx_mk4'" in error
    code, _, error = call("export", "--controller", "kinematic", *where)
    assert code != 0
    assert "gains for kinematic control" in error


def test_a_robot_with_other_joint_axes_has_no_controller(tmp_path: Path) -> None:
    robot = load_robot("athena")
    leg = robot.legs[0]
    turned = replace(
        leg, links=(leg.links[0], replace(leg.links[1], axis=(0.0, 1.0, 0.0)), leg.links[2])
    )
    odd = replace(robot, legs=(turned, *robot.legs[1:]))
    with pytest.raises(HexapodError, match="no closed-form inverse kinematics"):
        export_controller(
            ControllerSetup(robot=odd, gait=make_gait(odd), period=PERIOD), tmp_path / "odd.fmu"
        )
    assert list(tmp_path.iterdir()) == []
