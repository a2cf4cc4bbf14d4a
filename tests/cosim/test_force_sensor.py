"""Readings of delayed or broken force sensors, compared with the true forces of a fake plant."""

from __future__ import annotations

import numpy as np
import pytest
from fake_plant import FakeController, FakePlant
from numpy.typing import NDArray

from hexapod_cosim.controller import BodyCommand, JointCommand, Measurement
from hexapod_cosim.cosim.master.loop import run
from hexapod_cosim.cosim.master.recorder import Recorder, Recording
from hexapod_cosim.cosim.master.signals import CONTACT, Signals
from hexapod_cosim.cosim.run.single_run import make_sensor
from hexapod_cosim.cosim.scenario.scenario import load_scenario
from hexapod_cosim.cosim.scenario.schedule import make_schedule
from hexapod_cosim.models import LEG_NAMES

Readings = NDArray[np.float64]
LF, RM = LEG_NAMES.index("LF"), LEG_NAMES.index("RM")


class CountingPlant(FakePlant):
    """A plant whose vertical foot forces are the number of steps done, plus one.

    A foot is in contact after an even number of steps.
    """

    def step(self, t: float, h: float) -> None:
        super().step(t, h)
        self.show()

    def show(self) -> None:
        for leg in LEG_NAMES:
            self.values[f"{leg}.foot.force[3]"] = float(len(self.steps) + 1)
            self.values[f"{leg}.foot.contact"] = float(len(self.steps) % 2 == 0)


class Listener(FakeController):
    """A controller that records measured contacts as well."""

    def __init__(self) -> None:
        super().__init__()
        self.contacts: list[NDArray[np.bool_]] = []

    def step(self, t: float, command: BodyCommand, measurement: Measurement) -> JointCommand:
        self.contacts.append(measurement.contact.copy())
        return super().step(t, command, measurement)


def measured(*settings: str) -> tuple[Readings, NDArray[np.bool_], Recording]:
    """Returns the measured vertical forces and contacts (steps, 6) of 10 steps of 5 ms, and the
    recording.
    """
    scenario = load_scenario("walk_flat", overrides=["duration=0.05", *settings])
    plant, listener, schedule = CountingPlant(), Listener(), make_schedule(scenario)
    plant.show()
    signals = Signals(plant, sensor=make_sensor(scenario, schedule))
    outcome = run(
        plant,
        signals,
        listener,
        schedule,
        Recorder(signals, schedule.times, schedule.rows),
        h=scenario.macro_step,
    )
    assert outcome.status == "completed", outcome.reason
    return np.array(listener.forces)[:, :, 2], np.array(listener.contacts), outcome.recording


TRUE = np.arange(1.0, 11.0)


@pytest.mark.parametrize(
    ("delay", "steps"),
    [("0", 0), ("5 ms", 1), ("5.1 ms", 2), ("10 ms", 2), ("0.02", 4), ("1 ms", 1)],
)
def test_readings_are_late_by_whole_steps_and_the_first_holds_until_they_come(
    delay: str, steps: int
) -> None:
    forces, contacts, _ = measured(f"sensors.foot_force_delay={delay}")
    late = np.maximum(TRUE - steps, 1.0)
    for leg in range(6):
        np.testing.assert_array_equal(forces[:, leg], late)
        np.testing.assert_array_equal(contacts[:, leg], late % 2 == 1)


def test_a_dead_sensor_reads_nothing_while_the_others_go_on() -> None:
    forces, contacts, _ = measured("events=[{time=0.015, leg='LF', fault='dead', duration=0.01}]")
    gone = (np.arange(10) == 3) | (np.arange(10) == 4)
    np.testing.assert_array_equal(forces[:, LF], np.where(gone, 0.0, TRUE))
    np.testing.assert_array_equal(contacts[:, LF], ~gone & (TRUE % 2 == 1))
    np.testing.assert_array_equal(forces[:, RM], TRUE)


def test_a_stuck_sensor_keeps_its_last_reading_for_good() -> None:
    forces, contacts, _ = measured("events=[{time=0.015, leg='RM', fault='stuck'}]")
    np.testing.assert_array_equal(forces[:, RM], np.minimum(TRUE, 3.0))
    np.testing.assert_array_equal(contacts[:, RM], np.minimum(TRUE, 3.0) % 2 == 1)
    np.testing.assert_array_equal(forces[:, LF], TRUE)


def test_a_sensor_stuck_from_the_start_keeps_its_first_reading() -> None:
    forces, contacts, _ = measured("events=[{time=0, leg='RM', fault='stuck'}]")
    assert (forces[:, RM] == 1.0).all()
    assert contacts[:, RM].all()


def test_a_late_sensor_sticks_at_what_it_last_read_and_not_at_what_was_true() -> None:
    forces, _, _ = measured(
        "sensors.foot_force_delay=10 ms", "events=[{time=0.025, leg='LF', fault='stuck'}]"
    )
    np.testing.assert_array_equal(forces[:, LF], [1, 1, 1, 2, 3, 3, 3, 3, 3, 3])


def test_what_is_recorded_is_true_whatever_is_measured() -> None:
    settings = (
        "sensors.foot_force_noise=0.05",
        "sensors.foot_force_delay=10 ms",
        "events=[{time=0, leg='LF', fault='dead'}]",
    )
    _, _, recording = measured(*settings)
    np.testing.assert_array_equal(recording.column("LF.foot.force[3]"), np.arange(1.0, 12.0))
    np.testing.assert_array_equal(recording.columns(CONTACT)[:, 0], np.arange(11) % 2 == 0)


def test_a_delay_changes_when_noise_is_measured_and_not_what_it_is() -> None:
    early, _, _ = measured("sensors.foot_force_noise=0.05")
    late, _, _ = measured("sensors.foot_force_noise=0.05", "sensors.foot_force_delay=10 ms")
    np.testing.assert_array_equal(late[2:], early[:-2])
