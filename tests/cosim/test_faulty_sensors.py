"""Faults of the sensors of joints and attitude, late readings and dropped macro-steps, on a plant
whose true values are known at each step.
"""

from __future__ import annotations

import math
from copy import deepcopy
from pathlib import Path

import numpy as np
import pytest
from fake_plant import FakeController, FakePlant

from hexapod_cosim.controller import BodyCommand, JointCommand, Measurement
from hexapod_cosim.cosim.master.loop import Outcome, run
from hexapod_cosim.cosim.master.recorder import Recorder
from hexapod_cosim.cosim.master.signals import Signals
from hexapod_cosim.cosim.run.single_run import make_inner_sensors, make_sensor, simulate
from hexapod_cosim.cosim.scenario.event_log import describe_event
from hexapod_cosim.cosim.scenario.scenario import load_scenario, scenario_from_table
from hexapod_cosim.cosim.scenario.schedule import make_schedule
from hexapod_cosim.models import JOINT_NAMES, LEG_NAMES, ScenarioError

STEPS = 10
RM_TIBIA = LEG_NAMES.index("RM"), JOINT_NAMES.index("tibia")
REST = [1.0, 0.0, 0.0, 0.0]


class KnownPlant(FakePlant):
    """A plant of which all that sensors see is known after k steps: joint angles k mrad, speeds
    0.1 k rad/s, forces along z k newtons, a yaw of 0.1 k rad at 20 rad/s.
    """

    def step(self, t: float, h: float) -> None:
        super().step(t, h)
        k = len(self.steps)
        for leg in LEG_NAMES:
            for joint in JOINT_NAMES:
                self.values[f"{leg}.{joint}.angle"] = 0.001 * k
                self.values[f"{leg}.{joint}.speed"] = 0.1 * k
            self.values[f"{leg}.foot.force[3]"] = float(k)
            self.values[f"{leg}.foot.contact"] = 1.0
        self.values["torso.quaternion[1]"] = math.cos(0.05 * k)
        self.values["torso.quaternion[4]"] = math.sin(0.05 * k)
        self.values["torso.angular_velocity[3]"] = 20.0


class Witness(FakeController):
    """A controller that keeps what it measures and commands a torque of k in step k."""

    def __init__(self) -> None:
        super().__init__()
        self.measured: list[Measurement] = []

    def step(self, t: float, command: BodyCommand, measurement: Measurement) -> JointCommand:
        self.measured.append(deepcopy(measurement))
        return JointCommand(torque_ref=np.full((6, 3), float(len(self.measured) - 1)))


def sensed(events: str) -> tuple[list[Measurement], Outcome]:
    """Returns what a controller measures in ten steps of 5 ms, and the run's outcome."""
    scenario = load_scenario("walk_flat", overrides=["duration=0.05", f"events={events}"])
    plant, witness, schedule = KnownPlant(), Witness(), make_schedule(scenario)
    plant.values |= {name: 0.0 for name in plant.values if name.endswith((".angle", ".speed"))}
    signals = Signals(
        plant, sensor=make_sensor(scenario, schedule), inner=make_inner_sensors(schedule)
    )
    recorder = Recorder(signals, schedule.times, schedule.rows)
    outcome = run(plant, signals, witness, schedule, recorder, h=scenario.macro_step)
    assert outcome.status == "completed"
    return witness.measured, outcome


ANGLE = "time=0.015, duration=0.02, sensor='angle', leg='RM', joint='tibia'"
NAN = math.nan


