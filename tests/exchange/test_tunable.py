"""Tests tunable parameters and faults of servos through the standard's interfaces."""

from __future__ import annotations

import ctypes
from pathlib import Path

import numpy as np
import pytest
from exchange_calls import STATES, fetched
from fmi3_plant import Plant3
from fmi_plant import ATHENA, ERROR, MODEL_EXCHANGE, OK, Plant

H = 0.005  # s
HEAVY = {"torso.mass": 6.0, "friction.mu": 0.2, "servo.kp": 20.0, "gravity[3]": -5.0}
MASS, COM = 6.0, 0.03


def test_both_standards_tune_alike_and_a_change_takes_effect_at_once(
    plant: Plant, plant3: Plant3
) -> None:
    plant.initialize()
    plant3.initialize()
    before = plant.real("energy.potential")
    assert plant.step(0.0, H) == OK
    assert plant3.step(0.0, H).status == OK
    assert plant.set_reals(HEAVY) == OK
    assert plant3.set({"torso.mass": MASS, "friction.mu": 0.2, "servo.kp": 20.0}) == OK
    gravity = plant3.get("gravity")[0]
    assert plant3.set({"gravity": [*gravity[:2], -5.0]}) == OK
    assert abs(plant.real("energy.potential") - before) > 0.1
    for k in range(1, 20):
        assert plant.step(k * H, H) == OK
        assert plant3.step(k * H, H).status == OK
    assert plant.real("torso.mass") == MASS
    assert plant.real("torso.position[3]") == plant3.get("torso.position")[0][2]
    assert plant.real("energy.residual") == plant3.get("energy.residual")[0]
    assert abs(plant.real("energy.residual")) < 1e-4


@pytest.mark.parametrize(
    "name", ["foot.radius", "LF.coxa.length", "solver.step", "initial.position[3]"]
)
def test_what_cannot_change_while_it_runs_is_refused_as_fixed(plant: Plant, name: str) -> None:
    plant.initialize()
    assert plant.set_reals({name: plant.real(name)}) == ERROR
    assert f"{name}: got a value after initialisation" in plant.last_message
    assert "fixed" in plant.last_message


def test_parameters_that_do_not_fit_together_refuse_the_step_until_they_are_corrected(
    plant: Plant,
) -> None:
    plant.initialize()
    right = ATHENA.variable("torso.inertia_zz").start or 0.0
    assert plant.set_reals({"torso.inertia_zz": 1.0}) == OK
    assert plant.step(0.0, H) == ERROR
    assert "torso.inertia_zz: got 1, expected an inertia" in plant.last_message
    assert plant.set_reals({"torso.inertia_zz": right}) == OK
    assert plant.step(0.0, H) == OK


def test_a_saved_state_holds_parameters_that_are_not_yet_in_force(
    plant: Plant, plant_library: Path
) -> None:
    plant.initialize()
    assert plant.step(0.0, H) == OK
    assert plant.set_reals(HEAVY) == OK
    data = plant.serialize(plant.save())
    with Plant(plant_library) as other:
        status, state = other.initialize().deserialize(data)
        assert status == OK
        assert other.call("fmi2SetFMUstate", state) == OK
        for each in (plant, other):
            assert each.step(H, H) == OK
        assert other.everything() == plant.everything()
    assert plant.call("fmi2Reset") == OK
    assert plant.real("torso.mass") == ATHENA.variable("torso.mass").start


def test_model_exchange_tunes_in_event_mode_and_reports_states_that_moved(
    plant_library: Path,
) -> None:
    with Plant(plant_library, kind=MODEL_EXCHANGE) as plant:
        plant.initialize()
        info = ctypes.create_string_buffer(64)
        changed = ctypes.c_int.from_buffer(info, 12)  # valuesOfContinuousStatesChanged
        assert plant.call("fmi2NewDiscreteStates", info) == OK
        x = fetched(plant, "fmi2GetContinuousStates", len(STATES))
        assert changed.value == 0
        assert plant.set_reals({"torso.com[1]": COM}) == OK
        assert plant.call("fmi2NewDiscreteStates", info) == OK
        assert changed.value == 1
        moved = fetched(plant, "fmi2GetContinuousStates", len(STATES)) - x
        start = ATHENA.variable("torso.com[1]").start or 0.0
        assert moved[0] == pytest.approx(COM - start, rel=1e-6)
        assert np.max(np.abs(moved[1:])) < 1e-6
        # a lock is an event as well; the joint's torque then holds it
        assert plant.set_reals({"LF.femur.lock": 1.0, "LF.femur.weakness": 1.0}) == OK
        assert plant.call("fmi2NewDiscreteStates", info) == OK
        assert changed.value == 1
        assert plant.real("LF.femur.torque") == 0.0


@pytest.mark.parametrize(("name", "value"), [("LF.femur.weakness", 1.01), ("LF.coxa.lock", -0.1)])
def test_faults_out_of_range_are_refused(plant: Plant, name: str, value: float) -> None:
    plant.initialize()
    assert plant.set_reals({name: value}) == ERROR
    assert name in plant.last_message


def test_a_locked_and_a_limp_leg_are_the_same_in_both_standards(
    plant: Plant, plant3: Plant3
) -> None:
    plant.initialize()
    plant3.initialize()
    lock, weakness = np.zeros((6, 3)), np.zeros((6, 3))
    lock[0], weakness[1] = 1.0, 1.0
    joints = [f"{leg}.{joint}" for leg in ("LF", "LM") for joint in ("coxa", "femur", "tibia")]
    assert plant.set_reals({f"{joint}.lock": 1.0 for joint in joints[:3]}) == OK
    assert plant.set_reals({f"{joint}.weakness": 1.0 for joint in joints[3:]}) == OK
    assert plant3.set({"lock": lock, "weakness": weakness}) == OK
    angle = plant.real("LM.femur.angle")
    for k in range(40):
        assert plant.step(k * H, H) == OK
        assert plant3.step(k * H, H).status == OK
    shown = np.reshape(plant.reals([f"{joint}.angle" for joint in joints]), (2, 3))
    assert np.array_equal(shown, plant3.get("angle")[0][:2])
    assert abs(shown[1, 1] - angle) > 1e-3  # the limp leg has given way
