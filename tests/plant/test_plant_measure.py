"""Tests the measurements of the plant against closed forms and independent sums.

A robot with locked joints that falls flat is a point mass on a contact of six times a foot's
stiffness (test_laws_impact.py).
"""

from __future__ import annotations

import ctypes as ct
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from plant import Plant
from states import changed
from test_laws_impact import above, falling, flown_off, rigid
from test_long_walk import standing, walking

from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.dynamics import Command

G = 9.81  # m/s2
SUMS = 1e-9  # J: what another order of summation may change
SAMPLED = 5e-3  # relative: error of trapezoidal sums of samples 0.1 ms apart
CLOSED = 1e-3  # relative: error of the path between the ends of steps at a tolerance of 1e-8


def weight(robot: Robot) -> float:
    """Returns the robot's weight [N]."""
    return G * (robot.torso.mass + sum(link.mass for leg in robot.legs for link in leg.links))


def hertz_forces(mass: float, stiffness: float, speed: float, duration: float) -> Array:
    """Returns the normal force [N] of a mass [kg] on a Hertzian contact, m d'' = -K d^(3/2), in
    steps of 1 us from touch-down on.
    """
    depth, approach, forces = 0.0, speed, [0.0]
    for _ in range(round(duration / 1e-6)):
        approach -= 1e-6 * forces[-1] / mass
        depth += 1e-6 * approach
        forces.append(stiffness * max(depth, 0.0) ** 1.5)
    return np.array(forces)


def rises(forces: Array) -> Array:
    """Returns the rises [N/s] over 1 ms that end every 0.1 ms.

    The forces are 1 us apart; before the first of them the force is 0.
    """
    late = forces[100::100]
    early = np.concatenate([np.zeros(1000), forces])[100 : 100 + 100 * len(late) : 100]
    return np.asarray((late - early) / 1e-3)


# ---- closed forms ----


@pytest.mark.parametrize("e", [0.3, 0.7])
def test_the_impulse_of_an_impact_is_the_momentum_that_it_gives(core: ct.CDLL, e: float) -> None:
    """Without gravity the impulse is (1 + e) m v, shared by six feet."""
    robot = rigid(restitution=e)
    bounced = flown_off(falling(core, robot, speed=0.4), step=2e-3)
    mass = weight(robot) / G
    assert bounced.foot.impulse == pytest.approx(
        np.full(6, 1.4 / 6.0 * mass * 0.4 * (1.0 + e) / 1.4), rel=CLOSED
    )


def test_peak_and_steepest_rise_of_an_elastic_impact_have_their_closed_forms(core: ct.CDLL) -> None:
    """Hertz: m v^2/2 = 2/5 K d^(5/2) at the peak, and K d^(3/2) rises most steeply where d^(5/2) =
    5 m v^2/(14 K).
    """
    robot, speed, stiffness = rigid("hertz", stiffness=1e6), 0.5, 1e6
    mass = weight(robot) / G / 6.0
    plant = falling(core, robot, clearance=1e-4, speed=speed)
    plant.step(0.05)  # one call covers the whole impact
    bounced = plant.output()
    assert bounced.torso.velocity[2] == pytest.approx(speed, rel=CLOSED)
    deepest = (1.25 * mass * speed**2 / stiffness) ** 0.4
    steep = (5.0 * mass * speed**2 / (14.0 * stiffness)) ** 0.4
    approach = math.sqrt(speed**2 - 0.8 * stiffness / mass * steep**2.5)
    assert bounced.foot.peak_force == pytest.approx(
        np.full(6, stiffness * deepest**1.5), rel=CLOSED
    )
    expected = np.full(6, 1.5 * stiffness * math.sqrt(steep) * approach)
    assert bounced.foot.peak_force_rate == pytest.approx(expected, rel=2 * CLOSED)
    assert bounced.foot.landing_rate == pytest.approx(
        np.full(6, rises(hertz_forces(mass, stiffness, speed, 0.004)).max()), rel=CLOSED
    )
    assert float(bounced.foot.landing_rate[0]) == pytest.approx(
        0.994 * float(expected[0]), rel=CLOSED
    )
    assert bounced.foot.landings == pytest.approx(np.ones(6))


