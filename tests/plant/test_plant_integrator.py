"""Tests the integrators: order by regression, error in proportion to the tolerance, lengths of
steps.
"""

from __future__ import annotations

import ctypes as ct
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from mirror import NOT_FINITE
from plant import Plant, PlantError, inputs, probed
from states import changed, random_command

from hexapod_cosim.models import METHODS, Robot, load_robot
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.contact.geometry import foot_contacts
from hexapod_cosim.models.dynamics import Command
from hexapod_cosim.models.kinematics import body_states

ORDER = {"rosw3": 3, "ros2": 2, "dp54": 5}
SLOPE = 0.1  # difference of the regression's order from the method's order
BASE = load_robot("phantomx_mk4")
WIDE_SERVO: dict[str, Any] = {
    "torque_max": 100.0,
    "speed_max": 1e3,
    "coulomb_friction": 0.0,
}  # never clipped: smooth


@dataclass(frozen=True)
class Problem:
    """A smooth motion: robot, start, command, duration [s], and the numbers of steps, by order, at
    which the error is asymptotic and above rounding.
    """

    robot: Robot
    start: dict[str, Any]
    command: Command
    duration: float
    counts: Callable[[int], tuple[int, ...]]
    bristles: float = 0.0  # deflection at the start along x, divided by the presliding


def tumbling() -> Problem:
    """Returns free fall with spinning links and constant torques, in which nothing is stiff."""
    rng = np.random.default_rng(0)
    start = {
        "quaternion": [1.0, 0.1, 0.2, 0.3],
        "velocity": [0.1, 0.2, 0.3],
        "angular_velocity": [1.0, -2.0, 1.5],
        "angle": BASE.stance + rng.normal(0.0, 0.2, (6, 3)),
        "speed": rng.normal(0.0, 2.0, (6, 3)),
    }
    robot = changed(BASE, servo=WIDE_SERVO | {"mode": "torque"})
    return Problem(
        robot,
        start,
        random_command(BASE, 3, size=0.3),
        0.1,
        lambda order: (40, 57, 80) if order == 5 else (128, 181, 256),
    )


def driven() -> Problem:
    """Returns kinematic drives on a ramp whose start differs from theirs, so the right side depends
    on time.
    """
    start = {"angle": BASE.stance + 0.05, "angular_velocity": [1.0, -2.0, 1.5]}
    command = Command(angle_ref=BASE.stance, speed_ref=random_command(BASE, 1).speed_ref)
    return Problem(
        changed(BASE, servo={"mode": "kinematic"}),
        start,
        command,
        0.1,
        lambda order: (40, 57, 80) if order == 5 else (128, 181, 256),
    )


def pressed() -> Problem:
    """Returns a robot with all feet in soft ground, sliding, with working servos.

    Contacts and servos enter W, and no foot leaves the ground or lands.
    """
    robot = changed(
        BASE,
        servo=WIDE_SERVO | {"kp": 20.0, "kd": 0.5},
        contact={"stiffness": 2e4, "impact_speed_floor": 2.0},
        friction={"slope": 3.0},
    )
    still, flat = np.zeros(3), np.zeros((6, 3))
    feet = foot_contacts(
        robot, body_states(robot, still, np.eye(4)[0], still, still, BASE.stance, flat)
    )
    start = {"position": [0.0, 0.0, min(foot.penetration for foot in feet) - 6e-3]}
    rng = np.random.default_rng(0)
    command = Command(
        angle_ref=BASE.stance + rng.normal(0.0, 0.02, (6, 3)),
        push_force=np.array([3.0, 2.0, -10.0]),
    )
    return Problem(
        robot, start, command, 0.05, lambda order: (50, 71, 100) if order == 5 else (128, 181, 256)
    )


def stuck() -> Problem:
    """Returns the same motion with bristle friction, far from the spring limit."""
    problem = pressed()
    robot = changed(problem.robot, friction={"law": "bristle", "presliding": 0.05})
    return replace(
        problem,
        robot=robot,
        bristles=0.1,
        counts=lambda order: (57, 80, 113) if order == 5 else problem.counts(order),
    )


def sliding() -> Problem:
    """Returns the same motion with fully stretched bristles, while the robot slides along x."""
    problem, friction = pressed(), {"law": "bristle", "presliding": 2e-3, "mu": 0.2}
    start = problem.start | {"velocity": [0.5, 0.0, 0.0]}
    return replace(
        problem, robot=changed(problem.robot, friction=friction), start=start, bristles=1.0
    )


def weakening() -> Problem:
    """Returns the same motion with static friction above kinetic friction, at speeds between the
    two.
    """
    problem = sliding()
    return replace(
        problem, robot=changed(problem.robot, friction={"mu_static": 0.3, "stribeck_speed": 0.3})
    )


PROBLEMS = {
    "tumbling": tumbling(),
    "driven": driven(),
    "pressed": pressed(),
    "stuck": stuck(),
    "sliding": sliding(),
    "weakening": weakening(),
}


