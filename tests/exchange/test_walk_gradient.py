"""Tests the gradient of a walk's cost by a chain of derivatives against differences of walks."""

from __future__ import annotations

import ctypes
from pathlib import Path

import numpy as np
import pytest
from exchange_calls import STATES, Array
from fmi_plant import ATHENA, OK, Plant
from numpy.typing import NDArray
from scipy.linalg import expm

from hexapod_cosim.controller import BodyCommand, Controller, Measurement, make_gait
from hexapod_cosim.models import load_robot

PERIOD, SETTLED = 0.005, 200  # s, 1
LENGTH, SPEED, CHANGE = 0.5, 0.08, 1e-4  # s, m/s, m/s
LEGS = ("LF", "LM", "LR", "RF", "RM", "RR")
JOINTS = [f"{leg}.{joint}" for leg in LEGS for joint in ("coxa", "femur", "tibia")]
COMMANDS = [f"{name}.{kind}_ref" for name in JOINTS for kind in ("angle", "speed", "torque")]
NUMBERS = ["servo.kp", "torso.mass"]
SHOWN = ["torso.position[3]", "torso.velocity[1]", *(f"{name}.torque" for name in JOINTS)]
WEIGHT = np.array([1.0, 1e-2, *[1e-6] * len(JOINTS)])
KNOWNS = STATES + NUMBERS + COMMANDS


def commands(speed: float) -> Array:
    """Returns the commands (periods, 54) of kinematic walking in a tripod gait at a speed [m/s]."""
    robot = load_robot("athena")
    controller = Controller(robot, period=PERIOD, gait=make_gait(robot, "tripod"))
    rows = []
    for k in range(round(LENGTH / PERIOD)):
        joints = controller.step(k * PERIOD, BodyCommand(vx=speed), Measurement())
        kinds = (joints.angle_ref, joints.speed_ref, joints.torque_ref)
        rows.append(np.stack([np.broadcast_to(kind, (6, 3)) for kind in kinds], axis=-1).ravel())
    return np.array(rows)


class StandingRobot:
    """A standing robot from which walks begin; numbers: servo.kp, torso.mass, speed."""

    def __init__(self, library: Path, h: float) -> None:
        self.h = h  # s
        self.plant = Plant(library).initialize()
        stance = dict(zip(COMMANDS, commands(0.0)[0].tolist(), strict=True))
        assert self.plant.set_reals(stance) == OK
        for k in range(SETTLED):
            assert self.plant.step(k * PERIOD, PERIOD) == OK
        self.stands = self.plant.save()
        self.rates = self.references([state.derivative for state in ATHENA.states])
        self.shown, self.given = self.references(SHOWN), self.references(KNOWNS)
        self.faster = (commands(SPEED + CHANGE) - commands(SPEED - CHANGE)) / (2.0 * CHANGE)
        self.usual = commands(SPEED)
        self.numbers = np.array([*self.plant.reals(NUMBERS), SPEED])

    def references(self, names: list[str]) -> tuple[object, object]:
        numbers = ATHENA.references(names)
        return (ctypes.c_uint * len(numbers))(*numbers), ctypes.c_size_t(len(numbers))

    def derivative(self, unknowns: tuple[object, object], size: int, seed: Array) -> Array:
        change, result = (ctypes.c_double * len(seed))(*seed), (ctypes.c_double * size)()
        assert self.plant.call(
            "fmi2GetDirectionalDerivative", *unknowns, *self.given, change, result
        ) == OK, self.plant.last_message  # fmt: skip
        return np.array(result)

    def matrix(self, faster: Array) -> Array:
        """Returns the matrix of changes of states and numbers, times the step."""
        n = len(STATES)
        seeds = np.zeros((n + 3, len(KNOWNS)))
        seeds[: n + 2, : n + 2] = np.eye(n + 2)
        seeds[n + 2, n + 2 :] = faster
        rows = [self.derivative(self.rates, n, seed) for seed in seeds]
        return self.h * np.vstack([np.array(rows).T, np.zeros((3, n + 3))])

    def cost(
        self, numbers: Array, *, gradient: bool = False
    ) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Returns the cost until each step, its gradient (steps, 3), and loaded feet (steps, 6)."""
        n, per = len(STATES), round(PERIOD / self.h)
        change = np.vstack([np.zeros((n, 3)), np.eye(3)])
        costs, slopes, loaded = [], [], []
        assert self.plant.call("fmi2SetFMUstate", self.stands) == OK
        assert self.plant.set_reals(dict(zip(NUMBERS, numbers[:2].tolist(), strict=True))) == OK
        for k in range(round(LENGTH / self.h)):
            faster = self.faster[k // per]
            given = self.usual[k // per] + (numbers[2] - SPEED) * faster
            assert self.plant.set_reals(dict(zip(COMMANDS, given.tolist(), strict=True))) == OK
            before = self.matrix(faster) if gradient else None
            assert self.plant.step(SETTLED * PERIOD + k * self.h, self.h) == OK
            shown = np.array(self.plant.reals(SHOWN))
            costs.append(self.h * WEIGHT @ shown**2)
            loaded.append(self.plant.reals([f"{leg}.foot.normal_force" for leg in LEGS]))
            if before is None:
                continue
            change = expm(0.5 * (before + self.matrix(faster))) @ change
            seeds = np.vstack([change[: n + 2], np.outer(faster, change[n + 2])])
            columns = [self.derivative(self.shown, len(SHOWN), seed) for seed in seeds.T]
            slopes.append(2.0 * self.h * (WEIGHT * shown) @ np.array(columns).T)
        return np.cumsum(costs), np.cumsum(slopes, axis=0), np.array(loaded) > 0.0


# lifted, touched: errors relative to the whole walk's derivative, before and after touch-downs. The
# chain has an error of order two in h, and derivatives hold the feet's speeds at touch-down.
@pytest.mark.parametrize(("h", "lifted", "touched"), [(0.001, 1e-3, 2e-2), (0.005, 1e-2, 5e-2)])
def test_the_gradient_of_a_walk_s_cost_is_that_of_whole_walks(
    plant_library: Path, h: float, lifted: float, touched: float
) -> None:
    walk = StandingRobot(plant_library, h)
    _, slope, loaded = walk.cost(walk.numbers, gradient=True)
    differences = np.empty_like(slope)
    for i, size in enumerate(1e-4 * walk.numbers):
        step = size * np.eye(3)[i]
        high, low = walk.cost(walk.numbers + step)[0], walk.cost(walk.numbers - step)[0]
        differences[:, i] = (high - low) / (2.0 * size)
    # all stand, one tripod is in the air, and all feet bear load again
    phases = [loaded[round(time / h) - 1].astype(int).tolist() for time in (0.05, 0.3, 0.5)]
    assert phases == [[1] * 6, [0, 1, 0, 1, 0, 1], [1] * 6]
    wrong = np.abs(slope - differences) / np.abs(differences)[-1]
    assert np.all(wrong[: round(0.4 / h)] < lifted)
    assert np.all(wrong < touched)
