"""The integrators: order by regression, error control in proportion to its tolerance, steps as asked for."""

from __future__ import annotations

import ctypes as ct
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from mirror import NOT_FINITE
from plant import Plant, PlantError, inputs, pointer, probed
from slopes import LawSlopes, assembled, law_slopes, resting
from states import changed, random_command, scaled

from hexapod_cosim.models import METHODS, Robot, load_robot
from hexapod_cosim.models.contact import foot_contacts
from hexapod_cosim.models.dynamics import Command, constraints, mass_matrix
from hexapod_cosim.models.kinematics import body_states, quaternion_rate
from hexapod_cosim.models.records import Array

ORDER = {"rosw3": 3, "ros2": 2, "dp54": 5, "bs32": 3, "rk4": 4}
EMBEDDED = ("rosw3", "ros2", "dp54", "bs32")
SLOPE = 0.1  # of the regression, off the order
BASE = load_robot("phantomx_mk4")
WIDE_SERVO: dict[str, Any] = {"torque_max": 100.0, "speed_max": 1e3, "coulomb_friction": 0.0}  # never clipped: smooth


@dataclass(frozen=True)
class Problem:
    """A smooth motion: robot, start, command and duration [s]; steps by order at which the error is asymptotic and above rounding."""

    robot: Robot
    start: dict[str, Any]
    command: Command
    duration: float
    counts: Callable[[int], tuple[int, ...]]
    bristles: float = 0.0  # at the start, along x, over the presliding


def tumbling() -> Problem:
    """Free fall with spinning links and constant torques: nothing stiff."""
    rng = np.random.default_rng(0)
    start = {
        "quaternion": [1.0, 0.1, 0.2, 0.3],
        "velocity": [0.1, 0.2, 0.3],
        "angular_velocity": [1.0, -2.0, 1.5],
        "angle": BASE.stance + rng.normal(0.0, 0.2, (6, 3)),
        "speed": rng.normal(0.0, 2.0, (6, 3)),
    }
    robot = changed(BASE, servo=WIDE_SERVO | {"mode": "torque"})
    return Problem(robot, start, random_command(BASE, 3, size=0.3), 0.1, lambda order: (40, 57, 80) if order == 5 else (128, 181, 256))


def driven() -> Problem:
    """Kinematic drives on a ramp that they do not start on: the right side depends on time."""
    start = {"angle": BASE.stance + 0.05, "angular_velocity": [1.0, -2.0, 1.5]}
    command = Command(angle_ref=BASE.stance, speed_ref=random_command(BASE, 1).speed_ref)
    return Problem(
        changed(BASE, servo={"mode": "kinematic"}), start, command, 0.1, lambda order: (40, 57, 80) if order == 5 else (128, 181, 256)
    )


def pressed() -> Problem:
    """All feet in soft ground, sliding, servos working: contact and servo enter W, and no foot leaves or lands."""
    robot = changed(
        BASE, servo=WIDE_SERVO | {"kp": 20.0, "kd": 0.5}, contact={"stiffness": 2e4, "impact_speed_floor": 2.0}, friction={"slope": 3.0}
    )
    still, flat = np.zeros(3), np.zeros((6, 3))
    feet = foot_contacts(robot, body_states(robot, still, np.eye(4)[0], still, still, BASE.stance, flat))
    start = {"position": [0.0, 0.0, min(foot.penetration for foot in feet) - 6e-3]}
    rng = np.random.default_rng(0)
    command = Command(angle_ref=BASE.stance + rng.normal(0.0, 0.02, (6, 3)), push_force=np.array([3.0, 2.0, -10.0]))
    return Problem(robot, start, command, 0.05, lambda order: (50, 71, 100) if order == 5 else (128, 181, 256))


