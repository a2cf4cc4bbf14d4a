"""Compares the plant's outputs with the twin: energies, reactions, attitude, errors; tests the
default robot.
"""

from __future__ import annotations

import ctypes as ct
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mirror import OK, HxDefinition, HxInput
from plant import Plant, bound, definition, seen
from states import changed, distance, drifted, lopsided, random_command

from hexapod_cosim.models import load_robot
from hexapod_cosim.models.constraints import constraint_errors, joint_reactions
from hexapod_cosim.models.contact.geometry import foot_contacts
from hexapod_cosim.models.energy import kinetic_energy, potential_energy
from hexapod_cosim.models.kinematics import rotation_matrix

# relative: the same formula with its operations in another order, some hundred roundings
SAME = 1e-13
CONTACT_SAME = (
    # relative, of forces: a penetration of 1e-5 m is the difference of coordinates of about 0.1 m
    1e-10
)
SLOPE = {"kind": "slope", "height": -0.02, "incline": 0.3, "heading": 2.1}


@pytest.mark.parametrize("mode", ["position", "torque", "kinematic"])
def test_energies_reactions_torques_and_errors_shown_are_the_twins(
    core: ct.CDLL, mode: str
) -> None:
    robot = changed(lopsided(10), servo={"mode": mode})
    plant, body = drifted(core, robot, 10)
    command = random_command(robot, 10)
    output, solved = plant.output(command), plant.accelerations(command)
    force, torque = joint_reactions(robot, body, solved.multipliers)
    assert distance(output.reaction_force.reshape(18, 3), force) < SAME
    assert distance(output.reaction_torque.reshape(18, 3), torque) < 10.0 * SAME
    assert np.array_equal(output.torque, solved.drive_torque)
    assert output.energy.kinetic == pytest.approx(kinetic_energy(robot, body), rel=SAME)
    assert output.energy.potential == pytest.approx(potential_energy(robot, body), rel=CONTACT_SAME)
    errors = (output.constraint.position_error, output.constraint.velocity_error)
    assert errors == pytest.approx(constraint_errors(robot, body), rel=SAME)
    R = rotation_matrix(body[0, 3:7])
    assert (
        distance(output.imu.specific_force, R.T @ (solved.dv[0, 0:3] - np.array(robot.gravity)))
        < SAME
    )
    assert distance(output.imu.angular_velocity, R.T @ body[0, 10:13]) < SAME
    assert output.energy.residual == 0.0


@pytest.mark.parametrize("name", ["athena", "phantomx_mk4"])
def test_slip_speed_and_tangential_force_are_the_parts_along_the_ground(
    core: ct.CDLL, name: str
) -> None:
    robot = changed(load_robot(name), terrain=SLOPE, contact={"impact_speed_floor": 2.0})
    plant, body = drifted(core, robot, 11)
    foot = plant.output().foot
    for leg, contact in enumerate(foot_contacts(robot, body)):
        slip = contact.velocity - (contact.velocity @ contact.normal) * contact.normal
        along = foot.force[leg] - (foot.force[leg] @ contact.normal) * contact.normal
        assert foot.slip_speed[leg] == pytest.approx(float(np.linalg.norm(slip)), rel=SAME)
        assert foot.tangential_force[leg] == pytest.approx(
            float(np.linalg.norm(along)), rel=1e-9, abs=1e-12
        )
        assert foot.normal_force[leg] == pytest.approx(
            float(foot.force[leg] @ contact.normal), rel=1e-9, abs=1e-12
        )


def numbers(value: Any) -> list[float]:
    """Returns all numbers of a structure in the order of its fields."""
    if isinstance(value, ct.Structure):
        return [number for field in value._fields_ for number in numbers(getattr(value, field[0]))]
    return (
        [number for entry in value for number in numbers(entry)]
        if isinstance(value, ct.Array)
        else [value]
    )


def test_the_compiled_in_robot_is_athena_in_its_settled_pose(core: ct.CDLL) -> None:
    default, athena = HxDefinition(), definition(load_robot("athena"))
    bound(core).hx_definition_default(default)
    plant = Plant(core, load_robot("athena"), **vars(seen(default).initial))
    assert (
        float(np.max(np.abs(plant.accelerations().dv))) < 1e-3
    )  # m/s2, rad/s2: the pose is known to 1e-10 m
    default.initial = athena.initial
    assert numbers(default) == numbers(athena)


def test_a_plant_without_any_setting_stands_where_it_is(core: ct.CDLL) -> None:
    default, held = HxDefinition(), HxInput()
    bound(core).hx_definition_default(default)
    core.hx_input_default(held)
    plant = Plant(core, load_robot("athena"))
    plant.reset(default)
    fresh, saved = core.hx_plant_create(), ct.create_string_buffer(core.hx_plant_state_size())
    core.hx_plant_get_state(fresh, saved)
    assert saved.raw == plant.save()
    assert core.hx_plant_step(fresh, held, 2.0) == OK
    core.hx_plant_get_state(fresh, saved)
    core.hx_plant_destroy(fresh)
    start = plant.bodies
    plant.restore(saved.raw)
    assert plant.time == 2.0
    assert float(np.max(np.abs(plant.bodies - start))) < 1e-6
    assert list(plant.output().foot.contact) == [1] * 6
    assert np.array_equal(np.array(held.angle_ref), load_robot("athena").stance)


def test_the_version_is_the_projects(core: ct.CDLL) -> None:
    project = tomllib.loads(
        (Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8")
    )["project"]
    assert bound(core).hx_version().decode() == project["version"]
