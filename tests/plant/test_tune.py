"""Tests parameters that change while the plant runs: laws before and after, the energy audit."""

from __future__ import annotations

import ctypes as ct
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from plant import Plant, PlantError, definition
from states import changed, landing, random_command, with_links

from hexapod_cosim.models import Robot, load_robot

RESIDUAL = 1e-4  # relative to the works
DRIFT = 1e-6  # rad, m, their rates: of the joints, which new coordinates remove
# changes of everything whose change keeps the state's meaning
CHANGES: dict[str, Any] = {
    "friction": {"friction": {"mu": 0.2, "slope": 50.0}},
    "contact": {"contact": {"stiffness": 4e4, "restitution": 0.5}},
    "servo": {"servo": {"kp": 15.0, "kd": 0.3, "torque_max": 3.0, "coulomb_friction": 0.2}},
    "mass": {"torso": {"mass": 6.0, "com": (0.02, -0.01, 0.005)}},
    "stops": {"servo": {"stop_stiffness": 50.0, "stop_damping": 0.5}},
}


def after(robot: Robot, change: str) -> Robot:
    if change == "gravity":
        return replace(robot, gravity=(1.0, 0.5, -4.0))
    if change == "links":
        return with_links(robot, 2, mass=0.5, com=(0.05, 0.01, 0.0))
    return changed(robot, **CHANGES[change])


def tune(plant: Plant, robot: Robot) -> None:
    plant._check(plant.core.hx_plant_tune(plant.handle, definition(robot)))
    plant.robot = robot


def walked(core: ct.CDLL, robot: Robot, steps: int = 40) -> Plant:
    """Returns a plant that has landed and moves its legs."""
    plant = Plant(core, robot, **landing(robot))
    for k in range(steps):
        plant.step(5e-3 * (k + 1), random_command(robot, k, size=0.2))
    return plant


def test_a_change_to_the_same_parameters_changes_no_bit(core: ct.CDLL) -> None:
    robot = load_robot("athena")
    plant, other = walked(core, robot), walked(core, robot)
    tune(plant, robot)
    for each in (plant, other):
        each.step(0.25, random_command(robot, 99, size=0.2))
    assert np.array_equal(plant.bodies, other.bodies)


@pytest.mark.parametrize("change", [*CHANGES, "gravity", "links"])
def test_the_energy_audit_closes_over_a_change(core: ct.CDLL, change: str) -> None:
    robot = load_robot("athena")
    plant = walked(core, robot)
    before = plant.output(plant.hold())
    tune(plant, after(robot, change))
    now = plant.output(plant.hold())
    stored = [out.energy.kinetic + out.energy.potential for out in (before, now)]
    given = stored[1] - stored[0]
    assert now.energy.parameter_work == pytest.approx(given, rel=1e-9, abs=1e-12)
    if change in ("contact", "mass", "gravity", "links"):
        assert abs(given) > 1e-6
    for k in range(40, 100):
        command = random_command(robot, k, size=0.2)
        plant.step(5e-3 * (k + 1), command)
        output = plant.output(command)
        works = float(np.sum(output.positive_work + output.negative_work))
        assert abs(output.energy.residual) < RESIDUAL * (works + output.energy.dissipated)


@pytest.mark.parametrize("change", [*CHANGES, "gravity", "links"])
def test_pose_and_motion_of_joints_and_torso_stay(core: ct.CDLL, change: str) -> None:
    robot = load_robot("athena")
    plant = walked(core, robot)
    before = plant.output(plant.hold())
    tune(plant, after(robot, change))
    now = plant.output(plant.hold())
    for name in ("angle", "speed"):
        assert getattr(now, name) == pytest.approx(getattr(before, name), abs=DRIFT)
    for part, name in (("foot", "position"), ("foot", "velocity"), ("torso", "quaternion")):
        shown = getattr(getattr(now, part), name)
        assert shown == pytest.approx(getattr(getattr(before, part), name), abs=DRIFT)


@pytest.mark.parametrize("change", ["servo", "mass", "gravity", "links"])
def test_in_the_air_it_moves_on_as_a_plant_that_had_the_parameters_before(
    core: ct.CDLL, change: str
) -> None:
    robot = changed(load_robot("athena"), solver={"step": 1e-3})
    plant, then = Plant(core, robot), after(robot, change)
    plant.step(0.02, random_command(robot, 1))
    tune(plant, then)
    other = Plant(core, then)
    other.bodies = plant.bodies
    for each in (plant, other):
        each.step(each.time + 0.02, random_command(robot, 2))
    assert plant.bodies == pytest.approx(other.bodies, rel=1e-9, abs=1e-9)


def test_a_robot_falls_with_the_gravity_of_each_moment(core: ct.CDLL) -> None:
    robot = load_robot("athena")
    plant = Plant(core, robot, position=(0.0, 0.0, 5.0))
    plant.step(0.2)
    tune(plant, replace(robot, gravity=(0.0, 0.0, -1.62)))
    plant.step(0.5)
    mass = np.array([robot.torso.mass, *(x.mass for leg in robot.legs for x in leg.links)])
    speed = mass @ plant.bodies[:, 9] / mass.sum()
    assert speed == pytest.approx(-9.81 * 0.2 - 1.62 * 0.3, rel=1e-6)


def test_a_standing_foot_has_the_new_friction_and_stiffness_and_keeps_its_impact_speed(
    core: ct.CDLL,
) -> None:
    robot = changed(load_robot("athena"), body={"contact": "off"})
    plant = walked(core, robot)
    speeds = plant.output(plant.hold()).foot.impact_speed
    then = changed(robot, friction={"mu": 0.05}, contact={"stiffness": 1e4, "restitution": 0.3})
    tune(plant, then)
    plant.step(0.21, random_command(robot, 40, size=0.2))
    foot = plant.output(plant.hold()).foot
    standing = foot.contact > 0
    assert np.count_nonzero(standing) >= 3
    assert foot.impact_speed[standing] == pytest.approx(speeds[standing])
    assert np.all(foot.tangential_force <= 0.0500001 * foot.normal_force)
    twin = Plant(core, then)
    twin.restore(plant.save())
    assert np.array_equal(twin.bodies, plant.bodies)


def test_a_saved_state_has_the_parameters_of_its_moment(core: ct.CDLL) -> None:
    robot = load_robot("athena")
    plant, other = walked(core, robot), walked(core, robot, 3)
    tune(plant, after(robot, "mass"))
    other.restore(plant.save())
    for each in (plant, other):
        each.step(0.3, random_command(robot, 5, size=0.2))
    assert plant.save() == other.save()


def test_impossible_parameters_are_refused_and_nothing_changes(core: ct.CDLL) -> None:
    robot = load_robot("athena")
    plant = walked(core, robot)
    saved = plant.save()
    with pytest.raises(PlantError, match=r"torso\.mass"):
        tune(plant, changed(robot, torso={"mass": -1.0}))
    assert plant.save() == saved