def stuck() -> Problem:
    """The same on bristles far from letting go."""
    problem = pressed()
    robot = changed(problem.robot, friction={"law": "bristle", "presliding": 0.05})
    return replace(problem, robot=robot, bristles=0.1, counts=lambda order: (57, 80, 113) if order == 5 else problem.counts(order))


def sliding() -> Problem:
    """The same on bristles stretched to the full, the robot sliding on along x."""
    problem, friction = pressed(), {"law": "bristle", "presliding": 2e-3, "mu": 0.2}
    start = problem.start | {"velocity": [0.5, 0.0, 0.0]}
    return replace(problem, robot=changed(problem.robot, friction=friction), start=start, bristles=1.0)


PROBLEMS = {"tumbling": tumbling(), "driven": driven(), "pressed": pressed(), "stuck": stuck(), "sliding": sliding()}


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
    exact, steps = reference(core, problem), problem.duration / np.array(problem.counts(ORDER[method]))
    errors = [float(np.max(np.abs(end(core, problem, method=method, step=float(step)) - exact))) for step in steps]
    assert slope(steps, errors) == pytest.approx(ORDER[method], abs=SLOPE)
    assert errors[-1] < 1e-3


@pytest.mark.parametrize("name", ["pressed", "stuck", "sliding"])
def test_no_foot_lands_or_leaves_while_pressed_and_bristles_stay_stuck_or_sliding(core: ct.CDLL, name: str) -> None:
    """What the order of those problems rests on."""
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


@pytest.mark.parametrize("method", EMBEDDED)
@pytest.mark.parametrize("problem", ["tumbling", "pressed"])
def test_the_error_falls_in_proportion_to_the_tolerance(core: ct.CDLL, method: str, problem: str) -> None:
    exact, tolerances = reference(core, PROBLEMS[problem]), np.array([1e-5, 1e-6, 1e-7, 1e-8])
    scale = np.array([0.1] * 3 + [1.0] * 7 + [10.0] * 3)
    errors = []
    for tolerance in tolerances:
        got = end(core, PROBLEMS[problem], method=method, step=0.0, tolerance=float(tolerance), step_max=1.0)
        errors.append(float(np.max(np.abs(got - exact) / scale)))
    # a method of order p estimated at order p - 1 keeps h^p in proportion to the tolerance
    assert slope(tolerances, errors) == pytest.approx(1.0, abs=0.2)
    assert np.all(np.array(errors) < 30.0 * tolerances)


@pytest.mark.parametrize("method", METHODS)
def test_fixed_steps_are_as_long_and_as_many_as_asked_for(core: ct.CDLL, method: str) -> None:
    problem = PROBLEMS["pressed"]
    plant = Plant(core, changed(problem.robot, solver={"method": method, "step": 1e-3}), **problem.start)
    plant.step(0.01, problem.command)
    plant.step(0.0125, problem.command)
    assert plant.output().solver.steps == 13
    assert plant.time == 0.0125


def test_the_longest_step_is_kept_under_error_control(core: ct.CDLL) -> None:
    problem = PROBLEMS["tumbling"]
    plant = Plant(core, changed(problem.robot, solver={"tolerance": 1.0, "step_max": 2e-3}), **problem.start)
    plant.step(0.1, problem.command)
    assert plant.output().solver.steps >= 50


def test_an_error_estimate_above_the_tolerance_rejects_the_step(core: ct.CDLL) -> None:
    """A servo that hits a wall of torque after a long quiet flight: the step grown in flight is too long for it."""
    robot = changed(BASE, solver={"tolerance": 1e-8, "step_max": 1.0})
    plant = Plant(core, robot, position=(0.0, 0.0, 5.0))
    plant.step(0.3)
    quiet = plant.output().solver
    plant.step(0.4, Command(angle_ref=BASE.stance + 0.3))
    worked = plant.output().solver
    assert worked.rejected > quiet.rejected
    assert worked.steps - quiet.steps > 20


