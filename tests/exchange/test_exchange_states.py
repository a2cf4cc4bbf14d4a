"""Tests states, event indicators and events of model exchange, and that other solvers find the
same motion by it as co-simulation does.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from functools import partialmethod
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from exchange_calls import LEGS, ROUNDING, STATES, fetched, put_states, solved_by_cvode
from fmi_plant import ATHENA, DISCARD, ERROR, MODEL_EXCHANGE, OK, Plant
from fmpy import simulate_fmu
from fmpy.sundials import CVodeSolver
from fmpy.util import read_csv

from hexapod_cosim import simulate
from hexapod_cosim.cosim.results.recordings import write_commands

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


# Tests that other solvers find the same motion by model exchange as co-simulation does.

THROWN = {
    "initial.position[3]": 0.15,
    "initial.velocity[1]": 0.2,
    "initial.angular_velocity[2]": 0.5,
}
CONVERGED = 2e-9  # m, rad; both solvers have 1e-9, and twelve touch-downs amplify the difference


@pytest.mark.parametrize("law", ["tanh", "bristle"])
def test_another_solver_finds_the_same_motion(athena_fmu: Path, law: str) -> None:
    names = [
        *STATES[:7],
        *(f"{leg}.{joint}.angle" for leg in LEGS for joint in ("coxa", "femur", "tibia")),
        "solver.touchdowns",
    ]
    start = THROWN | {"solver.tolerance": 1e-10, "friction.law": {"tanh": 1, "bristle": 3}[law]}
    asked = {"start_values": start, "stop_time": 0.12, "output_interval": 0.01, "output": names}
    ours = simulate_fmu(str(athena_fmu), fmi_type="CoSimulation", **asked)
    theirs = solved_by_cvode(athena_fmu, 1e-10, **asked)
    assert ours["solver.touchdowns"][-1] == theirs["solver.touchdowns"][-1] >= 8
    for name in names[:-1]:
        np.testing.assert_allclose(theirs[name], ours[name], atol=CONVERGED, err_msg=name)


def test_measures_with_another_solver_equal_those_of_co_simulation(athena_fmu: Path) -> None:
    """fmpy calls fmi2CompletedIntegratorStep at every output; the measures follow the path between
    these calls.
    """
    summed = ("positive_work", "negative_work", "torque_squared")
    names = [
        f"{leg}.{joint}.{name}"
        for name in summed
        for leg in LEGS
        for joint in ("coxa", "femur", "tibia")
    ]
    names += [
        f"{leg}.foot.{name}" for name in ("impulse", "slip_distance", "landings") for leg in LEGS
    ]
    names += ["energy.contact_loss", "energy.friction_loss", "energy.gear_loss"]
    asked = {
        "start_values": THROWN | {"solver.tolerance": 1e-8},
        "stop_time": 0.12,
        "output": names,
    }
    ours = simulate_fmu(str(athena_fmu), fmi_type="CoSimulation", output_interval=0.005, **asked)
    exchange = {
        "fmi_type": "ModelExchange",
        "solver": "CVode",
        "relative_tolerance": 1e-8,
        "record_events": False,
    }
    theirs = simulate_fmu(str(athena_fmu), output_interval=2e-4, **exchange, **asked)
    for name in (
        *summed,
        "impulse",
        "slip_distance",
        "landings",
        "contact_loss",
        "friction_loss",
        "gear_loss",
    ):
        sums = [
            sum(run[full][-1] for full in names if full.endswith(f".{name}"))
            for run in (ours, theirs)
        ]
        assert sums[1] == pytest.approx(sums[0], rel=0.01), name
        assert sums[0] > 0.0, name


def folded(position: float) -> dict[str, float]:
    """Returns the start of an upturned robot with folded legs whose joints are held."""
    start = {"initial.position[3]": position}
    for k, value in enumerate((0.0, 1.0, 0.05, 0.02)):
        start[f"initial.quaternion[{k + 1}]"] = value
    for leg in LEGS:
        for joint, angle in (("coxa", 0.0), ("femur", -0.3), ("tibia", 0.2)):
            start[f"initial.{leg}.{joint}.angle"] = start[f"{leg}.{joint}.angle_ref"] = angle
    return start


def meeting() -> dict[str, float]:
    """Returns the start of a floating robot whose legs LF and LM turn towards each other."""
    start = {"initial.position[3]": 1.0, "gravity[3]": 0.0, "body.self_contact": 3.0}
    for leg, side, bend in (("LF", 1.0, 0.386), ("LM", -1.0, 0.536)):
        start[f"initial.{leg}.coxa.angle"] = 0.55 * side
        start[f"initial.{leg}.femur.angle"] = start[f"{leg}.femur.angle_ref"] = bend
        start[f"{leg}.coxa.angle_ref"] = 0.8 * side
    return start


@pytest.mark.parametrize("start", [folded(0.08), meeting()], ids=["torso", "legs"])
def test_contacts_of_bodies_and_legs_are_events_of_the_importer(
    athena_fmu: Path, start: dict[str, float]
) -> None:
    """The energy books of a drop on the back and of colliding legs close in model exchange, and the
    losses are those of co-simulation.
    """
    asked: dict[str, Any] = {"start_values": start, "stop_time": 0.2, "output_interval": 0.01}
    asked["output"] = ["energy.residual", "energy.contact_loss", "energy.dissipated"]
    solver = {"solver": "CVode", "relative_tolerance": 1e-7}
    theirs = simulate_fmu(str(athena_fmu), fmi_type="ModelExchange", **solver, **asked)
    ours = simulate_fmu(str(athena_fmu), fmi_type="CoSimulation", **asked)
    assert len(theirs) > len(ours)  # rows at events
    lost = float(ours["energy.dissipated"][-1])
    assert float(ours["energy.contact_loss"][-1]) > 1e-3
    assert abs(float(theirs["energy.residual"][-1])) < 1e-3 * lost
    assert float(theirs["energy.dissipated"][-1]) == pytest.approx(lost, rel=2e-2)


def test_the_page_says_how_fmpy_takes_more_steps_than_500(
    athena_fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A walk at a tolerance of 1e-8 needs more of them between outputs every 5 ms."""
    walk = simulate("walk_flat", "kinematic", settings={"duration": 0.05}).recording
    write_commands(walk, tmp_path / "commands.csv")
    asked: dict[str, Any] = {
        "stop_time": 0.05,
        "output_interval": 0.005,
        "relative_tolerance": 1e-8,
    }
    asked |= {"fmi_type": "ModelExchange", "input": read_csv(tmp_path / "commands.csv")}
    with pytest.raises(RuntimeError, match="mxstep steps taken"):
        simulate_fmu(str(athena_fmu), **asked)
    page = (Path(__file__).parents[2] / "docs" / "howto" / "fmi.md").read_text(encoding="utf-8")
    assert "partialmethod(CVodeSolver.__init__, maxNumSteps=100_000)" in " ".join(page.split())
    more = partialmethod(CVodeSolver.__init__, maxNumSteps=100_000)
    monkeypatch.setattr(CVodeSolver, "__init__", more)
    assert simulate_fmu(str(athena_fmu), **asked)["time"][-1] == pytest.approx(0.05, abs=1e-12)
