"""Errors of sensors and servos, and lost commands, on a plant whose true values are known.

Both loops call the same functions in C; test_runner.py compares whole walks of both loops.
"""

from __future__ import annotations

import math
from copy import deepcopy
from pathlib import Path

import numpy as np
import pytest
from fake_plant import FakeController, FakePlant
from numpy.typing import NDArray

from hexapod_cosim.controller import BodyCommand, JointCommand, Measurement
from hexapod_cosim.cosim.master.loop import run
from hexapod_cosim.cosim.master.recorder import Recorder, Recording
from hexapod_cosim.cosim.master.sensors import CONTACT, errors_of
from hexapod_cosim.cosim.master.signals import Signals
from hexapod_cosim.cosim.results.folder import read_facts, write_result
from hexapod_cosim.cosim.run.single_run import simulate
from hexapod_cosim.cosim.scenario.events import describe_event, event_log
from hexapod_cosim.cosim.scenario.reading import load_scenario, scenario_from_table
from hexapod_cosim.cosim.scenario.schedule import make_schedule
from hexapod_cosim.models import JOINT_NAMES, LEG_NAMES, ScenarioError

STEPS = 10
LF, RM = LEG_NAMES.index("LF"), LEG_NAMES.index("RM")
RM_TIBIA = RM, JOINT_NAMES.index("tibia")
NAN = math.nan


class KnownPlant(FakePlant):
    """A plant of which all that sensors see is known after k steps: joint angles k mrad, speeds
    0.1 k rad/s, forces along z k + 1 newtons, contact where k is even, a yaw of 0.1 k rad at
    20 rad/s.
    """

    def __init__(self) -> None:
        super().__init__()
        self.show(0)

    def step(self, t: float, h: float) -> None:
        super().step(t, h)
        self.show(len(self.steps))

    def show(self, k: int) -> None:
        for leg in LEG_NAMES:
            for joint in JOINT_NAMES:
                self.values[f"{leg}.{joint}.angle"] = 0.001 * k
                self.values[f"{leg}.{joint}.speed"] = 0.1 * k
            self.values[f"{leg}.foot.force[3]"] = k + 1.0
            self.values[f"{leg}.foot.contact"] = float(k % 2 == 0)
        self.values["torso.quaternion[1]"] = math.cos(0.05 * k)
        self.values["torso.quaternion[4]"] = math.sin(0.05 * k)
        self.values["torso.angular_velocity[3]"] = 20.0


class Witness(FakeController):
    """A controller that keeps what it measures, and commands angles and torques of k in step k."""

    def __init__(self) -> None:
        super().__init__()
        self.measured: list[Measurement] = []

    def step(self, t: float, command: BodyCommand, measurement: Measurement) -> JointCommand:
        number = np.full((6, 3), float(len(self.measured)))
        self.measured.append(deepcopy(measurement))
        return JointCommand(angle_ref=number, speed_ref=number, torque_ref=number)


def sensed(events: str, *settings: str) -> tuple[list[Measurement], Recording]:
    """Returns what a controller measures in ten steps of 5 ms, and the recording."""
    changes = ["duration=0.05", f"events=[{events}]", *settings]
    scenario = load_scenario("walk_flat", overrides=changes)
    plant, witness, schedule = KnownPlant(), Witness(), make_schedule(scenario)
    signals = Signals(plant, errors=errors_of(scenario, schedule))
    recorder = Recorder(signals, schedule.times, schedule.rows)
    outcome = run(plant, signals, witness, schedule, recorder, h=scenario.macro_step)
    assert outcome.status == "completed", outcome.reason
    return witness.measured, outcome.recording


def forces(measured: list[Measurement], leg: int) -> list[float]:
    return [one.foot_force[leg, 2] for one in measured]


def yaws(measured: list[Measurement]) -> NDArray[np.float64]:
    return np.array([2.0 * math.asin(one.quaternion[3]) for one in measured])


