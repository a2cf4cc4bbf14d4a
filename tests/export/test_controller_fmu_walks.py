"""The controller FMU walks the plant FMU as the Python controller does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from controller_fmus import ANGLE, SPEED, packed, setup_for

from hexapod_cosim.controller import BodyCommand, JointCommand, Measurement
from hexapod_cosim.cosim.control.fmu_law import law_of_ours
from hexapod_cosim.cosim.interface.controller import (
    ControllerSetup,
)
from hexapod_cosim.cosim.interface.names import vector_names
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.master.loop import COMPLETED, JointController, run
from hexapod_cosim.cosim.master.recorder import Recorder, Recording
from hexapod_cosim.cosim.master.sensors import errors_of
from hexapod_cosim.cosim.master.signals import COMMANDED, Signals
from hexapod_cosim.cosim.run.plant import open_plant
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.cosim.scenario.schedule import make_schedule

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
