"""Tests impact laws with the whole plant: restitution, penetration, touch-down, bouncing.

A robot with locked joints (kinematic drives on their references) that falls flat on six equal feet
is a point mass on a contact of six times a foot's stiffness, so closed forms hold.
"""

from __future__ import annotations

import ctypes as ct
import math
from typing import Any

import numpy as np
import pytest
from plant import Plant, asked
from states import changed

from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.contact.geometry import foot_contacts
from hexapod_cosim.models.contact.law import exact_restitution_chi
from hexapod_cosim.models.kinematics import body_states

RESTITUTION = 1e-3  # of the exact law
FIGURES = 1e-4  # of figures that the reference table prints with four digits
TIGHT = 1e-8  # tolerance; the error in a restitution is then below 1e-5
STILL = np.zeros(3)


def rigid(law: str = "exact_restitution", *, gravity: float = 0.0, **contact: Any) -> Robot:
    """Returns Athena with locked joints, whose feet alone touch the ground; the high stiffness
    keeps impacts short.
    """
    settings = {"law": law} | contact
    robot = changed(
        load_robot("athena"),
        servo={"mode": "kinematic"},
        contact=settings,
        body={"contact": "off"},
        solver={"tolerance": TIGHT, "step_max": 1.0},
    )
    return changed_gravity(robot, gravity)


def changed_gravity(robot: Robot, gravity: float) -> Robot:
    return type(robot)(**{**vars(robot), "gravity": (0.0, 0.0, -gravity)})


def above(robot: Robot, clearance: float) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Returns the torso's position in the level stance with the feet at a height [m]."""
    feet = foot_contacts(
        robot, body_states(robot, STILL, np.eye(4)[0], STILL, STILL, robot.stance, np.zeros((6, 3)))
    )
    return np.array([0.0, 0.0, clearance + float(np.mean([foot.penetration for foot in feet]))])


def falling(core: ct.CDLL, robot: Robot, *, clearance: float = 1e-3, speed: float = 0.0) -> Plant:
    return Plant(core, robot, position=above(robot, clearance), velocity=(0.0, 0.0, -speed))


def flown_off(plant: Plant, *, step: float = 1e-4, limit: float = 2.0) -> Any:
    """Returns the first output after all feet have left the ground; its field `deepest` is the
    deepest penetration [m].
    """
    deepest, touched, end = 0.0, False, plant.time + limit
    while plant.time < end:
        plant.step(plant.time + step)
        output = plant.output()
        deepest = max(deepest, float(np.max(output.foot.penetration)))
        touched = touched or bool(np.any(output.foot.contact))
        if touched and not np.any(output.foot.contact):
            output.deepest = deepest
            return output
    raise AssertionError("the robot did not leave the ground")


# restitution


@pytest.mark.parametrize("e", [0.1, 0.3, 0.5, 0.7, 0.9])
@pytest.mark.parametrize("speed", [0.1, 1.0])
def test_the_exact_law_gives_back_the_restitution_asked_for(
    core: ct.CDLL, e: float, speed: float
) -> None:
    bounced = flown_off(falling(core, rigid(restitution=e), speed=speed))
    assert bounced.torso.velocity[2] / speed == pytest.approx(e, abs=RESTITUTION)
    assert float(np.max(np.abs(bounced.torso.velocity[:2]))) < 1e-9
    assert bounced.solver.touchdowns == 6


@pytest.mark.parametrize(
    ("law", "achieved"),
    [("hunt_crossley", 0.6630), ("lankarani_nikravesh", 0.7252), ("flores", 0.4704)],
)
@pytest.mark.parametrize("stiffness", [1e5, 1e7])
def test_each_classic_law_asked_for_a_half_gives_its_reference_figure(
    core: ct.CDLL, law: str, achieved: float, stiffness: float
) -> None:
    bounced = flown_off(
        falling(core, rigid(law, restitution=0.5, stiffness=stiffness), speed=0.4), step=2e-3
    )
    assert bounced.torso.velocity[2] / 0.4 == pytest.approx(achieved, abs=FIGURES)


@pytest.mark.parametrize("speed", [0.2, 0.8])
def test_a_constant_damping_factor_gives_back_less_the_faster_the_impact(
    core: ct.CDLL, speed: float
) -> None:
    """Checks chi (1 + e) = ln[(1 + chi)/(1 - chi e)] with chi = 1.5 c v0, which follows from the
    law.
    """
    bounced = flown_off(falling(core, rigid("constant_damping", damping_factor=1.1), speed=speed))
    chi, e = 1.5 * 1.1 * speed, bounced.torso.velocity[2] / speed
    assert chi * (1.0 + e) == pytest.approx(math.log((1.0 + chi) / (1.0 - chi * e)), rel=1e-5)