@pytest.mark.parametrize(
    ("fault", "expected"),
    [
        ("fault='dead'", [0, 1, 2, 0, 0, 0, 0, 7, 8, 9]),
        ("fault='stuck'", [0, 1, 2, 2, 2, 2, 2, 7, 8, 9]),
        ("fault='nan'", [0, 1, 2, NAN, NAN, NAN, NAN, 7, 8, 9]),
        ("fault='late', delay=0.01", [0, 1, 2, 1, 2, 3, 4, 7, 8, 9]),
        ("fault='late', delay='12 ms'", [0, 1, 2, 0, 1, 2, 3, 7, 8, 9]),
        ("fault='late', delay=0.03", [0, 1, 2, 0, 0, 0, 0, 7, 8, 9]),
    ],
)
def test_a_faulty_joint_sensor_changes_its_own_readings_and_nothing_else(
    fault: str, expected: list[float]
) -> None:
    measured, outcome = sensed(f"[{{{ANGLE}, {fault}}}]")
    steps = np.array(expected)
    np.testing.assert_array_equal([one.angle[RM_TIBIA] for one in measured], 0.001 * steps)
    np.testing.assert_array_equal([one.speed[RM_TIBIA] for one in measured], 0.1 * steps)
    others = np.array([np.delete(one.angle.ravel(), 14) for one in measured])
    truth = 0.001 * np.arange(STEPS)
    np.testing.assert_array_equal(others, np.tile(truth[:, None], (1, 17)))
    # recordings show the joint, not its sensor
    np.testing.assert_array_equal(outcome.recording.column("RM.tibia.angle")[:STEPS], truth)


@pytest.mark.parametrize(
    ("fault", "expected"),
    [
        ("fault='stuck'", [0, 1, 1, 1, 4]),
        ("fault='late', delay=0.01", [0, 1, 0, 1, 4]),
    ],
)
def test_a_faulty_attitude_sensor_repeats_or_delays_attitude_and_rate(
    fault: str, expected: list[float]
) -> None:
    measured, _ = sensed(f"[{{time=0.01, duration=0.01, sensor='attitude', {fault}}}]")
    yaw = [2.0 * math.asin(one.quaternion[3]) for one in measured[:5]]
    np.testing.assert_allclose(yaw, 0.1 * np.array(expected), rtol=0.0, atol=1e-15)
    rates = [one.angular_velocity[2] for one in measured[:5]]
    np.testing.assert_array_equal(rates, [0.0 if step == 0 else 20.0 for step in expected])


def test_a_dead_attitude_sensor_reads_level_and_at_rest_and_nan_reads_no_numbers() -> None:
    events = "{time=0.01, duration=0.005, sensor='attitude', fault='dead'}"
    measured, _ = sensed(f"[{events}, {{time=0.02, sensor='attitude', fault='nan'}}]")
    assert measured[2].quaternion.tolist() == REST
    assert measured[2].angular_velocity.tolist() == [0.0, 0.0, 0.0]
    assert measured[3].angular_velocity.tolist() == [0.0, 0.0, 20.0]
    for one in measured[4:]:
        assert np.isnan(one.quaternion).all()
        assert np.isnan(one.angular_velocity).all()


def test_a_late_force_sensor_reads_forces_and_contacts_of_earlier_steps() -> None:
    late = "{time=0.015, duration=0.015, leg='LF', fault='late', delay=0.015}"
    measured, _ = sensed(f"[{late}]")
    assert [one.foot_force[0, 2] for one in measured] == [0, 1, 2, 0, 1, 2, 6, 7, 8, 9]
    contact = [True] * STEPS
    contact[0] = contact[3] = False  # before the first step no foot of this plant touches
    assert [bool(one.contact[0]) for one in measured] == contact
    assert [one.foot_force[1, 2] for one in measured] == list(range(STEPS))


def test_in_dropped_macro_steps_the_last_readings_and_the_last_command_hold() -> None:
    measured, outcome = sensed("[{time=0.01, duration=0.015, lost='step'}]")
    held = np.array([0, 1, 1, 1, 1, 5, 6, 7, 8, 9])
    assert len(measured) == STEPS  # a controller is called all the same: its time goes on
    np.testing.assert_array_equal([one.angle[0, 0] for one in measured], 0.001 * held)
    np.testing.assert_array_equal([one.foot_force[5, 2] for one in measured], held)
    yaw = [2.0 * math.asin(one.quaternion[3]) for one in measured]
    np.testing.assert_allclose(yaw, 0.1 * held, rtol=0.0, atol=1e-15)
    torque = outcome.recording.column("LF.coxa.torque_ref")[:STEPS]
    np.testing.assert_array_equal(torque, held)