def test_the_landing_rate_is_that_of_the_first_20_milliseconds(core: ct.CDLL) -> None:
    """The force of a soft Hertzian contact rises ever more steeply for more than 40 ms."""
    stiffness, speed = 1200.0, 0.1
    robot = rigid("hertz", stiffness=stiffness)
    rates = rises(hertz_forces(weight(robot) / G / 6.0, stiffness, speed, 0.040))
    assert rates[-1] > 1.2 * rates[199]
    plant = falling(core, robot, clearance=1e-4, speed=speed)
    plant.step(0.1)
    assert plant.output().foot.landing_rate == pytest.approx(np.full(6, rates[199]), rel=CLOSED)


def test_the_loss_of_an_impact_is_the_kinetic_energy_it_takes(core: ct.CDLL) -> None:
    robot = rigid(restitution=0.5)
    bounced = flown_off(falling(core, robot, speed=0.4), step=2e-3)
    mass = weight(robot) / G
    assert bounced.energy.contact_loss == pytest.approx(
        0.5 * mass * 0.4**2 * (1.0 - 0.25), rel=CLOSED
    )
    assert bounced.energy.friction_loss == pytest.approx(0.0, abs=1e-9)


def test_a_robot_that_slides_to_rest_slips_the_way_of_its_friction(core: ct.CDLL) -> None:
    """With locked joints and mu = 0.3 a robot at 0.5 m/s slides v^2/(2 mu g), and friction
    dissipates its kinetic energy.
    """
    robot = changed(rigid(gravity=G), friction={"mu": 0.3, "slope": 1e4})
    start = above(robot, 0.0)
    rest = Plant(core, robot, position=start)
    rest.step(1.0)
    plant = Plant(core, robot, position=rest.output().torso.position, velocity=(0.5, 0.0, 0.0))
    plant.step(1.0)
    output = plant.output()
    assert output.foot.slip_distance == pytest.approx(np.full(6, 0.25 / (0.6 * G)), rel=5e-3)
    mass = weight(robot) / G
    assert output.energy.friction_loss == pytest.approx(0.5 * mass * 0.25, rel=5e-3)


def test_a_torque_that_turns_a_free_joint_does_its_work_and_its_square_adds_up(
    core: ct.CDLL,
) -> None:
    """In torque mode without gravity and gear friction the works add up to the kinetic energy, and
    the integral of the squared torque is tau^2 t.
    """
    free = {"mode": "torque", "coulomb_friction": 0.0, "speed_max": 1e6, "torque_max": 1e3}
    robot = replace(
        changed(load_robot("athena"), servo=free, solver={"tolerance": 1e-8}),
        gravity=(0.0, 0.0, 0.0),
    )
    plant = Plant(core, robot, position=(0.0, 0.0, 5.0))
    torque = np.zeros((6, 3))
    torque[0, 0], torque[4, 2] = 0.2, -0.1
    command = Command(angle_ref=robot.stance, torque_ref=torque)
    for end in (0.05, 0.1):
        plant.step(end, command)
    output = plant.output(command)
    assert output.energy.kinetic > 1e-2
    assert float(np.sum(output.positive_work) - np.sum(output.negative_work)) == pytest.approx(
        output.energy.kinetic, rel=CLOSED
    )
    assert output.torque_squared[0, 0] == pytest.approx(0.04 * 0.1, rel=1e-9)
    assert output.torque_squared[4, 2] == pytest.approx(0.01 * 0.1, rel=1e-9)
    assert float(np.delete(output.torque_squared.ravel(), [0, 14]).max()) == 0.0


# ---- sums over a walk ----


@pytest.fixture(scope="module", params=["tanh", "bristle"])
def robot(request: pytest.FixtureRequest) -> Robot:
    return changed(load_robot("athena"), friction={"law": request.param})


def samples(
    core: ct.CDLL, robot: Robot, every: float, duration: float = 0.6
) -> tuple[list[tuple[Any, Any]], list[Any]]:
    """Returns outputs of a walk whose commands change every 5 ms, whatever `every` is.

    The outputs are those at the beginning and at the end of every piece of `every` seconds, both
    under the command of the piece, and those at the end of every command.
    """
    plant = standing(core, robot)
    pieces, ends = [], []
    for t, command in walking(robot, duration):
        begin, before = plant.time, plant.output(command)
        count = round((t - begin) / every)
        for k in range(1, count + 1):
            plant.step(t if k == count else begin + (t - begin) * k / count, command)
            after = plant.output(command)
            pieces.append((before, after))
            before = after
        ends.append(before)
    return pieces, ends


def test_the_parts_add_up_to_the_energy_balance(core: ct.CDLL, robot: Robot) -> None:
    for output in samples(core, robot, 5e-3)[1][::10]:
        works = float(np.sum(output.positive_work) - np.sum(output.negative_work))
        losses = output.energy.contact_loss + output.energy.friction_loss + output.energy.gear_loss
        assert works == pytest.approx(output.energy.actuator_work, abs=SUMS)
        assert losses == pytest.approx(output.energy.dissipated, abs=SUMS)


