"""Tests all parts of friction and stops at once in the C plant, and its stick-slip: accelerations,
stages, steps and measures.
"""

from __future__ import annotations

import ctypes as ct
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from plant import Plant
from slopes import rates
from states import changed, distance, lopsided, random_bodies, random_command, random_pose
from test_plant_dynamics import DENSE, at
from test_twin_integrator import STEP, assert_same_steps
from test_twin_measure import H, stage_forces

from hexapod_cosim.cosim.run.single_run import simulate
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.models import METHODS, Leg, Link, Robot, load_robot
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.contact.geometry import foot_contacts, foot_moment, standing_damping
from hexapod_cosim.models.dynamics import Command, accelerations, joint_overruns, stop_torques
from hexapod_cosim.models.measure import Impulses, step_works
from hexapod_cosim.models.method import METHOD

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
    robot = everything("tanh", seed, solver={"method": "dp54", "step": H})
    command, pose = random_command(robot, seed), random_pose(robot, seed)
    plant, there = (Plant(core, robot, **pose) for _ in range(2))
    before, damping = plant.bodies, standing_damping(robot, plant.bodies)
    m, rate = METHOD["dp54"], rates(core, there, command)
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


# Stick-slip of the whole C plant: a robot of 1 kg with locked joints on its six feet, pulled by a
# spring of 100 N/m whose end moves at 0.1 m/s, under 9.81 N with coefficients 0.6 and 0.4.

MACRO = 2e-4  # s
SPRING, PULL = 100.0, 0.1  # N/m, m/s
# relative: the slip counts from 1 mm/s of 0.1 m/s on, which shortens it by 0.25 %; the law's own
# lengths, 1 um and 0.1 mm/s, are 1e-3 of the mass's
STICK_SLIP = 3e-3


def lighter(part: Any, share: float) -> Any:
    inertia = tuple(share * value for value in part.inertia)
    return replace(part, mass=share * part.mass, inertia=inertia)


def leg_of(leg: Leg, share: float) -> Leg:
    coxa, femur, tibia = (lighter(link, share) for link in leg.links)
    assert isinstance(coxa, Link)
    return replace(leg, links=(coxa, femur, tibia))


def sledge() -> Robot:
    """Returns athena with locked joints, 1 kg of mass and feet alone on the ground."""
    robot = load_robot("athena")
    share = 1.0 / robot.total_mass
    robot = replace(
        robot,
        torso=lighter(robot.torso, share),
        legs=tuple(leg_of(leg, share) for leg in robot.legs),
    )
    friction = {
        "law": "bristle",
        "mu": 0.4,
        "mu_static": 0.6,
        "presliding": 1e-6,
        "stribeck_speed": 1e-4,
        "bristle_damping": 0.005,
    }
    return changed(
        robot,
        friction=friction,
        servo={"mode": "kinematic", "rotor_inertia": 0.0},
        body={"contact": "off"},
    )


def test_the_plant_sticks_and_slips_by_coulombs_closed_form(core: ct.CDLL) -> None:
    robot = sledge()
    plant = Plant(core, robot, position=(0.0, 0.0, 0.2))
    lowest = float(np.min(np.array(plant.output().foot.position)[:, 2]))
    plant = Plant(core, robot, position=(0.0, 0.0, 0.2 - lowest))
    hold = Command(angle_ref=robot.stance)
    for k in range(200):  # it comes to rest on the ground
        plant.step((k + 1) * 1e-3, hold)
    start = float(plant.output(hold).torso.position[0])
    t0, moving, switched = plant.time, False, []
    for k in range(11_000):
        output = plant.output(hold)
        x, v = float(output.torso.position[0]) - start, float(output.torso.velocity[0])
        slides = float(np.mean(output.foot.velocity[:, 0])) > 0.01 * PULL
        pull = SPRING * (PULL * k * MACRO - x) * np.eye(3)[0]
        rate = replace(
            hold, angle_ref=np.zeros((6, 3)), push_force=SPRING * (PULL - v) * np.eye(3)[0]
        )
        plant.step_ramp(t0 + (k + 1) * MACRO, replace(hold, push_force=pull), rate)
        if slides != moving:
            moving = slides
            switched.append(k * MACRO)
    slip, stick = np.diff(switched)[:2]
    assert robot.total_mass == pytest.approx(1.0, rel=1e-12)
    assert [slip, stick] == pytest.approx([0.408432, 0.392400], rel=STICK_SLIP)


def creep(**friction: float | str) -> float:
    """Returns the speed [m/s] at which a robot that stands on a slope of 0.3 rad slides down it."""
    settings = [f"friction.{key}={value}" for key, value in friction.items()]
    slope = ["terrain.kind=slope", "terrain.incline=0.3", "duration=4", "outputs.plots=false"]
    recording = simulate(load_scenario("stand", overrides=[*slope, *settings])).outcome.recording
    feet = recording.foot_vectors("position").mean(axis=1)
    late = recording.time >= 2.0
    way = float(np.linalg.norm(feet[late][-1] - feet[late][0]))
    return way / float(np.ptp(recording.time[late]))


@pytest.mark.usefixtures("plant_build")
def test_feet_creep_down_a_slope_under_the_tanh_law_alone() -> None:
    """By artanh(tan(0.3)/0.7) over 100 s/m. The laws with bristles hold, with and without a static
    friction above the kinetic one, which makes the tanh law slower and no more.
    """
    assert creep() == pytest.approx(4.7460e-3, rel=1e-3)
    assert 4e-3 < creep(mu_static=0.8) < 4.6e-3
    for law in ("bristle", "lugre"):
        for mu_static in (0.0, 0.8):
            assert creep(law=law, mu_static=mu_static) < 1e-9