def started(core: ct.CDLL, problem: Problem, **solver: Any) -> Plant:
    plant = Plant(core, changed(problem.robot, solver=solver), **problem.start)
    z = np.tile([problem.bristles * problem.robot.friction.presliding, 0.0, 0.0], (6, 1))
    probed(core.hx_probe_bristles, plant, inputs(problem.command), z, size=18)
    return plant


def end(core: ct.CDLL, problem: Problem, **solver: Any) -> Array:
    plant = started(core, problem, **solver)
    plant.step(problem.duration, problem.command)
    return plant.bodies


def reference(core: ct.CDLL, problem: Problem) -> Array:
    return end(core, problem, method="dp54", step=problem.duration / 800.0)


def slope(x: Any, error: Any) -> float:
    return float(np.polyfit(np.log(x), np.log(error), 1)[0])


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("problem", PROBLEMS.values(), ids=PROBLEMS)
def test_each_method_has_its_order(core: ct.CDLL, method: str, problem: Problem) -> None:
    exact, steps = (
        reference(core, problem),
        problem.duration / np.array(problem.counts(ORDER[method])),
    )
    errors = [
        float(np.max(np.abs(end(core, problem, method=method, step=float(step)) - exact)))
        for step in steps
    ]
    assert slope(steps, errors) == pytest.approx(ORDER[method], abs=SLOPE)
    assert errors[-1] < 1e-3


@pytest.mark.parametrize("name", ["pressed", "stuck", "sliding", "weakening"])
def test_no_foot_lands_or_leaves_while_pressed_and_bristles_stay_stuck_or_sliding(
    core: ct.CDLL, name: str
) -> None:
    """Checks the assumption of the order tests of these problems."""
    problem, stretched = PROBLEMS[name], []
    plant = started(core, problem)
    for k in range(1, 11):
        plant.step(k / 10.0 * problem.duration, problem.command)
        foot = plant.output(problem.command).foot
        assert np.all(foot.normal_force > 0.1)
        stretched.extend(np.linalg.norm(foot.bristle, axis=1) / problem.robot.friction.presliding)
    assert plant.output().solver.touchdowns == 0.0
    assert float(np.max(plant.output().foot.slip_speed)) > 0.01
    assert name != "stuck" or 0.05 < max(stretched) < 0.7
    assert name != "sliding" or 0.99 < min(stretched) < 1.0 + 1e-3


@pytest.mark.parametrize("method", METHODS)
def test_fixed_steps_are_as_long_and_as_many_as_asked_for(core: ct.CDLL, method: str) -> None:
    problem = PROBLEMS["pressed"]
    plant = Plant(
        core, changed(problem.robot, solver={"method": method, "step": 1e-3}), **problem.start
    )
    plant.step(0.01, problem.command)
    plant.step(0.0125, problem.command)
    assert plant.output().solver.steps == 13
    assert plant.time == 0.0125


def test_an_error_estimate_above_the_tolerance_rejects_the_step(core: ct.CDLL) -> None:
    """A servo receives a large torque after a long quiet flight. The step has grown in flight and
    is too long for the torque.
    """
    robot = changed(BASE, solver={"tolerance": 1e-8, "step_max": 1.0})
    plant = Plant(core, robot, position=(0.0, 0.0, 5.0))
    plant.step(0.3)
    quiet = plant.output().solver
    plant.step(0.4, Command(angle_ref=BASE.stance + 0.3))
    worked = plant.output().solver
    assert worked.rejected > quiet.rejected
    assert worked.steps - quiet.steps > 20


def test_the_step_length_ends_where_the_macro_step_ends_and_the_pieces_add_up(
    core: ct.CDLL,
) -> None:
    """The same fixed steps give the same bits in one call and in many.

    Only inputs and contacts relate a step to its call.
    """
    problem = PROBLEMS["pressed"]
    robot = changed(problem.robot, solver={"method": "rosw3", "step": 2.0**-10})
    one, many = Plant(core, robot, **problem.start), Plant(core, robot, **problem.start)
    one.step(32 * 2.0**-10, problem.command)
    for k in range(1, 33):
        many.step(k * 2.0**-10, problem.command)
    assert np.array_equal(one.bodies, many.bodies)


@pytest.mark.parametrize("bus_period", [0.0, 0.05])  # s; each part is one step
def test_an_explicit_method_that_blows_up_says_so_and_leaves_the_plant_alone(
    core: ct.CDLL, bus_period: float
) -> None:
    robot = changed(
        load_robot("athena"),
        servo={"bus_period": bus_period},
        solver={"method": "dp54", "step": 0.05},
    )
    plant = Plant(core, robot, position=(0.0, 0.0, 0.3))
    before = plant.save()
    with pytest.raises(
        PlantError, match=r"not finite any more at t = .*solver\.step = 0"
    ) as caught:
        plant.step(20.0)
    assert caught.value.status == NOT_FINITE
    assert plant.save() == before


@pytest.mark.parametrize("method", METHODS)
def test_quaternions_keep_their_length(core: ct.CDLL, method: str) -> None:
    lengths = np.linalg.norm(
        end(core, PROBLEMS["tumbling"], method=method, step=1e-3)[:, 3:7], axis=1
    )
    assert float(np.max(np.abs(lengths - 1.0))) < 1e-15