# ------------------------------------------------------------------------------------------------
# sensors


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
    where = "time=0.015, duration=0.02, sensor='angle', leg='RM', joint='tibia'"
    measured, recording = sensed(f"{{{where}, {fault}}}")
    steps = np.array(expected)
    np.testing.assert_array_equal([one.angle[RM_TIBIA] for one in measured], 0.001 * steps)
    np.testing.assert_array_equal([one.speed[RM_TIBIA] for one in measured], 0.1 * steps)
    others = np.array([np.delete(one.angle.ravel(), 14) for one in measured])
    truth = 0.001 * np.arange(STEPS)
    np.testing.assert_array_equal(others, np.tile(truth[:, None], (1, 17)))
    # recordings show the joint, not its sensor
    np.testing.assert_array_equal(recording.column("RM.tibia.angle")[:STEPS], truth)


@pytest.mark.parametrize(
    ("fault", "expected"),
    [("fault='stuck'", [0, 1, 1, 1, 4]), ("fault='late', delay=0.01", [0, 1, 0, 1, 4])],
)
def test_a_faulty_attitude_sensor_repeats_or_delays_attitude(
    fault: str, expected: list[float]
) -> None:
    measured, _ = sensed(f"{{time=0.01, duration=0.01, sensor='attitude', {fault}}}")
    np.testing.assert_allclose(yaws(measured[:5]), 0.1 * np.array(expected), rtol=0.0, atol=1e-15)


def test_a_dead_attitude_sensor_reads_level_and_at_rest_and_nan_reads_no_numbers() -> None:
    dead = "{time=0.01, duration=0.005, sensor='attitude', fault='dead'}"
    measured, _ = sensed(f"{dead}, {{time=0.02, sensor='attitude', fault='nan'}}")
    assert measured[2].quaternion.tolist() == [1.0, 0.0, 0.0, 0.0]
    assert measured[2].angular_velocity.tolist() == [0.0, 0.0, 0.0]
    assert measured[3].angular_velocity.tolist() == [0.0, 0.0, 20.0]
    for one in measured[4:]:
        assert np.isnan(one.quaternion).all()
        assert np.isnan(one.angular_velocity).all()


TRUE = np.arange(1.0, 11.0)  # forces


@pytest.mark.parametrize(
    ("settings", "event", "expected"),
    [
        ("5 ms", "", np.maximum(TRUE - 1, 1)),
        ("5.1 ms", "", np.maximum(TRUE - 2, 1)),
        ("0.02", "", np.maximum(TRUE - 4, 1)),
        ("0", "{time=0.015, leg='LF', fault='stuck'}", np.minimum(TRUE, 3)),
        ("0", "{time=0, leg='LF', fault='stuck'}", np.ones(10)),
        # a late sensor sticks at what it last read and not at what was true
        ("10 ms", "{time=0.025, leg='LF', fault='stuck'}", [1, 1, 1, 2, 3, 3, 3, 3, 3, 3]),
        (
            "0",
            "{time=0.015, duration=0.015, leg='LF', fault='late', delay=0.015}",
            [1, 2, 3, 1, 2, 3, 7, 8, 9, 10],
        ),
    ],
)
def test_forces_and_contacts_are_those_of_the_same_earlier_step(
    settings: str, event: str, expected: list[float]
) -> None:
    measured, _ = sensed(event, f"sensors.foot_force_delay={settings}")
    np.testing.assert_array_equal(forces(measured, LF), expected)
    contact = [bool(one.contact[LF]) for one in measured]
    np.testing.assert_array_equal(contact, np.asarray(expected) % 2 == 1)
    if event and settings == "0":
        np.testing.assert_array_equal(forces(measured, RM), TRUE)


@pytest.mark.parametrize(("fault", "reading"), [("dead", 0.0), ("nan", NAN)])
def test_a_force_sensor_that_is_dead_or_reads_nan_shows_no_contact(
    fault: str, reading: float
) -> None:
    measured, _ = sensed(f"{{time=0.02, leg='LF', fault='{fault}', duration=0.01}}")
    gone = (np.arange(10) == 4) | (np.arange(10) == 5)
    np.testing.assert_array_equal(forces(measured, LF), np.where(gone, reading, TRUE))
    contact = [bool(one.contact[LF]) for one in measured]
    np.testing.assert_array_equal(contact, ~gone & (TRUE % 2 == 1))


