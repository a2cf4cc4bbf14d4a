"""All parts of friction and stops at once: accelerations, stages, steps and measures of the C plant
are those of the twin, derivatives are exact, and mirror images move as mirror images.
"""

from __future__ import annotations

import ctypes as ct
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from plant import Plant
from states import changed, distance, lopsided, random_bodies, random_command, random_pose
from test_laws_motion import AXIAL, COXA, FIXED, MIRRORED, OTHER_SIDE, POLAR, TURN, mirrored_command
from test_plant_dynamics import DENSE, at
from test_plant_stages import coefficients, rates
from test_twin_integrator import STEP, assert_same_steps
from test_twin_measure import H, stage_forces

from hexapod_cosim.models import METHODS, Robot, load_robot
from hexapod_cosim.models.contact.geometry import foot_contacts, foot_moment, standing_damping
from hexapod_cosim.models.dynamics import accelerations, joint_overruns, stop_torques
from hexapod_cosim.models.measure import Impulses, step_works
from hexapod_cosim.models.records import Array

MORE: dict[str, Any] = {
    "mu_static": 1.0,
    "stribeck_speed": 0.2,
    "viscous": 0.2,
    "spin_radius": 0.01,
    "rolling_radius": 0.004,
}
SLOPE = {"kind": "slope", "incline": 0.2, "heading": 0.5}
STOPS = {"stop_stiffness": 80.0, "stop_damping": 0.3}


def narrowed(robot: Robot, by: float = 0.15) -> Robot:
    """Returns a robot whose stops lie this far [rad] around the stance: joints reach them."""
    legs = []
    for leg in robot.legs:
        links = [
            replace(link, angle_min=stance - by, angle_max=stance + by)
            for link, stance in zip(leg.links, leg.stance, strict=True)
        ]
        legs.append(replace(leg, links=(links[0], links[1], links[2])))
    return replace(robot, legs=tuple(legs))


def everything(law: str, seed: int = 0, **sections: dict[str, Any]) -> Robot:
    robot = changed(narrowed(lopsided(seed)), friction=MORE | {"law": law}, servo=STOPS)
    return changed(robot, **sections)


@pytest.mark.parametrize("mode", ["position", "torque", "kinematic"])
@pytest.mark.parametrize("law", ["tanh", "bristle", "lugre"])
def test_accelerations_are_those_of_the_dense_system(core: ct.CDLL, law: str, mode: str) -> None:
    robot = everything(law, servo={"mode": mode}, terrain=SLOPE)
    robot = changed(robot, contact={"impact_speed_floor": 2.0})
    body, command = random_bodies(robot, 3, drift=0.02), random_command(robot, 3)
    expected = accelerations(robot, body, command, standing_damping(robot, body))
    got = at(core, robot, body).accelerations(command)
    assert distance(got.dv, expected.dv) < DENSE
    assert distance(got.multipliers, expected.multipliers) < DENSE
    assert distance(got.drive_torque, expected.drive_torque) < DENSE
    assert np.count_nonzero(joint_overruns(robot, body)) > 3


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("law", ["tanh", "bristle", "lugre"])
def test_steps_are_the_plants(core: ct.CDLL, name: str, law: str) -> None:
    h = STEP[name]
    robot = everything(law, solver={"method": name, "step": h}, terrain=SLOPE)
    body, command = random_bodies(robot, 1), random_command(robot, 1)
    state = assert_same_steps(core, robot, body, command, [h, 2.0 * h])
    assert np.count_nonzero(~np.isnan(state.damping)) == 3
    assert np.count_nonzero(joint_overruns(robot, state.body)) > 3


def moments(robot: Robot, body: Array, damping: Array) -> Array:
    """Returns the moments (6, 3) of spin and rolling friction on the tibias [N m]."""
    feet = foot_contacts(robot, body)
    return np.array(
        [
            foot_moment(robot, foot, float(damping[leg]), body[3 * (leg + 1), 10:13])
            for leg, foot in enumerate(feet)
        ]
    )