@pytest.mark.parametrize("law", ["exact_restitution", "hunt_crossley", "hertz"])
def test_the_deepest_penetration_has_its_closed_form(core: ct.CDLL, law: str) -> None:
    robot, speed = rigid(law, restitution=0.6), 0.5
    bounced = flown_off(falling(core, robot, speed=speed), step=1e-5)
    chi = {"exact_restitution": exact_restitution_chi(0.6), "hunt_crossley": 0.6, "hertz": 0.0}[law]
    share = 1.0 / chi - math.log1p(chi) / chi**2 if chi else 0.5
    depth = (2.5 * robot.total_mass * speed**2 / (6.0 * robot.contact.stiffness) * share) ** 0.4
    assert bounced.deepest == pytest.approx(
        depth, rel=1e-5
    )  # samples are 10 us apart, and the depth is a parabola near its maximum


def test_every_apex_of_a_bouncing_robot_is_lower_by_the_restitution_squared(core: ct.CDLL) -> None:
    """The robot bounces and each apex is compared with the previous one.

    Gravity does work over the depth of the contact; stiff ground and weak gravity keep it below
    1e-3.
    """
    e, height, gravity = 0.8, 0.1, 1.0
    robot = rigid(gravity=gravity, restitution=e, stiffness=1e10)
    plant, rising, last = falling(core, robot, clearance=height), False, 0.0
    apexes: list[float] = []
    floor = above(robot, 0.0)[2]
    while len(apexes) < 3:
        plant.step(plant.time + 5e-3)
        z, speed = (
            value[2] for value in (plant.output().torso.position, plant.output().torso.velocity)
        )
        if rising and speed <= 0.0:
            apexes.append(z - floor + 0.5 * speed**2 / gravity)
        rising, last = speed > 0.0, z
    assert last > floor
    assert apexes == pytest.approx([height * e ** (2 * n) for n in (1, 2, 3)], rel=3e-3)


# touch-down


def test_the_impact_speed_is_held_until_lift_off_and_the_next_touchdown_samples_anew(
    core: ct.CDLL,
) -> None:
    robot = rigid(gravity=9.81, restitution=0.5)
    plant, damped = falling(core, robot, clearance=0.05), 0
    speeds: list[float] = []
    chi = exact_restitution_chi(0.5)
    while len(set(speeds)) < 3:
        plant.step(plant.time + 2.5e-4)
        foot = plant.output().foot
        if foot.contact[2]:
            speeds.append(foot.impact_speed[2])
            law = (
                robot.contact.stiffness
                * foot.penetration[2] ** 1.5
                * (1.0 - chi * foot.velocity[2, 2] / speeds[-1])
            )
            assert foot.normal_force[2] == pytest.approx(law, rel=1e-9)
            damped += 1
    first, second = sorted(set(speeds), reverse=True)[:2]
    assert damped > 30
    # gravity changes the speeds over the depth of the contact, by a few per cent at this stiffness
    assert second / first == pytest.approx(0.5, abs=0.05)


def test_the_ground_never_pulls(core: ct.CDLL) -> None:
    """The foot leaves the ground faster than it landed, so that its damping force would exceed its
    elastic force and the sum would pull.
    """
    robot = changed(rigid(restitution=0.2, gravity=9.81), servo={"mode": "position"})
    plant = falling(core, robot, clearance=0.02)
    up = type(plant.hold())(angle_ref=robot.stance, push_force=np.array([0.0, 0.0, 800.0]))
    cut = 0
    for k in range(120):
        command = up if plant.output().foot.normal_force[0] > 100.0 or k > 90 else plant.hold()
        plant.step(plant.time + 1e-3, command)
        foot = plant.output(command).foot
        assert np.all(foot.normal_force >= 0.0)
        cut += int(
            np.sum((foot.contact == 1) & (foot.penetration > 0.0) & (foot.normal_force == 0.0))
        )
    assert cut > 0


def test_switching_touches_down_open_feet_and_lifts_off_closed_ones(core: ct.CDLL) -> None:
    robot = rigid(restitution=0.5)
    plant, state = Plant(core, robot), np.zeros((3, 6))
    core.hx_probe_contact_switch.restype = ct.c_int
    rows = [
        (
            [1e-6, -1e-6, 0.0, 2e-6, 3e-6, -1.0],
            [0.3, 0.2, 0.1, 0.0, -0.1, 1.0],
            3,
            [1, 0, 0, 1, 1, 0],
            [0.3, 0.0, 0.0, 0.0, -0.1, 0.0],
        ),
        (
            [1e-3, 1e-6, 0.0, 0.0, 1e-3, -1.0],
            [0.9, 0.5, 0.9, 0.9, 0.9, 0.9],
            1,
            [1, 1, 0, 0, 1, 0],
            [0.3, 0.5, 0.0, 0.0, -0.1, 0.0],
        ),
    ]
    chi = asked(core.hx_probe_exact_restitution_chi, 0.5)
    for delta, ddelta, touchdowns, closed, speeds in rows:
        places = [
            np.array(values).ctypes.data_as(ct.POINTER(ct.c_double)) for values in (delta, ddelta)
        ]
        count = core.hx_probe_contact_switch(
            ct.c_void_p(plant.handle), *places, state.ctypes.data_as(ct.POINTER(ct.c_double))
        )
        assert (count, list(state[0]), list(state[2])) == (touchdowns, closed, speeds)
        assert state[1] == pytest.approx(
            np.where(closed, chi / np.maximum(speeds, robot.contact.impact_speed_floor), 0.0)
        )
