"""Tests that the controller FMU walks the plant FMU as the Python controller does, and that its
gait and control are tunable meanwhile.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from controller_fmus import ANGLE, SPEED, packed, setup_for, walk
from fmpy import extract, read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi3 import FMU3Slave
from gains import PERIOD, make_gains

from hexapod_cosim.controller import BodyCommand, JointCommand, Measurement, make_gait
from hexapod_cosim.cosim.control.fmu_law import law_of_ours
from hexapod_cosim.cosim.export.plant import export_controller
from hexapod_cosim.cosim.interface.controller import ControllerSetup, controller_parameters
from hexapod_cosim.cosim.interface.names import vector_names
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.master.fmu_block import StepError
from hexapod_cosim.cosim.master.loop import COMPLETED, JointController, run
from hexapod_cosim.cosim.master.recorder import Recorder, Recording
from hexapod_cosim.cosim.master.sensors import errors_of
from hexapod_cosim.cosim.master.signals import COMMANDED, Signals
from hexapod_cosim.cosim.run.plant import open_plant
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.cosim.scenario.schedule import make_schedule
from hexapod_cosim.models import FmuError, load_robot

ACCELERATION = 3e-12  # of what turns a servo's largest speed round within a period
TORQUE = 3e-12  # of a servo's largest: tests/native_control/native_walks.py says why
# rad    of joint commands when both walk a plant of their own, whose motion answers to their last
# bits
CLOSED = 1e-12
MOTION = 1e-12  # m    of the torso, in the same walks


class Both:
    """The Python controller, and the FMU with the same inputs:

    records the largest differences of all joint commands.
    """

    def __init__(self, setup: ControllerSetup, fmu: Fmu) -> None:
        self.lead, self.other, self.fallback = (
            setup.build(),
            law_of_ours(fmu, period=setup.period),
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
        assert self.other.diagnostics is not None
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
        signals = Signals(plant, errors=errors_of(scenario, schedule))
        recorder = Recorder(signals, schedule.times, schedule.rows)
        outcome = run(plant, signals, controller, schedule, recorder, h=scenario.macro_step)
    assert outcome.status == COMPLETED, outcome.reason
    return outcome.recording


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
            False,
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
            walked(scenario, law_of_ours(fmu, period=setup.period)),
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


# Gait and control of the controller FMU are tunable while the robot walks.


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
        walker, worst = law_of_ours(fmu, period=PERIOD), 0.0
        for k in range(800):
            if k == 330:
                fmu.set_parameters(gait_parameters(amble))
                lead.change_gait(amble.gait)
                with pytest.raises(FmuError, match=r"gains.hold.path_rate: got a value after init"):
                    fmu.set_parameters({"gains.hold.path_rate": 1.0})
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
        walker, worst = law_of_ours(fmu, period=PERIOD), 0.0
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
            measurement.angle[...] = ours.angle_ref  # joints that follow: no leg is lost
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
