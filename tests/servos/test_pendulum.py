"""The published test bench of measured servos: the plant, whose tibias are rods with a mass,
follows an independent integration of the published equations, and its smooth friction converges to
the published clipped one.
"""

from __future__ import annotations

import ctypes as ct
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from pendulum import GRAVITY, Rod, clipped_swing, smooth_swing
from plant import Plant
from states import with_links
from test_laws_servo import HEAVY, tibias, walled

from hexapod_cosim.models import Robot
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.dynamics import Command
from hexapod_cosim.models.records import Servo
from hexapod_cosim.models.schema import require
from hexapod_cosim.models.servos.presets import measured_servo, servo_table

ROD = Rod()
SMALL = Rod(mass=0.04, rod=0.02, length=0.1)  # for servos of 0.2 to 0.7 N m
TIMES = np.arange(0.0, 1.51, 0.05)
SERVOS = {
    **dict.fromkeys(("mx64_m1", "mx64_m2", "mx64_m3", "mx64_m4", "mx64_m5", "mx64_m6"), ROD),
    **dict.fromkeys(("mx106_m4", "mx106_m6", "sts3215_m1"), ROD),
    **dict.fromkeys(("xl320_m4", "xl320_m6", "xl330_m1", "xl330_m4"), SMALL),
}
# rad  the plant's walls give way by 1e-7 of the rod's motion, and its error control allows 1e-9
AGREES = 1e-6
EULER = 1e-4  # rad  of the published scheme, of order 1, with its step of 10 us


def target(t: float) -> float:
    """Returns the commanded angle [rad]: a lift, a swing through the bottom, a small step."""
    return 0.8 if t < 0.5 else (-0.4 if t < 1.0 else 0.1)


def bench(name: str, rod: Rod, **settings: Any) -> Robot:
    """Returns a robot on a wall whose tibias are a rod each, turned by a measured servo."""
    robot = walled(coulomb_friction=0.0)
    servo = Servo(**require(Servo, dict(servo_table({"model": name}, "")), ""))
    robot = replace(robot, servo=replace(servo, **settings), gravity=(0.0, 0.0, -GRAVITY))
    wall = HEAVY | {"inertia": (1e9, 1e9, 1e9, 0.0, 0.0, 0.0)}
    robot = with_links(with_links(robot, 0, **wall), 1, **wall)
    mass = rod.mass + rod.rod
    middle = (rod.mass + 0.5 * rod.rod) * rod.length / mass
    about = rod.inertia - mass * middle**2
    inertia = (1e-9, about, about, 0.0, 0.0, 0.0)
    return with_links(robot, 2, mass=mass, com=(middle, 0.0, 0.0), inertia=inertia)


def swung(core: ct.CDLL, robot: Robot) -> Array:
    """Returns the angles of a rod from its hanging position at TIMES [rad]."""
    hanging, weight = 0.5 * np.pi, robot.total_mass * GRAVITY
    plant = Plant(core, robot, angle=tibias(hanging))
    found = [0.0]
    for start, end in pairwise(TIMES):
        angle = tibias(hanging + target(start + 1e-9))
        command = Command(angle_ref=angle, push_force=np.array([0.0, 0.0, weight]))
        plant.step(float(end), command)
        found.append(float(plant.output(command).angle[0, 2]) - hanging)
    return np.array(found)


@pytest.mark.parametrize("name", SERVOS)
def test_the_plant_follows_the_published_equations(core: ct.CDLL, name: str) -> None:
    rod, measured = SERVOS[name], measured_servo(name)
    robot = bench(name, rod, friction_speed=0.02)
    gain = measured.about.duty_gain
    theirs = smooth_swing(measured.fields, gain, rod, target, TIMES, 0.02)
    ours = swung(core, robot)
    assert np.ptp(theirs[0]) > 0.8
    assert ours == pytest.approx(theirs[0], abs=AGREES)


@pytest.mark.parametrize(("name", "most"), [("mx64_m6", 3e-3)])
def test_smooth_friction_converges_to_the_published_clipped_one(name: str, most: float) -> None:
    """The error is below `most` [rad] at 0.02 rad/s, and falls as the friction's speed does."""
    measured = measured_servo(name)
    of_bench = (measured.fields, measured.about.duty_gain, ROD, target, TIMES)
    clipped = clipped_swing(*of_bench, step=1e-5)
    errors = [
        float(np.max(np.abs(smooth_swing(*of_bench, friction_speed=speed)[0] - clipped)))
        for speed in (0.02, 0.002)
    ]
    assert errors[0] < 1.1 * most
    assert errors[1] < 0.25 * errors[0] + EULER
