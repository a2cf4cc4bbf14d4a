"""Tests derivatives by tunable parameters against differences, and adjoint ones against columns."""

from __future__ import annotations

import ctypes
from pathlib import Path

import numpy as np
import pytest
from exchange_calls import INPUTS, STATES, UNKNOWNS, Array, directional, fetched, put_states
from fmi3_plant import ARRAYS, Plant3
from fmi_plant import ATHENA, MODEL_EXCHANGE, OK, Plant

from hexapod_cosim.models.kinematics import rotation_matrix

PARAMETERS = (
    "torso.mass", "torso.com[1]", "torso.inertia_xx", "LF.tibia.mass", "RM.femur.com[1]",
    "LR.coxa.inertia_zz", "contact.stiffness", "contact.restitution", "friction.mu",
    "friction.slope", "servo.kp", "servo.kd", "servo.rotor_inertia", "servo.coulomb_friction",
    "gravity[3]",
)  # fmt: skip
BOOKED = ("energy.residual", "energy.parameter_work")  # depend on how a parameter came about
SHOWN = [name for name in UNKNOWNS if name not in BOOKED]
DIFFERENCE = 2e-6  # relative to the largest of its kind: of differences of order two
COLUMNS = 1e-12  # relative: rounding of sums


# a motor with measured friction and a battery
MOTOR = {
    "servo.voltage": 12.0, "servo.duty_max": 0.12, "servo.torque_constant": 1.3,
    "servo.resistance": 2.4, "servo.viscous_friction": 0.05, "servo.stribeck_friction": 0.1,
    "servo.stribeck_speed": 0.04, "servo.stribeck_exponent": 1.4, "servo.supply_resistance": 0.2,
    "servo.derate_temperature": 320.0, "servo.start_temperature": 330.0,
    "servo.winding_capacity": 5.0, "servo.housing_capacity": 50.0,
}  # fmt: skip
OF_MOTOR = (
    "servo.kp", "servo.voltage", "servo.duty_max", "servo.torque_constant", "servo.resistance",
    "servo.stribeck_friction", "servo.stribeck_speed", "servo.stribeck_exponent",
    "servo.supply_resistance", "servo.derate_temperature", "LF.femur.angle_ref",
)  # fmt: skip
LOADS = (
    "servo.motor_load_friction", "servo.external_load_friction",
    "servo.stribeck_motor_load_friction", "servo.stribeck_external_load_friction",
    "servo.quadratic_motor_friction", "servo.quadratic_external_friction",
)  # fmt: skip


def walking(library: Path, *, start: dict[str, float] | None = None) -> Plant:
    """Returns an instance in event mode that stands with speeds on all joints; start: of a motor's
    servos.
    """
    plant = Plant(library, kind=MODEL_EXCHANGE)
    if start:
        drive = ATHENA.references(["servo.drive"])
        assert plant.set_references("fmi2SetInteger", drive, [2]) == OK
        assert plant.set_reals(start) == OK
    plant.initialize()
    assert plant.call("fmi2NewDiscreteStates", ctypes.create_string_buffer(64)) == OK
    assert plant.call("fmi2EnterContinuousTimeMode") == OK
    rng, x = np.random.default_rng(4), fetched(plant, "fmi2GetContinuousStates", len(STATES))
    moving = np.array([name.endswith(".speed") or "velocity" in name for name in STATES])
    assert put_states(plant, x + moving * rng.normal(0.0, 0.05, len(x))) == OK
    assert plant.call("fmi2EnterEventMode") == OK
    return plant


def shown_at(plant: Plant, name: str, value: float, x: Array) -> Array:
    """Returns the unknowns at a parameter and states."""
    assert plant.set_reals({name: value}) == OK
    assert plant.call("fmi2NewDiscreteStates", ctypes.create_string_buffer(64)) == OK
    assert plant.call("fmi2EnterContinuousTimeMode") == OK
    assert put_states(plant, x) == OK
    shown = np.array(plant.reals(SHOWN))
    assert plant.call("fmi2EnterEventMode") == OK
    return shown


def limits_of_differences(plant: Plant, name: str, share: float) -> tuple[Array, Array]:
    """Compares the derivatives by a number with differences over a share of it; returns both."""
    x, value = fetched(plant, "fmi2GetContinuousStates", len(STATES)), plant.real(name)
    status, exact = directional(plant, SHOWN, [name], [1.0])
    assert status == OK, plant.last_message
    h = share * (abs(value) or 1.0)
    ends = [shown_at(plant, name, value + sign * h, x) for sign in (1.0, -1.0)]
    found = (ends[0] - ends[1]) / (2.0 * h)
    size = np.abs(ends[0]) / (abs(value) or 1.0) * 1e-6 + np.abs(found).max() * DIFFERENCE
    assert np.all(np.abs(exact - found) <= size)
    assert np.abs(exact).max() > 0.0
    return exact, found


@pytest.mark.parametrize("name", PARAMETERS)
def test_derivatives_by_parameters_are_the_limits_of_differences(
    plant_library: Path, name: str
) -> None:
    limits_of_differences(walking(plant_library), name, 1e-4)


