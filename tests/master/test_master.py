"""The co-simulation loop: order of calls, times, recorded rows, and runs that do not complete."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest
from fake_plant import SPEED, FakeController, FakePlant

from hexapod_cosim.controller import BodyCommand, Diagnostics, JointCommand, Measurement
from hexapod_cosim.cosim.master.loop import (
    FAILED,
    INTERRUPTED,
    JointController,
    Outcome,
    diagnostic_columns,
    run,
)
from hexapod_cosim.cosim.master.recorder import Recorder, Recording
from hexapod_cosim.cosim.master.sensors import MEASURED, errors_of
from hexapod_cosim.cosim.master.signals import Signals
from hexapod_cosim.cosim.results.locomotion import locomotion_of
from hexapod_cosim.cosim.results.window import View
from hexapod_cosim.cosim.scenario.events import Push
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.cosim.scenario.schedule import make_schedule, push_rows
from hexapod_cosim.models import FmuError, HexapodError


def scenario_of(*settings: str) -> Scenario:
    return load_scenario("walk_flat", overrides=settings)


def run_fake(plant: FakePlant, controller: JointController, scenario: Scenario) -> Outcome:
    schedule = make_schedule(scenario)
    signals = Signals(plant, errors=errors_of(scenario, schedule))
    return run(
        plant,
        signals,
        controller,
        schedule,
        Recorder(signals, schedule.times, schedule.rows),
        h=scenario.macro_step,
    )


def test_each_macro_step_reads_controls_sets_and_steps_in_this_order() -> None:
    plant = FakePlant()
    run_fake(plant, FakeController(plant.log), scenario_of("duration=0.01"))
    once = ["controller", "set", "step", "get", "get"]
    assert plant.log == ["get", "get", *once, *once]


def test_times_are_start_plus_k_h_and_not_a_running_sum() -> None:
    plant, controller = FakePlant(), FakeController()
    outcome = run_fake(
        plant, controller, scenario_of("duration=3", "macro_step=0.001", "start=0.1")
    )
    expected = [0.1 + k * 0.001 for k in range(3001)]
    assert outcome.recording.time.tolist() == expected
    assert controller.times == expected[:-1]
    assert plant.steps == [(t, 0.001) for t in expected[:-1]]


def test_a_row_holds_the_outputs_read_and_the_inputs_set_at_its_time() -> None:
    outcome = run_fake(FakePlant(), FakeController(), scenario_of("duration=0.05"))
    recording = outcome.recording
    assert len(recording.time) == 11
    np.testing.assert_array_equal(recording.joints("torque_ref")[:-1, 0, 0], recording.time[:-1])
    np.testing.assert_array_equal(recording.joints("angle")[1:], recording.joints("angle_ref")[:-1])
    np.testing.assert_allclose(
        recording.column("torso.position[1]") - recording.column("torso.position[1]")[0],
        SPEED * recording.time,
        atol=1e-15,
    )


def test_measurements_are_views_on_what_the_plant_gave() -> None:
    plant = FakePlant()
    for number, name in enumerate(name for names in MEASURED.values() for name in names):
        plant.values[name] = float(number)
    plant.values["LM.foot.contact"] = 1.0
    signals = Signals(plant)
    signals.read()
    measured = signals.measurement
    shown = [
        measured.angle,
        measured.speed,
        measured.foot_force,
        measured.quaternion,
        measured.angular_velocity,
    ]
    assert np.concatenate([array.ravel() for array in shown]).tolist() == list(range(61))
    assert measured.contact.tolist() == [False, True, False, False, False, False]
    assert all(np.shares_memory(array, signals.outputs.values) for array in shown)
    row = dict(zip(signals.names, signals.values.tolist(), strict=True))
    assert (row["LF.femur.angle"], row["LF.foot.contact"], row["LM.foot.contact"]) == (
        1.0,
        0.0,
        1.0,
    )


def test_a_step_that_the_plant_refuses_ends_the_run_and_keeps_its_rows() -> None:
    outcome = run_fake(FakePlant(refuse_at=0.02), FakeController(), scenario_of("duration=0.1"))
    assert outcome.status == FAILED
    assert "from 0.02 s" in outcome.reason
    assert "left the numbers" in outcome.reason
    np.testing.assert_allclose(outcome.recording.time, [0.0, 0.005, 0.01, 0.015, 0.02])
    assert outcome.simulated == pytest.approx(0.02)


def test_an_interrupt_ends_the_run_and_keeps_its_rows() -> None:
    outcome = run_fake(
        FakePlant(refuse_at=0.02, interrupt=True), FakeController(), scenario_of("duration=0.1")
    )
    assert outcome.status == INTERRUPTED
    assert len(outcome.recording.time) == 5


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (HexapodError("no more"), "no more"),
        (ValueError("shapes differ"), "ValueError: shapes differ"),
    ],
)
def test_any_error_of_a_controller_ends_the_run_and_keeps_its_rows(
    error: Exception, reason: str
) -> None:
    class Broken(FakeController):
        def step(self, t: float, command: BodyCommand, measurement: Measurement) -> JointCommand:
            if t > 0.01:
                raise error
            return super().step(t, command, measurement)

    outcome = run_fake(FakePlant(), Broken(), scenario_of("duration=0.1"))
    assert (outcome.status, outcome.reason) == (FAILED, reason)
    assert len(outcome.recording.time) == 3


class Cautious(FakeController):
    """A controller that rejects one foot's sensor in the last quarter of 0.1 s."""

    def __init__(self) -> None:
        super().__init__()
        six, never = np.zeros(6), np.zeros(6, dtype=np.bool_)
        plane = np.zeros(6, dtype=np.complex128)
        self.diagnostics = Diagnostics(
            swinging=never,
            planned=np.zeros((6, 3)),
            shift=plane,
            lift=six,
            unreachable=never,
            fallback=never.copy(),
        )

    def step(self, t: float, command: BodyCommand, measurement: Measurement) -> JointCommand:
        self.diagnostics.fallback[4] = t > 0.0749
        return super().step(t, command, measurement)


