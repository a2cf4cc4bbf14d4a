"""Stick-slip of the whole C plant: a robot of 1 kg with locked joints on its six feet, pulled by a
spring of 100 N/m whose end moves at 0.1 m/s, under 9.81 N with coefficients 0.6 and 0.4.

By Coulomb's law it slips for (2 pi - 2 atan(x w/v))/w = 0.408432 s with x = 0.2 g/w^2 and w = 10/s,
and sticks for 0.392400 s. The spring's force is the push on the torso, linear in each macro-step.
"""

from __future__ import annotations

import ctypes as ct
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from plant import Plant
from states import changed

from hexapod_cosim.cosim.run.single_run import simulate
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.models import Leg, Link, Robot, load_robot
from hexapod_cosim.models.dynamics import Command

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