def test_seeds_of_the_torso_s_state_give_the_derivative_by_a_tuned_centre_of_mass(
    running: Plant,
) -> None:
    assert running.set_reals({"torso.push_torque[3]": 3.0, "torso.push_force[2]": 20.0}) == OK
    assert running.step(0.0, 0.05) == OK
    quaternion = np.array(running.reals([f"torso.quaternion[{i}]" for i in (1, 2, 3, 4)]))
    spin = np.array(running.reals([f"torso.angular_velocity[{i}]" for i in (1, 2, 3)]))
    moved = rotation_matrix(quaternion)[:, 1]  # by a change of torso.com[2]
    knowns = [f"torso.{of}[{i}]" for of in ("position", "velocity") for i in (1, 2, 3)]
    change = [1.0, *moved, *np.cross(spin, moved)]
    exact = directional(running, SHOWN, ["torso.com[2]", *knowns], change)[1]
    held = directional(running, SHOWN, ["torso.com[2]"], [1.0])[1]
    com, h, ends = running.real("torso.com[2]"), 1e-5, []
    for sign in (1.0, -1.0):
        state = running.save()
        assert running.set_reals({"torso.com[2]": com + sign * h}) == OK
        ends.append(np.array(running.reals(SHOWN)))
        assert running.call("fmi2SetFMUstate", state) == OK
        running.free(state)
    found = (ends[0] - ends[1]) / (2.0 * h)
    size = np.abs(found).max() * DIFFERENCE
    assert np.all(np.abs(exact - found) <= size)
    assert np.abs(held - found).max() > 1.0


@pytest.mark.parametrize("name", OF_MOTOR)
def test_derivatives_by_a_motor_s_numbers_and_commands_are_the_limits_of_differences(
    plant_library: Path, name: str
) -> None:
    exact, found = limits_of_differences(walking(plant_library, start=MOTOR), name, 1e-5)
    voltage = SHOWN.index("supply.voltage")
    assert exact[voltage] == pytest.approx(found[voltage], rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("name", LOADS)
def test_a_share_of_load_that_is_0_has_the_derivative_of_one_that_rises(
    plant_library: Path, name: str
) -> None:
    plant = walking(plant_library, start=MOTOR)
    x = fetched(plant, "fmi2GetContinuousStates", len(STATES))
    assert plant.real(name) == 0.0
    exact = directional(plant, SHOWN, [name], [1.0])[1]
    h = 1e-4
    ends = [shown_at(plant, name, k * h, x) for k in range(3)]
    found = (4.0 * ends[1] - 3.0 * ends[0] - ends[2]) / (2.0 * h)
    assert np.all(np.abs(exact - found) <= np.abs(ends[0]) * 1e-6 + np.abs(found).max() * 1e-6)
    assert np.abs(exact).max() > 0.0


def test_adjoint_derivatives_are_the_seeded_sums_of_columns(
    running3: Plant3, running: Plant
) -> None:
    running3.step(0.0, 0.01)
    running.step(0.0, 0.01)
    rng = np.random.default_rng(1)
    wanted = [ARRAYS[name] for name in ("der(speed)", "foot.force", "torso.velocity")]
    given = [ARRAYS[name] for name in ("torque_ref", "angle", "servo.kp", "torso.com")]
    rows, columns = (sum(len(one.elements) for one in group) for group in (wanted, given))
    seed = rng.normal(0.0, 1.0, rows)
    result = (ctypes.c_double * columns)()
    references = [(ctypes.c_uint * len(g))(*(a.reference for a in g)) for g in (wanted, given)]
    assert running3.call(
        "fmi3GetAdjointDerivative", references[0], len(wanted), references[1], len(given),
        (ctypes.c_double * rows)(*seed), rows, result, columns,
    ) == OK, running3.last_message  # fmt: skip
    names = [element.name for array in wanted for element in array.elements]
    jacobian = np.column_stack(
        [
            directional(running, names, [element.name], [1.0])[1]
            for array in given
            for element in array.elements
        ]
    )
    allowed = COLUMNS * (np.abs(seed) @ np.abs(jacobian))
    assert np.all(np.abs(np.array(result) - seed @ jacobian) <= allowed)


def test_a_direction_of_states_inputs_and_parameters_is_the_sum_of_each(running: Plant) -> None:
    running.step(0.0, 0.01)
    knowns = [STATES[3], INPUTS[4], "servo.kp", "torso.mass"]
    change = [0.3, -2.0, 5.0, 0.7]
    together = directional(running, SHOWN, knowns, change)[1]
    single = sum(
        c * directional(running, SHOWN, [k], [1.0])[1] for k, c in zip(knowns, change, strict=True)
    )
    np.testing.assert_allclose(together, single, atol=1e-10 * np.abs(together).max())


def test_a_fixed_parameter_has_no_derivative(running: Plant) -> None:
    assert directional(running, ["torso.roll"], ["foot.radius"], [1.0])[0] != OK
    assert "tunable parameter" in running.last_message
    assert ATHENA.variable("foot.radius").variability == "fixed"
