"""Tests model exchange, derivatives and dependencies, which other solvers and tools use."""

from __future__ import annotations

import ctypes
import itertools
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmi_plant import ATHENA, DISCARD, ERROR, MODEL_EXCHANGE, OK, Plant
from fmpy import simulate_fmu
from numpy.typing import NDArray

Array = NDArray[np.float64]

STATES = [state.name for state in ATHENA.states]
INPUTS = [variable.name for variable in ATHENA.of_causality("input")]
UNKNOWNS = [
    variable.name for variable in ATHENA.of_causality("output", "local") if variable.type == "Real"
]
STEPPED = [
    name
    for name in UNKNOWNS
    if name.startswith("solver.") or ATHENA.variable(name).variability == "discrete"
]
LEGS = ("LF", "LM", "LR", "RF", "RM", "RR")
INDICATORS = 50
ROUNDING = 1e-12  # relative to the largest number of its kind


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


def doubles(values: Sequence[float] | Array) -> ctypes.Array[ctypes.c_double]:
    return (ctypes.c_double * len(values))(*values)


def fetched(plant: Plant, function: str, n: int) -> Array:
    place = doubles(np.full(n, np.nan))
    assert plant.call(function, place, ctypes.c_size_t(n)) == OK, plant.last_message
    return np.array(place)


def put_states(plant: Plant, x: Array) -> int:
    return plant.call("fmi2SetContinuousStates", doubles(x), ctypes.c_size_t(len(x)))


def directional(
    plant: Plant, unknowns: Sequence[str], knowns: Sequence[str], change: Sequence[float] | Array
) -> tuple[int, Array]:
    """Returns status and directional derivatives of the unknowns."""
    wanted, given = ATHENA.references(unknowns), ATHENA.references(knowns)
    result = doubles(np.full(len(wanted), np.nan))
    status = plant.call(
        "fmi2GetDirectionalDerivative",
        (ctypes.c_uint * len(wanted))(*wanted),
        ctypes.c_size_t(len(wanted)),
        (ctypes.c_uint * len(given))(*given),
        ctypes.c_size_t(len(given)),
        doubles(change),
        result,
    )
    return status, np.array(result)


def set_rates(plant: Plant, rates: dict[str, float], *, order: int = 1) -> int:
    references = ATHENA.references(rates)
    n = len(references)
    orders = (ctypes.c_int * n)(*[order] * n)
    return plant.call(
        "fmi2SetRealInputDerivatives",
        (ctypes.c_uint * n)(*references),
        ctypes.c_size_t(n),
        orders,
        doubles(list(rates.values())),
    )


def output_rates(plant: Plant, names: Sequence[str]) -> Array:
    references, n = ATHENA.references(names), len(names)
    result = doubles(np.zeros(n))
    orders = (ctypes.c_int * n)(*[1] * n)
    assert (
        plant.call(
            "fmi2GetRealOutputDerivatives",
            (ctypes.c_uint * n)(*references),
            ctypes.c_size_t(n),
            orders,
            result,
        )
        == OK
    )
    return np.array(result)


# ---- other solvers

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
    theirs = simulate_fmu(
        str(athena_fmu),
        fmi_type="ModelExchange",
        solver="CVode",
        relative_tolerance=1e-10,
        record_events=False,
        **asked,
    )
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


def test_the_commands_of_a_walk_give_the_same_path_with_another_solver(athena_fmu: Path) -> None:
    t = np.linspace(0.0, 0.2, 201)
    columns = {
        "time": t,
        "LF.femur.angle_ref": 0.4 + 0.5 * t,
        "RM.coxa.angle_ref": 0.3 * t,
        "torso.push_force[2]": 20.0 * t,
    }
    signals = np.zeros(len(t), dtype=[(name, np.float64) for name in columns])
    for name, values in columns.items():
        signals[name] = values
    asked = {
        "input": signals,
        "stop_time": 0.2,
        "output_interval": 0.02,
        "output": STATES[:7],
        "start_values": {"solver.tolerance": 1e-9},
    }
    theirs = simulate_fmu(
        str(athena_fmu),
        fmi_type="ModelExchange",
        solver="CVode",
        relative_tolerance=1e-7,
        record_events=False,
        **asked,
    )
    ours = simulate_fmu(
        str(athena_fmu), fmi_type="CoSimulation", **(asked | {"output_interval": 0.0005})
    )
    late = (
        0.5 * 0.0005 * 0.5
        # m; a command that is held for 0.5 ms lags by half of that, with speeds of 0.5 rad/s and
        # legs of 0.5 m
    )
    for name in STATES[:7]:
        np.testing.assert_allclose(
            theirs[name],
            np.interp(theirs["time"], ours["time"], ours[name]),
            atol=late,
            err_msg=name,
        )


