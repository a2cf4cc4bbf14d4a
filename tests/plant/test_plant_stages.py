"""Tests a step of the integrator, stage by stage, against the dense systems of eq. 19 and 20, and
for bristles of eq. 21.
"""

from __future__ import annotations

import ctypes as ct
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from plant import Plant, inputs, pointer, probed
from slopes import LawSlopes, assembled, law_slopes, resting
from states import changed

from hexapod_cosim.models import METHODS, Robot, load_robot
from hexapod_cosim.models.contact.geometry import foot_contacts, standing_damping
from hexapod_cosim.models.contact.law import normal_force
from hexapod_cosim.models.dynamics import Command, constraints, mass_matrix
from hexapod_cosim.models.kinematics import quaternion_rate, skew
from hexapod_cosim.models.records import Array


@dataclass(frozen=True)
class Tableau:
    """A row of the plant's table of methods."""

    stages: int
    gamma: float
    a: Array
    g: Array
    b: Array
    e: Array


def coefficients(core: ct.CDLL, method: str) -> Tableau:
    shape, gamma = (ct.c_int * 2)(), ct.c_double()
    a, g, c, b, e = np.zeros((7, 7)), np.zeros((7, 7)), np.zeros(7), np.zeros(7), np.zeros(7)
    core.hx_probe_method(
        METHODS.index(method) + 1, shape, ct.byref(gamma), *map(pointer, (a, g, c, b, e))
    )
    return Tableau(shape[0], gamma.value, a, g, b, e)


def rates(core: ct.CDLL, plant: Plant, command: Command) -> Callable[[Array], Array]:
    """Returns dy/dt of the bodies (247,), which the plant computes from them."""

    def rate(y: Array) -> Array:
        plant.bodies = y.reshape(19, 13)
        result, power = np.zeros((19, 13)), np.zeros(3)
        core.hx_probe_rate(
            ct.c_void_p(plant.handle),
            ct.byref(inputs(command)),
            ct.c_double(0.0),
            pointer(result),
            pointer(power),
        )
        return result.ravel()

    return rate


@dataclass
class DenseStages:
    """Computes the stages of eq. 19 one after the other as dense systems.

    Each yields nu (114,), with which positions advance, and the accelerations alpha.
    """

    robot: Robot
    law: LawSlopes
    rate: Callable[[Array], Array]
    z: float

    def solve(self, body: Array, s_x: Array, s_v: Array) -> tuple[Array, Array]:
        """Solves W u + D^T mu = G_v (s_v + z a) + G_x (s_x + z (v + s_v) + z^2 a), D u = 0 and
        returns alpha = a + u and nu = v + s_v + z alpha.
        """
        z, v, a = (
            self.z,
            body[:, 7:13].ravel(),
            self.rate(body.ravel()).reshape(19, 13)[:, 7:13].ravel(),
        )
        G_x, G_v = assembled(self.robot, body, self.law)
        D = constraints(self.robot, body).D
        W = mass_matrix(self.robot, body) - z * G_v - z * z * G_x
        right = G_v @ (s_v + z * a) + G_x @ (s_x + z * (v + s_v) + z * z * a)
        u = np.linalg.solve(
            np.block([[W, D.T], [D, np.zeros((90, 90))]]), np.concatenate([right, np.zeros(90)])
        )[:114]
        return v + s_v + z * (a + u), a + u


def body_rates(body: Array, nu: Array, alpha: Array) -> Array:
    """Returns dy/dt (247,) of bodies whose positions advance with nu."""
    w = nu.reshape(19, 6)
    turns = np.array(
        [quaternion_rate(p, turn) for p, turn in zip(body[:, 3:7], w[:, 3:6], strict=True)]
    )
    return np.hstack([w[:, 0:3], turns, alpha.reshape(19, 6)]).ravel()


@pytest.mark.parametrize("method", ["rosw3", "ros2"])
def test_an_implicit_step_is_that_of_the_dense_stages(core: ct.CDLL, method: str) -> None:
    """The slopes of contacts and servos are those of the first stage, masses and joints are those
    of each stage. The step h is many time constants of friction.
    """
    h, robot = 2e-3, changed(load_robot("athena"), solver={"method": method, "step": 2e-3})
    body, command = resting(robot, 1), Command(angle_ref=robot.stance)
    body[:, 2] += 1.5e-4 - 4e-4  # all feet are in the ground
    plant, there = Plant(core, robot), Plant(core, robot)
    plant.bodies = body

    m = coefficients(core, method)
    stages = DenseStages(
        robot, law_slopes(robot, command, body), rates(core, there, command), h * m.gamma
    )
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
    fastest = np.max(
        np.abs(
            np.linalg.eigvals(
                np.linalg.solve(mass_matrix(robot, body), assembled(robot, body, stages.law)[1])
            )
        )
    )
    assert h * fastest > 10.0