@pytest.mark.parametrize("seed", [2, 5])
def test_losses_of_a_step_are_those_of_the_readable_equations(core: ct.CDLL, seed: int) -> None:
    robot = everything("tanh", seed, solver={"method": "bs32", "step": H})
    command, pose = random_command(robot, seed), random_pose(robot, seed)
    plant, there = (Plant(core, robot, **pose) for _ in range(2))
    before, damping = plant.bodies, standing_damping(robot, plant.bodies)
    m, rate = coefficients(core, "bs32"), rates(core, there, command)
    k, sums = np.zeros((7, 247)), [np.zeros((6, 3)) for _ in range(5)]
    for i in range(m.stages):
        y = before.ravel() + H * m.a[i] @ k
        k[i], body = rate(y), y.reshape(19, 13)
        forces = [
            *stage_forces(robot, body, command, damping),
            stop_torques(robot, body),
            moments(robot, body, damping),
        ]
        sums = [total + H * m.b[i] * force for total, force in zip(sums, forces, strict=True)]
    plant.step(H, command)
    impulses = Impulses(sums[0], sums[1], sums[2], stop=sums[3], moment=sums[4])
    works = step_works(robot, before, plant.bodies, H, impulses, ~np.isnan(damping))
    energy = plant.output(command).energy
    assert np.any(sums[3] != 0.0)
    assert np.any(sums[4] != 0.0)
    assert energy.contact_loss == pytest.approx(works.contact, rel=1e-6, abs=1e-9)
    assert energy.friction_loss == pytest.approx(works.friction, rel=1e-6, abs=1e-9)
    assert energy.gear_loss == pytest.approx(works.gear, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("law", ["tanh", "bristle", "lugre"])
def test_the_energy_balance_closes_in_a_long_motion(core: ct.CDLL, law: str) -> None:
    robot = changed(everything(law), solver={"tolerance": 1e-7})
    plant = Plant(core, robot, **random_pose(robot, 4))
    for k in range(40):
        plant.step(0.01 * (k + 1), random_command(robot, k, size=0.5))
    energy = plant.output().energy
    assert energy.dissipated > 0.5
    assert abs(energy.residual) < 1e-4 * energy.dissipated


def moved(plant: Plant, mirror: Any) -> Any:
    for k in range(5):
        command = mirror(random_command(plant.robot, k, size=0.3))
        plant.step(0.03 * (k + 1), command)
    return plant.output(command)


@pytest.mark.parametrize("law", ["tanh", "lugre"])
def test_mirrored_commands_give_the_mirrored_motion(core: ct.CDLL, law: str) -> None:
    robot = changed(load_robot("athena"), friction=MORE | {"law": law}, servo=STOPS)
    robot = changed(narrowed(robot, 0.05), solver=FIXED)
    pose = random_pose(robot, 6)
    other = {
        "position": pose["position"] * POLAR,
        "quaternion": pose["quaternion"] * TURN,
        "velocity": pose["velocity"] * POLAR,
        "angular_velocity": pose["angular_velocity"] * AXIAL,
        "angle": pose["angle"][OTHER_SIDE] * COXA,
        "speed": pose["speed"][OTHER_SIDE] * COXA,
    }
    here = moved(Plant(core, robot, **pose), lambda command: command)
    there = moved(Plant(core, robot, **other), mirrored_command)
    assert there.torso.position * POLAR == pytest.approx(here.torso.position, abs=MIRRORED)
    assert there.torso.quaternion * TURN == pytest.approx(here.torso.quaternion, abs=MIRRORED)
    assert there.angle[OTHER_SIDE] * COXA == pytest.approx(here.angle, abs=MIRRORED)
    assert there.energy.friction_loss == pytest.approx(here.energy.friction_loss, abs=MIRRORED)