# ---- states and events


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


@pytest.mark.parametrize("depth", [0.0, 4e-11, -4e-11, 2e-10, -2e-10])
@pytest.mark.parametrize("speed", [0.0, 1e-6, -1e-6])
def test_feet_at_the_ground_s_surface_stand_on_it(
    plant_library: Path, athena_fmu: Path, depth: float, speed: float
) -> None:
    """An event indicator agrees with the contact, so the contact of a foot that starts, rests or
    reverses within 0.1 nm of the ground is not lost.
    """
    with Plant(plant_library, kind=MODEL_EXCHANGE) as plant:
        plant.set_reals({"solver.tolerance": 1e-8})
        deepest = max(plant.reals([f"{leg}.foot.penetration" for leg in LEGS]))
        height = plant.real("initial.position[3]") + deepest - depth
        assert plant.set_reals({"initial.position[3]": height, "initial.velocity[3]": speed}) == OK
        plant.initialize()
        assert plant.call("fmi2NewDiscreteStates", ctypes.byref(EventInfo())) == OK
        closed = plant.get_references(
            "fmi2GetBoolean", ATHENA.references([f"{leg}.foot.contact" for leg in LEGS])
        )[1]
        assert [
            float(z > 0.0)
            for z in fetched(plant, "fmi2GetEventIndicators", INDICATORS)[: len(LEGS)]
        ] == closed
    start = {"initial.position[3]": height, "initial.velocity[3]": speed}
    asked = {
        "start_values": start,
        "stop_time": 0.1,
        "output_interval": 0.02,
        "output": ["torso.position[3]"],
    }
    ours = simulate_fmu(str(athena_fmu), fmi_type="CoSimulation", **asked)
    theirs = simulate_fmu(
        str(athena_fmu),
        fmi_type="ModelExchange",
        solver="CVode",
        relative_tolerance=1e-8,
        record_events=False,
        **asked,
    )
    np.testing.assert_allclose(
        theirs["torso.position[3]"], ours["torso.position[3]"], atol=1e-5
    )  # co-simulation at its default tolerance


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


def test_nominals_are_those_of_the_description(solved: Plant) -> None:
    assert fetched(solved, "fmi2GetNominalsOfContinuousStates", len(STATES)).tolist() == [
        ATHENA.variable(n).nominal for n in STATES
    ]


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
    assert running.call("fmi2EnterEventMode") == ERROR
    assert "got a call of model exchange, expected one of co-simulation" in running.last_message


@pytest.mark.parametrize(
    "function", ["fmi2EnterEventMode", "fmi2CompletedIntegratorStep", "fmi2SetContinuousStates"]
)
def test_continuous_time_calls_need_continuous_time_mode(solved: Plant, function: str) -> None:
    assert solved.call(function) == ERROR
    assert "in event mode" in solved.last_message


def test_no_integrator_step_needs_an_event(solved: Plant) -> None:
    event, end = ctypes.c_int(7), ctypes.c_int(7)
    assert solved.call("fmi2EnterContinuousTimeMode") == OK
    assert (
        solved.call("fmi2CompletedIntegratorStep", 1, ctypes.byref(event), ctypes.byref(end)) == OK
    )
    assert (event.value, end.value) == (0, 0)


# ---- directional derivatives


