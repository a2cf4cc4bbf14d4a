"""Tests directional derivatives, and the rates of inputs and outputs over time."""

from __future__ import annotations

import ctypes
from pathlib import Path

import numpy as np
import pytest
from exchange_calls import INPUTS, STATES, UNKNOWNS, directional, output_rates, set_rates
from fmi_plant import ATHENA, ERROR, OK, Plant

STEPPED = [
    name
    for name in UNKNOWNS
    if name.startswith("solver.") or ATHENA.variable(name).variability == "discrete"
]


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


@pytest.mark.parametrize(
    ("unknown", "known", "message"),
    [
        (
            "torso.roll",
            "foot.radius",
            "foot.radius, expected an input, a continuous state or a tunable parameter",
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