def test_a_delay_changes_when_noise_is_measured_and_recordings_show_the_truth() -> None:
    noise = "sensors.foot_force_noise=0.05"
    early, _ = sensed("", noise)
    late, recording = sensed("", noise, "sensors.foot_force_delay=10 ms")
    for leg in (LF, RM):
        np.testing.assert_array_equal(forces(late, leg)[2:], forces(early, leg)[:-2])
    assert forces(early, LF) != forces(early, RM) != TRUE.tolist()
    np.testing.assert_array_equal(recording.column("LF.foot.force[3]"), np.arange(1.0, 12.0))
    np.testing.assert_array_equal(recording.columns(CONTACT)[:, 0], np.arange(11) % 2 == 0)


def test_a_noisy_force_sensor_reads_the_force_times_random_numbers_of_the_seed() -> None:
    noisy = "{time=0.01, duration=0.03, leg='LM', fault='noisy', noise=0.2}"
    measured, _ = sensed(noisy, "seed=7")
    factor = 1.0 + 0.2 * np.random.default_rng(7).standard_normal((11, 6, 3))[:10, 1, 2]
    true = np.arange(10) + 1.0
    np.testing.assert_array_equal(forces(measured, 1)[2:8], (true * factor)[2:8])
    np.testing.assert_array_equal(forces(measured, 1)[8:], true[8:])
    np.testing.assert_array_equal(forces(measured, 0), true)


# ------------------------------------------------------------------------------------------------
# servos and commands


def test_a_kinematic_drive_has_no_faulty_servo() -> None:
    limp = "events=[{time=0.1, leg='RM', joint='tibia', fault='limp'}]"
    scenario = load_scenario("walk_flat", overrides=[limp, "servo.mode=kinematic"])
    with pytest.raises(ScenarioError, match=r"RM\.tibia limp at 0\.1 s.*servo\.mode=torque"):
        simulate(scenario)


@pytest.mark.parametrize("lost", ["command", "step"])
def test_the_last_command_stays_while_commands_are_lost_but_for_the_first(lost: str) -> None:
    events = (
        f"{{time=1e-9, duration=0.009, lost='{lost}'}}, "
        f"{{time=0.015, duration=0.01, lost='{lost}'}}"
    )
    measured, recording = sensed(events)
    kept = [0, 0, 2, 2, 2, 5, 6, 7, 8, 9]
    assert len(measured) == STEPS  # a controller is called all the same: its time goes on
    np.testing.assert_array_equal(recording.column("LF.coxa.torque_ref")[:STEPS], kept)
    # in a dropped macro-step the last readings stay as well
    read = np.array(kept if lost == "step" else range(STEPS))
    np.testing.assert_array_equal([one.angle[0, 0] for one in measured], 0.001 * read)
    np.testing.assert_array_equal(forces(measured, 5), read + 1.0)
    np.testing.assert_allclose(yaws(measured), 0.1 * read, rtol=0.0, atol=1e-15)


# ------------------------------------------------------------------------------------------------
# events