def test_derivatives_of_many_knowns_are_the_sum_of_each_one_s(running: Plant) -> None:
    running.step(0.0, 0.01)
    rng = np.random.default_rng(3)
    knowns, change = [*STATES, *INPUTS], rng.normal(0.0, 1.0, len(STATES) + len(INPUTS))
    together = directional(running, UNKNOWNS, knowns, change)[1]
    single = sum(
        weight * directional(running, UNKNOWNS, [known], [1.0])[1]
        for known, weight in zip(knowns, change, strict=True)
    )
    np.testing.assert_allclose(
        together, single, atol=1e-11 * np.abs(together).max()
    )  # rounding of sums of 130 terms


def test_derivatives_do_not_depend_on_the_size_of_the_change(running: Plant) -> None:
    known = ["torso.position[3]"]
    unit = directional(running, UNKNOWNS, known, [1.0])[1]
    for size in (1e-100, 1e-8, 1e100):
        np.testing.assert_allclose(
            directional(running, UNKNOWNS, known, [size])[1] / size, unit, rtol=ROUNDING
        )


def test_a_servo_s_torque_falls_with_its_angle_by_its_stiffness(running: Plant) -> None:
    status, value = directional(running, ["LF.femur.torque"], ["LF.femur.angle"], [1.0])
    assert (status, value[0]) == (OK, pytest.approx(-running.real("servo.kp"), rel=ROUNDING))


@pytest.mark.parametrize(
    ("unknown", "known", "message"),
    [
        (
            "torso.roll",
            "servo.kp",
            "got the known servo.kp, expected an input or a continuous state",
        ),
        ("torso.roll", "torso.roll", "got the known torso.roll"),
        (
            "servo.kp",
            "torso.velocity[1]",
            "got the unknown servo.kp, expected an output or a derivative",
        ),
    ],
)
def test_derivatives_of_or_by_others_are_refused(
    running: Plant, unknown: str, known: str, message: str
) -> None:
    status, value = directional(running, [unknown], [known], [1.0])
    assert status == ERROR
    assert message in running.last_message
    assert np.isnan(value).all()


def test_a_direction_that_is_not_finite_is_refused(running: Plant) -> None:
    assert directional(running, ["torso.roll"], ["torso.velocity[1]"], [np.nan])[0] == ERROR
    assert "not finite" in running.last_message


# ---- derivatives of inputs and outputs


@pytest.mark.parametrize("mode", [1, 3])
def test_an_input_that_moves_is_the_limit_of_one_that_is_set_often(
    plant_library: Path, mode: int
) -> None:
    rates = {"LF.femur.angle_ref": 0.5, "RM.coxa.angle_ref": -0.3, "torso.push_force[2]": 100.0}
    ends = []
    for pieces in (1, 200, 400):
        with Plant(plant_library) as plant:
            assert plant.set_reals({"solver.tolerance": 1e-8}) == OK
            assert (
                plant.set_references("fmi2SetInteger", ATHENA.references(["servo.mode"]), [mode])
                == OK
            )
            plant.initialize()
            value = dict(zip(rates, plant.reals(rates), strict=True))
            for i in range(pieces):
                t, h = 0.02 * i / pieces, 0.02 / pieces
                assert (
                    plant.set_reals(
                        {
                            name: value[name] + rate * (t + (pieces > 1) * 0.5 * h)
                            for name, rate in rates.items()
                        }
                    )
                    == OK
                )
                assert pieces > 1 or set_rates(plant, rates) == OK
                assert plant.step(t, h) == OK, plant.last_message
            ends.append(np.array(plant.reals(STATES)))
    works = np.array([name.startswith("energy.") for name in STATES])
    moving, coarse, fine = (end[~works] for end in ends)
    assert (
        np.abs(moving - fine).max() < 0.35 * np.abs(moving - coarse).max() + 1e-7
    )  # the error of order 2 is a quarter; 1e-7 is the solver's error
    np.testing.assert_allclose(
        ends[0][works], ends[2][works], rtol=1e-4
    )  # the error is of order 2 in the step, which is longer without interruptions