@dataclass
class StuckStages(DenseStages):
    """Computes the same stages with bristles below the spring limit, for which eq. 21 has beta = 0.

    `rate` stores the rates of the bristles in `bristle_rate`.
    """

    G_b: Array  # (6,) N/m
    bristle_rate: Array  # (6, 3) m/s

    def grips(self, body: Array) -> Array:
        """Returns (6, 114, 3): the generalised forces on the bodies by a unit force along flat
        ground on each foot.
        """
        G = np.zeros((6, 114, 3))
        for leg, foot in enumerate(foot_contacts(self.robot, body)):
            tibia = 3 * (leg + 1)
            G[leg, 6 * tibia : 6 * tibia + 6] = np.vstack(
                [np.eye(3), skew(foot.point - body[tibia, 0:3])]
            ) @ np.diag([1.0, 1.0, 0.0])
        return G

    def solve_stuck(
        self, body: Array, s_x: Array, s_v: Array, s_b: Array
    ) -> tuple[Array, Array, Array]:
        """Adds z^2 G_b at each foot to W, and G_b (s_b + z (db/dt + s_v + z a)) to the right side;
        returns nu, alpha and k_b/h.
        """
        z, grips = self.z, self.grips(body)
        a = self.rate(body.ravel()).reshape(19, 13)[:, 7:13].ravel()
        G_x, G_v = assembled(self.robot, body, self.law)
        moved = s_b + z * (self.bristle_rate + np.einsum("lij,i->lj", grips, s_v + z * a))
        D, springs = (
            constraints(self.robot, body).D,
            np.einsum("l,lij,lkj->ik", self.G_b, grips, grips),
        )
        W = mass_matrix(self.robot, body) - z * G_v - z * z * (G_x + springs)
        right = G_v @ (s_v + z * a) + G_x @ (s_x + z * (body[:, 7:13].ravel() + s_v) + z * z * a)
        right += np.einsum("l,lij,lj->i", self.G_b, grips, moved)
        u = np.linalg.solve(
            np.block([[W, D.T], [D, np.zeros((90, 90))]]), np.concatenate([right, np.zeros(90)])
        )[:114]
        nu = body[:, 7:13].ravel() + s_v + z * (a + u)
        return nu, a + u, self.bristle_rate + np.einsum("lij,i->lj", grips, s_v + z * (a + u))


def plant_rate(core: ct.CDLL, plant: Plant, command: Command) -> Array:
    """Returns the rates of the plant's bodies at its state (247,)."""
    result, power = np.zeros((19, 13)), np.zeros(3)
    core.hx_probe_rate(
        ct.c_void_p(plant.handle),
        ct.byref(inputs(command)),
        ct.c_double(0.0),
        pointer(result),
        pointer(power),
    )
    return result.ravel()


def standing_loads(robot: Robot, body: Array) -> Array:
    """Returns the normal forces on feet at rest (6,) [N]."""
    damping = standing_damping(robot, body)
    return np.array(
        [
            normal_force(robot.contact, damping[leg], foot.penetration, 0.0)
            for leg, foot in enumerate(foot_contacts(robot, body))
        ]
    )


@pytest.mark.parametrize("static", [0.0, 0.9])
@pytest.mark.parametrize("method", ["rosw3", "ros2"])
def test_an_implicit_step_on_bristles_is_that_of_the_dense_stages(
    core: ct.CDLL, method: str, static: float
) -> None:
    h, friction = 2e-3, {"law": "bristle", "mu_static": static}
    robot = changed(load_robot("athena"), solver={"method": method, "step": h}, friction=friction)
    body, command = resting(robot, 1), Command(angle_ref=robot.stance)
    body[:, 2] += 1.5e-4 - 4e-4  # all feet are in the ground
    u = np.random.default_rng(3).uniform(-0.3, 0.3, (6, 3)) * [1.0, 1.0, 0.0]
    b, m = u * robot.friction.presliding, coefficients(core, method)
    plant, there = Plant(core, robot), Plant(core, robot)

    def put(target: Plant, bodies: Array, bristles: Array) -> Array:
        target.bodies = bodies
        return probed(core.hx_probe_bristles, target, inputs(command), bristles, size=18).reshape(
            6, 3
        )

    def rate(_: Array) -> Array:
        return plant_rate(core, there, command)

    put(plant, body, b)
    G_b = -(static or 0.7) * standing_loads(robot, body) * (3.0 - np.sum(u * u, axis=1))
    G_b = G_b / (2.0 * robot.friction.presliding)
    stages = StuckStages(
        robot, law_slopes(robot, command, body), rate, h * m.gamma, G_b, np.zeros((6, 3))
    )
    k, k_b = np.zeros((7, 247)), np.zeros((7, 6, 3))
    nu, alpha = np.zeros((2, 7, 114))
    for i in range(m.stages):
        y = (body.ravel() + h * m.a[i] @ k).reshape(19, 13)
        stages.bristle_rate = put(there, y, b + h * np.tensordot(m.a[i], k_b, 1))
        nu[i], alpha[i], k_b[i] = stages.solve_stuck(
            y, h * m.g[i] @ nu, h * m.g[i] @ alpha, h * np.tensordot(m.g[i], k_b, 1)
        )
        k[i] = body_rates(y, nu[i], alpha[i])
    exact = (body.ravel() + h * m.b @ k).reshape(19, 13)
    exact[:, 3:7] /= np.linalg.norm(exact[:, 3:7], axis=1, keepdims=True)
    stretched = h * np.tensordot(m.b, k_b, 1)
    plant.step(h, command)
    moved = np.max(np.abs(exact - body), axis=0)
    assert np.all(np.max(np.abs(plant.bodies - exact), axis=0) < 1e-5 * moved)
    closed = plant.output().foot.contact != 0
    assert np.count_nonzero(closed) > 3
    assert float(
        np.max(np.abs(plant.output().foot.bristle - b - stretched)[closed])
    ) < 1e-5 * float(np.max(np.abs(stretched)))
    assert np.all(np.linalg.norm(b + stretched, axis=1) < 0.7 * robot.friction.presliding)