@pytest.mark.parametrize(
    ("event", "message"),
    [
        ("{time=1, leg='LF', fault='late'}", "a late reading without a delay"),
        ("{time=1, leg='LF', fault='dead', delay=0.1}", "a delay of readings that are not late"),
        ("{time=1, sensor='gyro', fault='dead'}", "'gyro'"),
        ("{time=1, sensor='attitude', leg='LF', fault='dead'}", "leg"),
        ("{time=1, sensor='angle', leg='LF', fault='dead'}", "joint"),
        ("{time=1, duration=1, lost='all'}", "'all'"),
        ("{time=1, leg='LF', joint='all', fault='weak', share=2}", "share"),
        (
            "{time=1, parameter='foot.radius', value=0.02}",
            "an event on a fixed parameter: got 'foot.radius'",
        ),
        ("{time=1, parameter='servo.kpp', value=40}", "did you mean 'servo.kp'"),
        (
            "{time=1, parameter='friction.mu', value=-1}",
            "event at 1 s: friction.mu is out of range: got -1.0, expected 0 to 100 1; "
            "give a value within",
        ),
        ("{time=2, parameter='torso.mass', value=0}", "got 0.0, expected 1e-09 to 1e+09 kg"),
        ("{time=1, sensor='attitude', fault='noisy'}", "'noisy'"),
    ],
)
def test_an_event_that_makes_no_sense_is_refused(event: str, message: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        load_scenario("walk_flat", overrides=[f"events=[{event}]"])
    assert message in str(caught.value)


def test_events_are_described_in_order_and_survive_a_scenario_file() -> None:
    events = (
        "{time=3, duration=0.5, lost='step'}, {time=1, leg='LM', fault='nan'}, "
        "{time=1.1, sensor='angle', leg='LM', joint='coxa', fault='stuck'}, "
        "{time=1.2, sensor='attitude', fault='dead'}, "
        "{time=1.3, leg='LM', fault='late', delay='20 ms', duration=2}, "
        "{time=2, leg='RF', joint='coxa', fault='limp', duration=0.5}, "
        "{time=2.5, duration=0.1, force=[0, 40, 0]}, "
        "{time=2.6, duration=0.1, lost='command'}, {time=3.5, leg='LM', fault='stuck'}"
    )
    scenario = load_scenario("walk_flat", overrides=[f"events=[{events}]"])
    assert [event["text"] for event in event_log(scenario.events, 3.2)] == [
        "the force sensor of LM reads NaN",
        "the angle sensor of LM.coxa repeats its last reading",
        "the attitude sensor reads level and at rest",
        "the force sensor of LM is late by 20 ms, for 2 s",
        "the servo of RF.coxa is limp, for 0.5 s",
        "a push of [0, 40, 0] N and [0, 0, 0] N m, for 0.1 s",
        "the joint commands are lost, and the last one holds, for 0.1 s",
        "macro-steps are dropped: the last readings and joint commands hold, for 0.5 s",
    ]
    assert describe_event(scenario.events[-1]) == "the force sensor of LM repeats its last reading"
    again = scenario_from_table(scenario.to_table(), where="again.toml")
    assert again.events == scenario.events


FOUND = [
    "the controller finds that the servo of LF.femur does not work",
    "the controller walks without LF",
]


@pytest.mark.parametrize(
    ("control", "fault", "status"),
    [
        ("kinematic", "sensor='attitude', fault='nan'", "completed"),
        ("compliant", "leg='LF', fault='nan'", "completed"),
        ("compliant", "sensor='angle', leg='LF', joint='femur', fault='stuck'", "completed"),
        ("compliant", "sensor='angle', leg='LF', joint='femur', fault='nan'", "failed"),
    ],
)
def test_a_walk_with_faulty_sensors_goes_on_or_says_why_it_ended(
    plant_build: Path, tmp_path: Path, control: str, fault: str, status: str
) -> None:
    overrides = ["duration=0.3", f"control={control}", f"events=[{{time=0.1, {fault}}}]"]
    result = simulate(load_scenario("walk_flat", overrides=overrides))
    assert result.outcome.status == status
    write_result(result, tmp_path)
    given, *found = read_facts(tmp_path)["events"]
    assert given["time"] == 0.1
    # to the controller, a joint whose angle stays is one whose servo does not work
    stuck = "femur" in fault and "stuck" in fault
    assert [event["text"] for event in found] == (FOUND if stuck else [])
    assert all(0.1 < event["time"] < 0.2 for event in found)
    if status == "failed":
        assert 0.1 <= result.outcome.simulated < 0.2
        assert "nan" in result.outcome.reason.lower()
    else:
        assert np.isfinite(result.outcome.recording.data).all()
