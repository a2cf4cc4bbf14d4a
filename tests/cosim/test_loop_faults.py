"""Faults of servos, lost commands and controllers that do not answer, on a fake plant; sensors
that read NaN on the plant.
"""

from __future__ import annotations

import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fake_plant import FakeController, FakePlant

from hexapod_cosim.controller import BodyCommand, JointCommand, Measurement
from hexapod_cosim.cosim.master.loop import Outcome, run
from hexapod_cosim.cosim.master.recorder import Recorder
from hexapod_cosim.cosim.master.signals import Signals
from hexapod_cosim.cosim.results.results import read_facts, write_result
from hexapod_cosim.cosim.run.single_run import make_sensor, simulate
from hexapod_cosim.cosim.run.walker import Walker
from hexapod_cosim.cosim.scenario.event_log import event_log
from hexapod_cosim.cosim.scenario.scenario import load_scenario
from hexapod_cosim.cosim.scenario.schedule import make_schedule
from hexapod_cosim.models import ScenarioError


class Hanging(FakeController):
    """A controller whose fourth call does not return."""

    def step(self, t: float, command: BodyCommand, measurement: Measurement) -> JointCommand:
        while len(self.times) == 3:
            pass
        return super().step(t, command, measurement)


def outcome_of(
    events: str, controller: FakeController | None = None, time_limit: float = 60.0
) -> Outcome:
    """Runs ten steps of 5 ms."""
    scenario = load_scenario("walk_flat", overrides=["duration=0.05", f"events={events}"])
    plant, schedule = FakePlant(), make_schedule(scenario)
    signals = Signals(plant)
    return run(
        plant,
        signals,
        FakeController() if controller is None else controller,
        schedule,
        Recorder(signals, schedule.times, schedule.rows),
        h=scenario.macro_step,
        time_limit=time_limit,
    )


def column(outcome: Outcome, name: str) -> Any:
    return outcome.recording.column(name)[:10]


def test_a_stuck_servo_holds_the_angle_at_which_it_stuck() -> None:
    """Healthy joints of the fake plant move by 0.001 rad in a step."""
    outcome = outcome_of("[{time=0.015, leg='LF', joint='femur', fault='stuck', duration=0.02}]")
    start = column(outcome, "LF.femur.angle")[0]
    moved = column(outcome, "LF.femur.angle_ref") - start
    expected = 0.001 * np.array([1, 2, 3, 3, 3, 3, 3, 4, 5, 6])
    np.testing.assert_allclose(moved, expected, rtol=0.0, atol=1e-12)
    torque = column(outcome, "LF.femur.torque_ref")
    np.testing.assert_array_equal(torque[3:7], 0.0)
    assert torque[2] == 0.01
    assert column(outcome, "LF.tibia.torque_ref")[5] == 0.025


def test_a_dead_servo_follows_its_joint_without_torque() -> None:
    outcome = outcome_of("[{time=0.015, leg='RM', joint='tibia', fault='dead'}]")
    angle, command = column(outcome, "RM.tibia.angle"), column(outcome, "RM.tibia.angle_ref")
    np.testing.assert_array_equal(command[3:], angle[3:])
    np.testing.assert_array_equal(column(outcome, "RM.tibia.torque_ref")[3:], 0.0)
    assert command[2] != angle[2]


def test_a_kinematic_drive_has_no_dead_servo() -> None:
    dead = "events=[{time=0.1, leg='RM', joint='tibia', fault='dead'}]"
    scenario = load_scenario("walk_flat", overrides=[dead, "servo.mode=kinematic"])
    with pytest.raises(ScenarioError, match=r"RM\.tibia dead at 0\.1 s.*servo\.mode=torque"):
        simulate(scenario)


def test_the_last_command_holds_while_commands_are_lost() -> None:
    controller = FakeController()
    outcome = outcome_of("[{time=0.015, duration=0.01, lost='command'}]", controller)
    assert outcome.status == "completed"
    assert len(controller.times) == 10
    torque = column(outcome, "LF.coxa.torque_ref")
    np.testing.assert_allclose(
        torque, 0.005 * np.array([0, 1, 2, 2, 2, 5, 6, 7, 8, 9]), rtol=0.0, atol=1e-15
    )


