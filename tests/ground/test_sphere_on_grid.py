"""A rigid sphere on height fields: oscillation and rolling in a bowl, rebounds at 3 m/s, and forces
at borders of cells.

The sphere is the torso of a robot whose legs are small, light, locked and inside of it: its eight
corners coincide, so that each carries an eighth of the load.
"""

from __future__ import annotations

import ctypes as ct
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from grids import BLOCKS, Ground, grid_bytes, sampled, start_on_grid
from plant import Plant
from states import changed, scaled

from hexapod_cosim.models import CONTACT_LAWS, Leg, Link, Robot, load_robot
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.contact.law import CHI, achieved_restitution
from hexapod_cosim.models.dynamics import Command

RADIUS = 0.02  # m  of the sphere
BOWL = 0.25  # m  radius of the bowl
CELL = 1e-3  # m  of the bowl's grid, on which it is a sphere to 2e-10 m
MASS = 1.0  # kg
LIGHT = 1e-7  # kg  of a link
STIFFNESS = 1e7  # N/m^1.5  of each of the eight contacts
SMALL = 1e-3  # m  amplitude, of which (A/rho)^2/16 = 1.4e-6 changes the period
SWING = 2e-5  # relative: that, the legs' inertia, and the mean of two crossings
REBOUND = 1e-3  # relative
IDENTICAL = 1e-9  # relative: a level grid is the plane
SPEED = 3.0  # m/s


def tiny(link: Link) -> Link:
    return replace(link, mass=LIGHT, inertia=(1e-13, 1e-13, 1e-13, 0.0, 0.0, 0.0))


def small(leg: Leg) -> Leg:
    coxa, femur, tibia = (tiny(link) for link in leg.links)
    return replace(leg, links=(coxa, femur, tibia))


def sphere(gravity: float = 9.81, **sections: dict[str, Any]) -> Robot:
    """Returns the sphere as a robot; its torso's inertia is 2/5 m R^2."""
    robot = scaled(load_robot("athena"), 0.02)
    legs = tuple(small(leg) for leg in robot.legs)
    inertia = 0.4 * MASS * RADIUS**2
    torso = replace(
        robot.torso,
        mass=MASS,
        com=(0.0, 0.0, 0.0),
        inertia=(inertia, inertia, inertia, 0.0, 0.0, 0.0),
    )
    robot = replace(robot, legs=legs, torso=torso, gravity=(0.0, 0.0, -gravity))
    body = {
        "contact": "on",
        "torso_box": (1e-12,) * 3,
        "torso_centre": (0.0, 0.0, 0.0),
        "corner_radius": RADIUS,
        "knee_radius": 0.0,
        "shank_radius": 0.0,
    }
    return changed(
        robot,
        body=body,
        foot={"radius": 1e-4},
        servo={"mode": "kinematic", "rotor_inertia": 0.0, "coulomb_friction": 0.0},
        contact={"stiffness": STIFFNESS},
        **sections,
    )


def bowl(core: ct.CDLL) -> Ground:
    def height(x: Array, y: Array) -> Array:
        return np.asarray(BOWL - np.sqrt(BOWL**2 - x * x - y * y))

    return Ground(core, sampled(height, size=0.1, cell=CELL))


def quarter_period(core: ct.CDLL, robot: Robot) -> tuple[float, float]:
    """Releases the sphere SMALL away from the middle of the bowl; returns the time [s] between its
    first and its second passage of the middle, over two, and the depth at rest [m].
    """
    ground, depth = bowl(core), (MASS * 9.81 / (8.0 * STIFFNESS)) ** (2.0 / 3.0)
    reach = BOWL - RADIUS + depth  # of the centre from that of the bowl
    plant = Plant(core, robot)
    start_on_grid(plant, ground, position=(0.0, 0.0, 0.5))
    z = BOWL - math.sqrt(reach**2 - SMALL**2)
    start_on_grid(plant, ground, position=(SMALL, 0.0, z))
    crossings, before, command = [], SMALL, Command(angle_ref=robot.stance)
    for k in range(1, 1600):
        plant.step(k * 1e-3, command)
        x = float(plant.output(command).torso.position[0])
        if before * x < 0.0:
            crossings.append((k - x / (x - before)) * 1e-3)
        before = x
    return 0.5 * (crossings[1] - crossings[0]), depth


