"""Compares motions of the whole plant with their closed forms."""

from __future__ import annotations

import ctypes as ct
import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import test_laws_motion as laws
from plant import Plant
from states import changed

from hexapod_cosim.models import load_robot
from hexapod_cosim.models.dynamics import Command
from hexapod_cosim.models.energy import kinetic_energy, momentum, potential_energy
from tools.docs.validation.shown import Shown, short

Row = tuple[str, float, float, str]  # what, computed, exact, unit
GRAVITY = 9.81  # m/s2


def closed_forms(core: ct.CDLL) -> Shown:
    """Shows each motion beside its exact value."""
    rows = [*_fall(core), *_pendulum(core), *_spin(core), *_conserved(core)]
    return Shown(
        columns=("motion", "computed", "exact", "relative difference"),
        rows=[
            (what, f"{got:.12g} {unit}", f"{exact:.12g} {unit}", short(abs(got / exact - 1.0)))
            for what, got, exact, unit in rows
        ],
    )


def _fall(core: ct.CDLL) -> Iterator[Row]:
    robot = replace(laws.free(), gravity=(0.0, 0.0, -GRAVITY))
    plant = Plant(core, robot, position=(0.0, 0.0, laws.HIGH))
    plant.step(0.5, Command(angle_ref=robot.stance))
    torso = plant.output().torso
    yield "free fall, way after 0.5 s", laws.HIGH - torso.position[2], 0.5 * GRAVITY * 0.5**2, "m"
    yield "free fall, speed after 0.5 s", -torso.velocity[2], GRAVITY * 0.5, "m/s"


def _pendulum(core: ct.CDLL) -> Iterator[Row]:
    robot, flat = laws.pendulums(), np.zeros((6, 3))
    carry = Command(angle_ref=flat, push_force=np.array([0.0, 0.0, robot.total_mass * GRAVITY]))
    plant = Plant(core, robot, angle=flat)
    plant.step(laws.PERIOD / 4.0, carry)
    bottom = plant.output(carry)
    yield (
        "pendulum of 1 m let go horizontally, angle after a quarter period",
        bottom.angle[0, 2],
        math.pi / 2.0,
        "rad",
    )
    yield "the same, speed at the bottom", bottom.speed[0, 2], math.sqrt(2.0 * GRAVITY), "rad/s"
    yield (
        "the same, joint reaction at the bottom (3 m g)",
        bottom.reaction_force[0, 2, 2],
        3.0 * GRAVITY,
        "N",
    )


def _spin(core: ct.CDLL) -> Iterator[Row]:
    robot = replace(
        changed(load_robot("athena"), servo={"mode": "kinematic"}, solver=laws.FLIGHT),
        gravity=laws.WEIGHTLESS,
    )
    flat, rate = np.zeros((6, 3)), 0.9
    plant = Plant(
        core, robot, angle=flat, angular_velocity=(0.0, 0.0, rate), position=(0.0, 0.0, laws.HIGH)
    )
    plant.step(3.0, Command(angle_ref=flat))
    yield (
        "spin about a principal axis, turned after 3 s",
        plant.output().torso.yaw,
        rate * 3.0,
        "rad",
    )


def _conserved(core: ct.CDLL) -> Iterator[Row]:
    robot = laws.free()
    plant = laws.tumbling(core, robot)
    start, energy = momentum(robot, plant.bodies), kinetic_energy(robot, plant.bodies)
    plant.step(0.3, Command(angle_ref=robot.stance))
    end = momentum(robot, plant.bodies)
    turning = float(np.linalg.norm(end[1])), float(np.linalg.norm(start[1]))
    yield "free robot with whirling legs, angular momentum after 0.3 s", *turning, "N m s"
    yield "the same, kinetic energy", kinetic_energy(robot, plant.bodies), energy, "J"
    robot = replace(robot, gravity=(0.5, -0.3, -GRAVITY))
    plant = laws.tumbling(core, robot)
    before = kinetic_energy(robot, plant.bodies) + potential_energy(robot, plant.bodies)
    plant.step(0.3, Command(angle_ref=robot.stance))
    yield (
        "the same, falling, total energy",
        kinetic_energy(robot, plant.bodies) + potential_energy(robot, plant.bodies),
        before,
        "J",
    )