def test_the_first_command_is_never_lost() -> None:
    outcome = outcome_of("[{time=1e-9, duration=0.009, lost='command'}]")
    np.testing.assert_allclose(
        column(outcome, "LF.coxa.angle_ref")[:4],
        [0.001, 0.001, 0.002, 0.003],
        rtol=0.0,
        atol=1e-12,
    )


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="this system has no such timer")
def test_a_controller_that_does_not_answer_ends_the_run_and_the_rows_until_then_are_kept() -> None:
    before = signal.getsignal(signal.SIGALRM)
    outcome = outcome_of("[]", Hanging(), time_limit=0.05)
    assert outcome.status == "failed"
    assert outcome.reason == "TimeoutError: the controller has not answered for 0.05 s"
    assert len(outcome.recording.time) == 3
    assert signal.getsignal(signal.SIGALRM) == before
    assert signal.getitimer(signal.ITIMER_REAL)[0] == 0.0


def test_the_log_names_every_event_that_has_begun() -> None:
    scenario = load_scenario(
        "walk_flat",
        overrides=[
            "events=[{time=3, duration=0.1, lost='command'}, {time=1, leg='LM', fault='nan'}, "
            "{time=2, leg='RF', joint='coxa', fault='dead', duration=0.5}, "
            "{time=2.5, duration=0.1, force=[0, 40, 0]}, {time=3.5, leg='LM', fault='stuck'}]"
        ],
    )
    assert [f"{event['time']:g} s: {event['text']}" for event in event_log(scenario, 3.2)] == [
        "1 s: the force sensor of LM reads NaN",
        "2 s: the servo of RF.coxa is dead: it follows the joint without torque, for 0.5 s",
        "2.5 s: a push of [0, 40, 0] N and [0, 0, 0] N m, for 0.1 s",
        "3 s: the joint commands are lost, and the last one holds, for 0.1 s",
    ]


def test_a_walk_with_faults_is_the_same_in_both_loops_and_its_events_are_stored(
    tmp_path: Path,
) -> None:
    scenario = load_scenario(
        "walk_flat",
        overrides=[
            "duration=0.4",
            "events=[{time=0.1, duration=0.02, lost='command'}, "
            "{time=0.2, leg='RM', joint='tibia', fault='stuck'}]",
        ],
    )
    result = simulate(scenario)
    assert result.outcome.status == "completed"
    with Walker() as walker:
        assert walker.simulate(scenario).metrics == {
            **result.metrics,
            "realtime_factor": pytest.approx(result.metrics["realtime_factor"], abs=1e9),
        }
    write_result(result, tmp_path)
    assert [event["time"] for event in read_facts(tmp_path)["events"]] == [0.1, 0.2]


def test_a_sensor_that_reads_nan_gives_no_contact() -> None:
    scenario = load_scenario(
        "walk_flat", overrides=["duration=0.05", "events=[{time=0.02, leg='LF', fault='nan'}]"]
    )
    sensor = make_sensor(scenario, make_schedule(scenario))
    assert sensor is not None
    for k in range(10):
        sensor.read(np.ones((6, 3)), np.ones(6, dtype=np.int32))
        assert np.isnan(sensor.force).any(axis=1).tolist() == [k >= 4, *5 * [False]]
        assert sensor.contact.tolist() == [k < 4, *5 * [True]]


def test_a_compliant_walk_goes_on_with_finite_commands_when_a_sensor_reads_nan() -> None:
    scenario = load_scenario(
        "walk_flat",
        overrides=[
            "duration=0.5",
            "control=compliant",
            "events=[{time=0.2, leg='LF', fault='nan'}]",
        ],
    )
    outcome = simulate(scenario).outcome
    assert outcome.status == "completed"
    assert np.isfinite(outcome.recording.data).all()