def test_a_sphere_without_friction_oscillates_in_a_bowl_as_a_pendulum(core: ct.CDLL) -> None:
    """omega^2 = g/(rho - R); a load that is at rest lets the centre sink by its depth."""
    quarter, depth = quarter_period(
        core, sphere(friction={"law": "none"}, solver={"tolerance": 1e-7})
    )
    omega = 0.5 * math.pi / quarter
    assert omega**2 == pytest.approx(9.81 / (BOWL - RADIUS + depth), rel=SWING)
    assert omega**2 == pytest.approx(42.6522, rel=1e-3)  # without the depth


def test_a_sphere_that_rolls_in_a_bowl_has_five_sevenths_of_it(core: ct.CDLL) -> None:
    """omega^2 = 5 g/(7 (rho - R)), on friction so steep that the creep does not count."""
    friction = {"law": "tanh", "mu": 0.8, "slope": 1e6}
    quarter, depth = quarter_period(core, sphere(friction=friction, solver={"tolerance": 1e-7}))
    omega = 0.5 * math.pi / quarter
    assert omega**2 == pytest.approx(5.0 * 9.81 / (7.0 * (BOWL - RADIUS + depth)), rel=SWING)
    assert omega**2 == pytest.approx(30.4658, rel=1e-3)  # without the depth


@pytest.mark.parametrize("law", CONTACT_LAWS)
@pytest.mark.parametrize("ground", ["smooth", "blocks", "incline"])
def test_a_sphere_of_20_mm_at_3_m_s_rebounds_as_from_the_plane(
    core: ct.CDLL, law: str, ground: str
) -> None:
    """Without gravity the speeds before and after an impact have the restitution of the law."""
    contact = {"law": law, "restitution": 0.6, "damping_factor": 0.1}
    robot = sphere(0.0, friction={"law": "none"}, solver={"tolerance": 1e-7})
    robot = changed(robot, contact=contact)
    rise = 0.3 if ground == "incline" else 0.0
    normal = np.array([-rise, 0.0, 1.0]) / math.hypot(1.0, rise)
    kind = BLOCKS if ground == "blocks" else 1
    level = np.tile(rise * np.linspace(-1.0, 1.0, 41), (41, 1))
    field = Ground(core, grid_bytes(level, cell=0.05, origin=(-1.0, -1.0), kind=kind))
    start: dict[str, Any] = {
        "position": tuple(np.array([0.013, 0.021, 0.013 * rise]) + (RADIUS + 0.003) * normal),
        "velocity": tuple(-SPEED * normal),
    }
    flat = {"kind": "slope", "incline": math.atan(rise), "heading": 0.0}
    on_plane = Plant(core, changed(robot, terrain=flat if rise else {}), **start)
    on_field = Plant(core, robot)
    start_on_grid(on_field, field, **start)
    speeds = []
    for plant in (on_plane, on_field):
        plant.step(0.03, Command(angle_ref=robot.stance))
        speeds.append(float(plant.output().torso.velocity @ normal))
    assert speeds[1] == pytest.approx(speeds[0], rel=IDENTICAL)
    assert speeds[1] == pytest.approx(SPEED * restitution(law), rel=REBOUND)


def restitution(law: str) -> float:
    """Returns what a law delivers for 0.6 asked, at an impact speed of 3 m/s."""
    if law == "hertz":
        return 1.0
    if law == "constant_damping":
        return achieved_restitution(1.5 * 0.1 * SPEED)
    return achieved_restitution(CHI[law](0.6))