def test_the_step_length_ends_where_the_macro_step_ends_and_the_pieces_add_up(core: ct.CDLL) -> None:
    """The same fixed steps, taken in one call or in many, give the same bits: inputs and contacts alone tie a step to its call."""
    problem = PROBLEMS["pressed"]
    robot = changed(problem.robot, solver={"method": "rosw3", "step": 2.0**-10})
    one, many = Plant(core, robot, **problem.start), Plant(core, robot, **problem.start)
    one.step(32 * 2.0**-10, problem.command)
    for k in range(1, 33):
        many.step(k * 2.0**-10, problem.command)
    assert np.array_equal(one.bodies, many.bodies)


def test_an_explicit_method_that_blows_up_says_so_and_leaves_the_plant_alone(core: ct.CDLL) -> None:
    robot = changed(load_robot("athena"), solver={"method": "rk4", "step": 0.05})
    plant = Plant(core, robot, position=(0.0, 0.0, 0.125))
    before = plant.save()
    with pytest.raises(PlantError, match=r"not finite any more at t = .*solver\.step = 0") as caught:
        plant.step(20.0)
    assert caught.value.status == NOT_FINITE
    assert plant.save() == before


# one linearly implicit step against the textbook's formula


@dataclass(frozen=True)
class Tableau:
    """A row of the plant's methods."""

    stages: int
    gamma: float
    a: Array
    g: Array
    b: Array
    e: Array


def coefficients(core: ct.CDLL, method: str) -> Tableau:
    shape, gamma = (ct.c_int * 3)(), ct.c_double()
    a, g, c, b, e = np.zeros((7, 7)), np.zeros((7, 7)), np.zeros(7), np.zeros(7), np.zeros(7)
    core.hx_probe_method(METHODS.index(method) + 1, shape, ct.byref(gamma), *map(pointer, (a, g, c, b, e)))
    return Tableau(shape[0], gamma.value, a, g, b, e)


def rates(core: ct.CDLL, plant: Plant, command: Command) -> Callable[[Array], Array]:
    """dy/dt of bodies (247,), by the plant put there."""

    def rate(y: Array) -> Array:
        plant.bodies = y.reshape(19, 13)
        result, power = np.zeros((19, 13)), np.zeros(3)
        core.hx_probe_rate(ct.c_void_p(plant.handle), ct.byref(inputs(command)), ct.c_double(0.0), pointer(result), pointer(power))
        return result.ravel()

    return rate


@dataclass
class DenseStages:
    """The stages of eq. 15 one after the other, solved as the dense system: nu (114,) that positions advance with, and alpha."""

    robot: Robot
    law: LawSlopes
    rate: Callable[[Array], Array]
    z: float

    def solve(self, body: Array, s_x: Array, s_v: Array) -> tuple[Array, Array]:
        """W u + D^T mu = G_v (s_v + z a) + G_x (s_x + z (v + s_v) + z^2 a), D u = 0; alpha = a + u, nu = v + s_v + z alpha."""
        z, v, a = self.z, body[:, 7:13].ravel(), self.rate(body.ravel()).reshape(19, 13)[:, 7:13].ravel()
        G_x, G_v = assembled(self.robot, body, self.law)
        D = constraints(self.robot, body).D
        W = mass_matrix(self.robot, body) - z * G_v - z * z * G_x
        right = G_v @ (s_v + z * a) + G_x @ (s_x + z * (v + s_v) + z * z * a)
        u = np.linalg.solve(np.block([[W, D.T], [D, np.zeros((90, 90))]]), np.concatenate([right, np.zeros(90)]))[:114]
        return v + s_v + z * (a + u), a + u


def body_rates(body: Array, nu: Array, alpha: Array) -> Array:
    """(247,) dy/dt of positions that advance with nu."""
    w = nu.reshape(19, 6)
    turns = np.array([quaternion_rate(p, turn) for p, turn in zip(body[:, 3:7], w[:, 3:6], strict=True)])
    return np.hstack([w[:, 0:3], turns, alpha.reshape(19, 6)]).ravel()