def test_the_share_of_time_in_which_a_controller_fell_back_is_recorded_and_reported() -> None:
    scenario, controller = scenario_of("duration=0.1"), Cautious()
    signals, schedule = Signals(FakePlant()), make_schedule(scenario)
    recorder = Recorder(
        signals, schedule.times, schedule.rows, extra=diagnostic_columns(controller)
    )
    recording = run(
        FakePlant(), signals, controller, schedule, recorder, h=scenario.macro_step
    ).recording
    assert recording.column("controller.RM.fallback").tolist() == [0.0] * 15 + [1.0] * 6
    assert not recording.column("controller.LM.fallback").any()
    measured = locomotion_of(View(recording, FakePlant().parameters(), 1.0), upright=True)
    assert measured.fallback == pytest.approx(6 / 21)


def test_progress_reaches_the_whole_duration() -> None:
    measured: list[float] = []
    plant = FakePlant()
    signals, schedule = Signals(plant), make_schedule(scenario_of("duration=1"))
    run(
        plant,
        signals,
        FakeController(),
        schedule,
        Recorder(signals, schedule.times, schedule.rows),
        h=0.005,
        progress=measured.append,
    )
    assert measured == sorted(measured)
    assert measured[-1] == pytest.approx(1.0)


def test_a_command_holds_from_its_time_on() -> None:
    scenario = scenario_of(
        "duration=0.1", "command=[{vx=0.1}, {time=0.05, yaw_rate=0.2, height='5 mm'}]"
    )
    controller = FakeController()
    outcome = run_fake(FakePlant(), controller, scenario)
    assert controller.commands[9] == BodyCommand(0.1, 0.0, 0.0)
    assert controller.commands[10] == BodyCommand(0.0, 0.0, 0.2, 0.005)
    assert outcome.recording.column("command.yaw_rate").tolist() == [0.0] * 10 + [0.2] * 11


@pytest.mark.parametrize("h", [0.001, 0.003, 0.005, 0.02])
def test_the_impulse_of_a_push_does_not_depend_on_the_macro_step(h: float) -> None:
    push = Push(time=0.0512, duration=0.0371, force=(0.0, 40.0, 0.0), torque=(0.0, 0.0, 2.0))
    rows = push_rows([push], h * np.arange(100.0, dtype=np.float64), h)
    np.testing.assert_allclose(
        rows.sum(axis=0) * h, 0.0371 * np.array([0, 40, 0, 0, 0, 2]), rtol=1e-12
    )


def test_a_push_reaches_the_plant_only_while_it_lasts() -> None:
    outcome = run_fake(
        FakePlant(),
        FakeController(),
        scenario_of("duration=0.1", "events=[{time=0.02, duration=0.03, force=[1, 2, 3]}]"),
    )
    pushed = outcome.recording.columns(["torso.push_force[1]", "torso.push_force[3]"])
    np.testing.assert_allclose(pushed[4:10], [[1.0, 3.0]] * 6)
    np.testing.assert_allclose(np.delete(pushed, range(4, 10), axis=0), 0.0)


def measured_forces(seed: int, noise: float) -> np.ndarray:
    plant, controller = FakePlant(), FakeController()
    plant.values["LF.foot.force[3]"] = 10.0
    run_fake(
        plant,
        controller,
        scenario_of("duration=2", f"seed={seed}", f"sensors.foot_force_noise={noise}"),
    )
    return np.array(controller.forces)


def test_force_noise_is_seeded_unbiased_and_of_the_size_asked_for() -> None:
    measured = measured_forces(1, 0.05)
    np.testing.assert_array_equal(measured, measured_forces(1, 0.05))
    assert not np.array_equal(measured, measured_forces(2, 0.05))
    vertical = measured[:, 0, 2]
    assert vertical.std() == pytest.approx(0.5, rel=0.15)  # 400 samples: 3.5 % standard error
    assert vertical.mean() == pytest.approx(10.0, abs=0.1)
    assert not measured[:, 1:].any()


def test_a_plant_that_lacks_a_variable_is_refused_by_its_name() -> None:
    with pytest.raises(FmuError, match=r"not a hexapod plant: got 'no LM.femur.angle_ref'"):
        Signals(FakePlant(missing=["LM.femur.angle_ref"]))


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("names", [["b", "c"], ["c", "b"], ["a", "c"], ["d"], []])
def test_columns_are_those_named_and_adjoin_in_memory(
    names: list[str], order: Literal["C", "F"]
) -> None:
    """Sums over rows depend on the layout in their last bits, so that it must not vary."""
    data = np.arange(12.0).reshape(3, 4)
    found = Recording(("a", "b", "c", "d"), np.array(data, order=order)).columns(names)
    assert found.tolist() == data[:, ["abcd".index(name) for name in names]].tolist()
    assert found.flags.f_contiguous


def test_columns_are_chosen_by_pattern_and_a_misspelt_one_is_refused() -> None:
    recording = Recording(
        ("time", "torso.position[1]", "torso.position[2]", "LF.foot.contact"), np.zeros((2, 4))
    )
    assert recording.chosen(["torso.*[2]", "*.contact"]).names == (
        "time",
        "torso.position[2]",
        "LF.foot.contact",
    )
    with pytest.raises(HexapodError, match=r"did you mean 'torso.position\[1\]'"):
        recording.chosen(["torso.positon[1]"])
    with pytest.raises(HexapodError, match=r"did you mean 'LF.foot.contact'"):
        recording.column("LF.foot.contakt")