def test_what_is_measured_is_what_fine_samples_add_up_to(core: ct.CDLL, robot: Robot) -> None:
    """Compares the plant at the default tolerance, with commands of 5 ms, with sums of forces,
    speeds and torques sampled every 0.1 ms.
    """
    fine, _ = samples(core, changed(robot, solver={"tolerance": 1e-7}), 1e-4)
    _, coarse = samples(core, robot, 5e-3)
    least = 0.01 * weight(robot)

    def total(value: Callable[[Any], Array]) -> float:
        """Returns the trapezoidal sum over the pieces."""
        return float(sum(0.5e-4 * np.sum(value(before) + value(after)) for before, after in fine))

    def slip(output: Any) -> Array:
        return np.where(output.foot.normal_force > least, output.foot.slip_speed, 0.0)

    force = np.array([after.foot.normal_force for _, after in fine])
    last = coarse[-1]
    assert float(np.sum(last.positive_work)) == pytest.approx(
        total(lambda o: np.maximum(o.torque * o.speed, 0.0)), rel=SAMPLED
    )
    assert float(np.sum(last.negative_work)) == pytest.approx(
        total(lambda o: np.maximum(-o.torque * o.speed, 0.0)), rel=2 * SAMPLED
    )
    assert float(np.sum(last.torque_squared)) == pytest.approx(
        total(lambda o: o.torque**2), rel=SAMPLED
    )
    assert float(np.sum(last.foot.impulse)) == pytest.approx(
        total(lambda o: o.foot.normal_force), rel=SAMPLED
    )
    assert float(np.sum(last.foot.slip_distance)) == pytest.approx(total(slip), rel=SAMPLED)
    assert max(output.foot.peak_force.max() for output in coarse) == pytest.approx(
        float(force.max()), rel=SAMPLED
    )
    rise = np.diff(force, axis=0) / 1e-4
    assert max(output.foot.peak_force_rate.max() for output in coarse) > 0.9 * float(rise.max())


def test_peaks_begin_anew_with_every_call(core: ct.CDLL) -> None:
    robot = rigid("hertz")
    plant = falling(core, robot, clearance=1e-4, speed=0.5)
    plant.step(0.05)
    assert float(plant.output().foot.peak_force.min()) > 100.0
    plant.step(0.1)
    flying = plant.output().foot
    assert float(flying.peak_force.max()) == 0.0
    assert float(flying.peak_force_rate.max()) == 0.0
    assert float(flying.landing_rate.min()) > 1e3  # kept until the next touch-down


def test_measures_come_back_with_a_saved_state(core: ct.CDLL, robot: Robot) -> None:
    plant = standing(core, robot)
    commands = list(walking(robot, 0.3))
    for t, command in commands[:30]:
        plant.step(t, command)
    saved = plant.save()
    ends = []
    for _ in range(2):
        for t, command in commands[30:]:
            plant.step(t, command)
        ends.append(plant.save())
        plant.restore(saved)
    assert ends[0] == ends[1]


# ---- energy balance ----


@pytest.mark.parametrize(("name", "tolerance"), [("rosw3", 1e-4), ("ros2", 0.1)])
def test_the_energy_balance_closes_where_motors_are_on_their_torque_speed_line(
    core: ct.CDLL, name: str, tolerance: float
) -> None:
    """The legs swing so fast that the torque-speed line limits the motors.

    Clipping a stage's torque after its shift by the implicit increment would leave about 1 %.
    """
    robot = changed(load_robot("athena"), solver={"method": name, "tolerance": tolerance})
    plant = Plant(core, robot, position=(0.0, 0.0, 1.0))
    limited = 0
    for k in range(1, 161):
        swing = 0.5 * math.sin(2.0 * math.pi * 3.0 * 0.005 * k)
        command = Command(angle_ref=robot.stance + swing)
        plant.step(0.005 * k, command)
        output = plant.output(command)
        line = 6.0 * np.clip(1.0 - np.abs(output.speed) / 6.6, 0.0, 1.0)
        limited += int(np.count_nonzero(np.abs(np.abs(output.torque) - line) < 1e-9))
    assert limited > 200
    worked = float(np.sum(output.positive_work) + np.sum(output.negative_work))
    assert abs(output.energy.residual) < (1e-4 if name == "rosw3" else 3e-3) * worked