@pytest.mark.parametrize("method", ["rosw3", "ros2"])
def test_an_implicit_step_is_that_of_the_dense_stages(core: ct.CDLL, method: str) -> None:
    """Contact and servo keep the first stage's slopes, masses and joints are each stage's own; h is many of friction's times."""
    h, robot = 2e-3, changed(load_robot("athena"), solver={"method": method, "step": 2e-3})
    body, command = resting(robot, 1), Command(angle_ref=robot.stance)
    body[:, 2] += 1.5e-4 - 4e-4  # all feet in the ground
    plant, there = Plant(core, robot), Plant(core, robot)
    plant.bodies = body

    m = coefficients(core, method)
    stages = DenseStages(robot, law_slopes(robot, command, body), rates(core, there, command), h * m.gamma)
    k, nu, alpha = np.zeros((7, 247)), np.zeros((7, 114)), np.zeros((7, 114))
    for i in range(m.stages):
        y = (body.ravel() + h * m.a[i] @ k).reshape(19, 13)
        nu[i], alpha[i] = stages.solve(y, h * m.g[i] @ nu, h * m.g[i] @ alpha)
        k[i] = body_rates(y, nu[i], alpha[i])
    exact = (body.ravel() + h * m.b @ k).reshape(19, 13)
    exact[:, 3:7] /= np.linalg.norm(exact[:, 3:7], axis=1, keepdims=True)
    plant.step(h, command)
    moved = np.max(np.abs(exact - body), axis=0)
    assert np.all(np.max(np.abs(plant.bodies - exact), axis=0) < 1e-5 * moved)
    fastest = np.max(np.abs(np.linalg.eigvals(np.linalg.solve(mass_matrix(robot, body), assembled(robot, body, stages.law)[1]))))
    assert h * fastest > 10.0


@pytest.mark.parametrize("margin", [0.99, 1.01])
@pytest.mark.parametrize(("size", "deciding"), [(1.0, range(7, 10)), (0.05, range(10, 13))], ids=["velocity", "angular velocity"])
def test_a_step_is_rejected_when_its_largest_scaled_error_exceeds_the_tolerance(
    core: ct.CDLL, size: float, deciding: range, margin: float
) -> None:
    """Scales 0.1 m, 1 (quaternion), 1 m/s, 10 rad/s; the smaller a robot, the more its turning counts. The first step tried is 1e-4 s."""
    h, robot = 1e-4, scaled(PROBLEMS["tumbling"].robot, size)
    start = PROBLEMS["tumbling"].start | {"speed": 20.0 * np.random.default_rng(1).normal(size=(6, 3))}
    plant, command = Plant(core, robot, **start), Command(angle_ref=robot.stance)
    m, k, y0, rate = coefficients(core, "bs32"), np.zeros((7, 247)), plant.bodies.ravel(), rates(core, plant, command)
    for i in range(m.stages):
        k[i] = h * rate(y0 + m.a[i] @ k)
    largest = np.max(np.abs(m.e @ k).reshape(19, 13), axis=0) / ([0.1] * 3 + [1.0] * 7 + [10.0] * 3)
    assert int(np.argmax(largest)) in deciding
    solver = {"method": "bs32", "step": 0.0, "tolerance": margin * float(np.max(largest)), "step_max": 1.0}
    tried = Plant(core, changed(robot, solver=solver), **start)
    tried.step(h, command)
    assert (tried.output().solver.rejected > 0) == (margin < 1.0)


@pytest.mark.parametrize("method", METHODS)
def test_quaternions_keep_their_length(core: ct.CDLL, method: str) -> None:
    lengths = np.linalg.norm(end(core, PROBLEMS["tumbling"], method=method, step=1e-3)[:, 3:7], axis=1)
    assert float(np.max(np.abs(lengths - 1.0))) < 1e-15