def test_a_kinematic_joint_keeps_its_speed_while_another_one_s_angle_has_a_rate(
    plant_library: Path,
) -> None:
    """In kinematic mode a derivative of one angle_ref does not affect other joints."""
    angles = []
    for rates in ({}, {"LF.coxa.angle_ref": 0.1}):
        with Plant(plant_library) as plant:
            assert (
                plant.set_references("fmi2SetInteger", ATHENA.references(["servo.mode"]), [3]) == OK
            )
            plant.initialize()
            assert plant.set_reals({"RM.femur.speed_ref": 0.5}) == OK
            assert not rates or set_rates(plant, rates) == OK
            assert plant.step(0.0, 0.05) == OK
            angles.append(plant.real("RM.femur.angle"))
    assert angles[0] == pytest.approx(angles[1], abs=1e-6)


def test_an_input_with_a_rate_keeps_its_value_at_the_end_of_the_step(running: Plant) -> None:
    assert set_rates(running, {"torso.push_force[1]": 100.0}) == OK
    assert running.step(0.0, 0.01) == OK
    assert running.real("torso.push_force[1]") == pytest.approx(1.0)
    assert running.step(0.01, 0.01) == OK
    assert running.real("torso.push_force[1]") == pytest.approx(1.0)


def test_invalid_rates_of_inputs_are_refused_together(running: Plant) -> None:
    before = running.everything()
    assert set_rates(running, {"torso.push_force[1]": 1.0, "torso.push_force[2]": np.nan}) == ERROR
    assert "derivative of torso.push_force[2]: got nan" in running.last_message
    assert set_rates(running, {"torso.roll": 1.0}) == ERROR
    assert set_rates(running, {"torso.push_force[1]": 1.0}, order=2) == ERROR
    assert "got order 2, expected 1" in running.last_message
    assert running.step(0.0, 0.01) == OK
    assert running.real("torso.push_force[1]") == 0.0
    assert set_rates(running, {"LF.femur.angle_ref": 1e4}) == OK
    assert running.step(0.01, 0.01) == ERROR
    assert "expected one that leaves it in" in running.last_message
    assert len(before) == len(running.everything())


def test_rates_of_outputs_are_their_slopes_over_time(running: Plant) -> None:
    names = [
        name
        for name in UNKNOWNS
        if name not in STEPPED and ATHENA.variable(name).causality == "output"
    ]
    names = [name for name in names if not name.startswith("constraint.")]
    peaks = (
        "peak_force",
        "peak_force_rate",
        "landing_rate",
    )  # peaks of whole steps, which are no functions of time
    names = [name for name in names if name.rpartition(".")[2] not in peaks]
    h, t, samples = 1e-4, 0.005, []
    assert running.call("fmi2SetRealInputDerivatives", None, ctypes.c_size_t(0), None, None) == OK
    assert (
        running.set_reals({"LF.femur.angle_ref": running.real("LF.femur.angle_ref") + 0.01}) == OK
    )
    assert running.step(0.0, t) == OK
    for k in range(5):
        if k == 2:
            slopes = output_rates(running, names)
        samples.append(np.array(running.reals(names)))
        assert running.step(t + k * h, h) == OK
    central = (samples[0] - 8.0 * samples[1] + 8.0 * samples[3] - samples[4]) / (12.0 * h)
    scale = np.maximum(
        np.abs(central), [float(ATHENA.variable(name).nominal or 1.0) for name in names]
    )
    np.testing.assert_array_less(
        np.abs(slopes - central) / scale, 0.02
    )  # derivative from five points of a solution with errors of 1e-6, 0.1 ms apart


# ---- dependencies

VARIANTS: tuple[dict[str, float], ...] = (
    {},
    {"friction.law": 3, "terrain.kind": 2, "terrain.incline": 0.1, "terrain.heading": 0.5},
    {"servo.mode": 3, "terrain.kind": 2, "terrain.incline": 0.1},
    # torso, knees and shanks are in the ground
    {
        "body.torso_box[3]": 0.3,
        "body.knee_radius": 0.35,
        "body.shank_radius": 0.35,
        "terrain.kind": 2,
        "terrain.incline": 0.1,
        "terrain.heading": 0.5,
    },
    # neighbouring legs overlap
    {"body.self_contact": 3, "body.knee_radius": 0.12, "body.shank_radius": 0.12},
)


