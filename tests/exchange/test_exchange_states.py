"""Tests states, event indicators and events of model exchange."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from exchange_calls import LEGS, ROUNDING, STATES, fetched, put_states
from fmi_plant import ATHENA, DISCARD, ERROR, MODEL_EXCHANGE, OK, Plant

INDICATORS = 50


class EventInfo(ctypes.Structure):
    """The structure fmi2EventInfo."""

    _fields_ = (
        *(
            (name, ctypes.c_int)
            for name in ("needed", "terminate", "nominals", "states", "time_defined")
        ),
        ("time", ctypes.c_double),
    )


@pytest.fixture
def solved(plant_library: Path) -> Iterator[Plant]:
    """Returns an initialized instance for model exchange, in event mode."""
    with Plant(plant_library, kind=MODEL_EXCHANGE) as instance:
        yield instance.initialize()


def test_the_states_are_the_variables_that_show_them(solved: Plant) -> None:
    x = fetched(solved, "fmi2GetContinuousStates", len(STATES))
    np.testing.assert_allclose(solved.reals(STATES), x, atol=ROUNDING)
    rates = fetched(solved, "fmi2GetDerivatives", len(STATES))
    np.testing.assert_allclose(
        solved.reals([state.derivative for state in ATHENA.states]),
        rates,
        atol=ROUNDING * np.abs(rates).max(),
    )


def test_states_that_are_set_are_shown(solved: Plant) -> None:
    assert solved.call("fmi2EnterContinuousTimeMode") == OK
    x = fetched(solved, "fmi2GetContinuousStates", len(STATES)) + np.random.default_rng(1).normal(
        0.0, 0.01, len(STATES)
    )
    assert solved.call("fmi2SetTime", 0.5) == OK
    assert put_states(solved, x) == OK
    assert (fetched(solved, "fmi2GetContinuousStates", len(STATES)) == x).all()
    np.testing.assert_allclose(solved.reals(STATES), x, atol=ROUNDING)


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e200])
def test_invalid_states_are_discarded_and_change_nothing(solved: Plant, bad: float) -> None:
    assert solved.call("fmi2EnterContinuousTimeMode") == OK
    x, seen = fetched(solved, "fmi2GetContinuousStates", len(STATES)), solved.everything()
    for place, value in ((20, bad), (slice(3, 7), 0.0)):
        wrong = x.copy()
        wrong[place] = value
        assert put_states(solved, wrong) == DISCARD
        assert "expected a state of the robot" in solved.last_message
    assert put_states(solved, x[:-1]) == ERROR
    assert "got 69 places, expected 70" in solved.last_message
    assert np.isfinite(bad) or solved.call("fmi2SetTime", float(bad)) == ERROR
    assert solved.everything() == seen


def test_indicators_are_the_feet_s_penetrations_and_an_event_closes_a_foot(solved: Plant) -> None:
    indicators, depths = (
        [f"{leg}.foot.{name}" for leg in LEGS] for name in ("event_indicator", "penetration")
    )
    all_indicators = fetched(solved, "fmi2GetEventIndicators", INDICATORS)
    assert all_indicators[: len(LEGS)].tolist() == solved.reals(indicators)
    np.testing.assert_allclose(
        solved.reals(indicators), solved.reals(depths), atol=1e-10 + ROUNDING
    )
    assert solved.call("fmi2EnterContinuousTimeMode") == OK
    x = fetched(solved, "fmi2GetContinuousStates", len(STATES))
    height, closed = (
        STATES.index("torso.position[3]"),
        ATHENA.references([f"{leg}.foot.contact" for leg in LEGS]),
    )
    for z, contact in (
        (0.05, 1.0),
        (0.0, 0.0),
    ):  # the motion is upwards: the feet count as closed until the event, after which they are open
        moved = x.copy()
        moved[height] += z
        assert put_states(solved, moved) == OK
        assert solved.get_references("fmi2GetBoolean", closed) == (OK, [contact] * 6)
        info = EventInfo()
        assert solved.call("fmi2EnterEventMode") == OK
        assert solved.call("fmi2NewDiscreteStates", ctypes.byref(info)) == OK
        assert not any((info.needed, info.terminate, info.nominals, info.states, info.time_defined))
        assert solved.get_references("fmi2GetBoolean", closed) == (OK, [1.0 - contact] * 6)
        assert solved.call("fmi2EnterContinuousTimeMode") == OK


def test_a_foot_that_lifts_off_slackens_its_bristles_and_changes_no_other_state(
    plant_library: Path,
) -> None:
    with Plant(plant_library, kind=MODEL_EXCHANGE) as plant:
        assert (
            plant.set_references("fmi2SetInteger", ATHENA.references(["friction.law"]), [3]) == OK
        )
        plant.initialize()
        assert plant.call("fmi2EnterContinuousTimeMode") == OK
        x = fetched(plant, "fmi2GetContinuousStates", len(STATES))
        x[STATES.index("LF.foot.bristle[1]") :] = 1e-5
        x[STATES.index("torso.position[3]")] += 0.1
        assert put_states(plant, x) == OK
        info = EventInfo()
        assert plant.call("fmi2EnterEventMode") == OK
        assert plant.call("fmi2NewDiscreteStates", ctypes.byref(info)) == OK
        assert info.states == 1
        now = fetched(plant, "fmi2GetContinuousStates", len(STATES))
        changed = {
            name for name, before, after in zip(STATES, x, now, strict=True) if before != after
        }
        assert changed == set(STATES[-18:]) == ATHENA.reinitialised
        assert not now[-18:].any()


def test_a_saved_state_holds_the_contacts_and_the_solver_s_state(solved: Plant) -> None:
    assert solved.call("fmi2EnterContinuousTimeMode") == OK
    saved, seen = solved.save(), solved.everything()
    x = fetched(solved, "fmi2GetContinuousStates", len(STATES))
    assert put_states(solved, x + 0.01) == OK
    assert solved.call("fmi2EnterEventMode") == OK
    assert solved.call("fmi2NewDiscreteStates", ctypes.byref(EventInfo())) == OK
    assert solved.call("fmi2SetFMUstate", saved) == OK
    assert solved.everything() == seen
    assert (fetched(solved, "fmi2GetContinuousStates", len(STATES)) == x).all()
    solved.free(saved)


def test_a_state_of_the_other_interface_is_refused(solved: Plant, running: Plant) -> None:
    saved = solved.save()
    status, copied = running.deserialize(solved.serialize(saved))
    assert status == OK
    assert running.call("fmi2SetFMUstate", copied) == ERROR
    assert "one of the other interface" in running.last_message
    running.free(copied)
    solved.free(saved)


def test_calls_of_the_other_interface_are_refused_by_name(solved: Plant, running: Plant) -> None:
    assert solved.step(0.0, 0.01) == ERROR
    assert (
        "fmi2DoStep: got a call of co-simulation, expected one of model exchange"
        in solved.last_message
    )
    assert running.call("fmi2EnterContinuousTimeMode") == ERROR
    assert "got a call of model exchange, expected one of co-simulation" in running.last_message