def test_the_first_macro_step_is_never_dropped() -> None:
    measured, outcome = sensed("[{time=1e-9, duration=0.009, lost='step'}]")
    assert [one.foot_force[0, 2] for one in measured[:4]] == [0, 0, 2, 3]
    assert outcome.recording.column("LF.coxa.torque_ref")[:4].tolist() == [0, 0, 2, 3]


def test_a_dead_servo_follows_the_joint_and_not_its_faulty_sensor() -> None:
    events = (
        "{time=0, leg='RM', joint='tibia', fault='dead'}, "
        "{time=0, sensor='angle', leg='RM', joint='tibia', fault='nan'}"
    )
    _, outcome = sensed(f"[{events}]")
    command = outcome.recording.column("RM.tibia.angle_ref")[:STEPS]
    np.testing.assert_array_equal(command, 0.001 * np.arange(STEPS))


@pytest.mark.parametrize(
    ("event", "message"),
    [
        ("{time=1, leg='LF', fault='late'}", "a late reading without a delay"),
        ("{time=1, leg='LF', fault='dead', delay=0.1}", "a delay of readings that are not late"),
        ("{time=1, sensor='gyro', fault='dead'}", "'gyro'"),
        ("{time=1, sensor='attitude', leg='LF', fault='dead'}", "leg"),
        ("{time=1, sensor='angle', leg='LF', fault='dead'}", "joint"),
        ("{time=1, duration=1, lost='all'}", "'all'"),
    ],
)
def test_an_event_that_makes_no_sense_is_refused(event: str, message: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        load_scenario("walk_flat", overrides=[f"events=[{event}]"])
    assert message in str(caught.value)


def test_faults_of_sensors_are_described_and_survive_a_scenario_file() -> None:
    events = (
        "{time=1, sensor='angle', leg='LM', joint='coxa', fault='stuck'}, "
        "{time=1, sensor='attitude', fault='dead'}, "
        "{time=1, leg='LM', fault='late', delay='20 ms', duration=2}, "
        "{time=2, duration=0.5, lost='step'}"
    )
    scenario = load_scenario("walk_flat", overrides=[f"events=[{events}]"])
    assert [describe_event(event) for event in scenario.events] == [
        "the angle sensor of LM.coxa repeats its last reading",
        "the attitude sensor reads level and at rest",
        "the force sensor of LM is late by 20 ms, for 2 s",
        "macro-steps are dropped: the last readings and joint commands hold, for 0.5 s",
    ]
    again = scenario_from_table(scenario.to_table(), where="again.toml")
    assert again.events == scenario.events


@pytest.mark.parametrize(
    ("control", "fault", "status"),
    [
        ("kinematic", "sensor='attitude', fault='nan'", "completed"),
        ("compliant", "sensor='attitude', fault='late', delay=0.02", "completed"),
        ("compliant", "sensor='angle', leg='LF', joint='femur', fault='stuck'", "completed"),
        ("compliant", "sensor='angle', leg='LF', joint='femur', fault='nan'", "failed"),
    ],
)
def test_a_walk_with_faulty_sensors_goes_on_or_says_why_it_ended(
    plant_build: Path, control: str, fault: str, status: str
) -> None:
    overrides = ["duration=0.3", f"control={control}", f"events=[{{time=0.1, {fault}}}]"]
    result = simulate(load_scenario("walk_flat", overrides=overrides))
    assert result.outcome.status == status
    assert len(result.facts.events) == 1
    if status == "failed":
        assert 0.1 <= result.outcome.simulated < 0.2
        assert "nan" in result.outcome.reason.lower()
    else:
        assert np.isfinite(result.outcome.recording.data).all()