def moved(library: Path, variant: dict[str, float], *, initialize: bool = True) -> Plant:
    """Returns a moving instance in an asymmetric posture, with all feet deep in soft ground."""
    plant, rng = Plant(library), np.random.default_rng(5)
    soft = {
        "contact.law": 5,
        "contact.damping_factor": 0.1,
        "contact.stiffness": 1e3,
        "friction.presliding": 1e-5,
        "friction.mu": 0.1,
        "foot.radius": 0.16,
        "terrain.height": -0.07,
    }
    for name, value in (soft | variant).items():
        kind = "fmi2SetReal" if ATHENA.variable(name).type == "Real" else "fmi2SetInteger"
        assert plant.set_references(kind, ATHENA.references([name]), [value]) == OK
    names = [n.name for n in ATHENA.of_causality("parameter") if n.name.startswith("initial.")]
    assert plant.set_reals({name: plant.real(name) + rng.normal(0.0, 0.05) for name in names}) == OK
    assert (
        plant.set_reals(
            {f"torso.push_{kind}[{i}]": 1.0 for kind in ("force", "torque") for i in (1, 2, 3)}
        )
        == OK
    )
    return plant.initialize() if initialize else plant


def test_dependencies_of_unknowns_are_those_of_the_description(plant_library: Path) -> None:
    knowns = [*STATES, *INPUTS]
    seen = np.zeros((len(UNKNOWNS), len(knowns)), dtype=bool)
    for variant in VARIANTS:
        with moved(plant_library, variant) as plant:
            for start, end in itertools.pairwise(
                (0.0, 0.0005, 0.001, 0.002, 0.005, 0.01)
            ):  # some feet slide, some stick
                assert plant.step(start, end - start) == OK, plant.last_message
                jacobian = np.array(
                    [directional(plant, UNKNOWNS, [known], [1.0])[1] for known in knowns]
                ).T
                # smaller values are rounding
                seen |= np.abs(jacobian) > 1e-9 * np.abs(jacobian).max(axis=0)
    for name, row in zip(UNKNOWNS, seen, strict=True):
        found, stated = (
            {known for known, does in zip(knowns, row, strict=True) if does},
            ATHENA.depends(name),
        )
        assert stated is None or found <= set(stated), (
            f"{name} depends on {found - set(stated or ())} too"
        )
        assert stated is None or kinds(stated) == kinds(found), (
            f"{name} depends on {kinds(found)} alone, whatever the index"
        )


def kinds(names: Iterable[str]) -> set[str]:
    """Returns the names without their indices."""
    return {name.partition("[")[0] for name in names}


def test_initial_dependencies_of_unknowns_are_those_of_the_description(
    plant_library: Path,
) -> None:
    """Each parameter is changed separately in both directions, since a kink may hide one."""
    names = [
        *(
            variable.name
            for variable in ATHENA.of_causality("parameter")
            if variable.type == "Real"
        ),
        *INPUTS,
    ]
    seen = {name: set[str]() for name in UNKNOWNS}
    for variant in VARIANTS:
        with moved(plant_library, variant, initialize=False) as plant:
            before, value = (
                np.array(plant.reals(UNKNOWNS)),
                dict(zip(names, plant.reals(names), strict=True)),
            )
            for name, sign in itertools.product(names, (1.0, -1.0)):
                if (
                    plant.set_reals(
                        {
                            name: value[name] * (1.0 + sign * 0.01)
                            + sign * 1e-3 * (value[name] == 0.0)
                        }
                    )
                    != OK
                ):
                    continue
                status, values = plant.get_references("fmi2GetReal", ATHENA.references(UNKNOWNS))
                for unknown in (
                    np.array(UNKNOWNS)[
                        np.abs(np.array(values) - before) > 1e-9 * np.abs(before) + ROUNDING
                    ]
                    if status == OK
                    else ()
                ):
                    seen[unknown].add(name)
                assert plant.set_reals({name: value[name]}) == OK
    for name, found in seen.items():
        stated = ATHENA.depends_initially(name)
        assert stated is None or found <= set(stated), (
            f"{name} depends on {found - set(stated or ())} too"
        )


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
