"""Checks a design on the FMU: the response to a small spread against the linear prediction."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from hexapod_cosim.controller import Gains, LegSolver
from hexapod_cosim.controller.design.closed import disturbed, rising, splay
from hexapod_cosim.controller.design.paper import closed_loop, delay_steps, law_matrix
from hexapod_cosim.controller.design.standing import StandingPlant
from hexapod_cosim.controller.size import size_of
from hexapod_cosim.cosim.design.gains import STANCES, level_fmu
from hexapod_cosim.cosim.design.linearise import ANGLES, Bench, linearise
from hexapod_cosim.cosim.design.standing import rest
from hexapod_cosim.models import Robot
from hexapod_cosim.models.records import Array

DURATION = 0.6  # s    for a robot of the usual size
SPREAD = 1e-4  # m    shift of the feet, which friction answers linearly


@dataclass(frozen=True, kw_only=True)
class DesignCheck:
    """The squeezing force over time, per metre by which the feet are shifted."""

    time: Array  # s    (steps,)
    predicted: Array  # N/m    (steps,) by the linear closed loop
    simulated: Array  # N/m    (steps,) by the FMU

    @property
    def error(self) -> float:
        """Largest difference over the largest predicted force [1]."""
        return float(np.abs(self.simulated - self.predicted).max() / np.abs(self.predicted).max())


class FeetLaw:
    """The paper's law for the standing feet: a smoothed, delayed matrix of their softness."""

    def __init__(self, robot: Robot, plant: StandingPlant, gains: Gains) -> None:
        self._legs, self.standing = LegSolver(robot), plant.standing
        self._matrix = law_matrix(robot, plant, gains.paper)
        self._kept = math.exp(-gains.period / gains.paper.filter_time)
        self._rest = plant.force[plant.standing].reshape(-1)
        self._smooth = np.zeros_like(self._rest)
        length = delay_steps(gains.requirements, period=gains.period) + 1
        self._excess = deque([self._smooth] * length, maxlen=length)

    def step(self, force: Array) -> Array:
        """Returns by how much the feet are shifted (3 n) [m] for forces (3 n) [N] on them."""
        self._excess.append(force - self._rest)
        self._smooth = self._kept * self._smooth + (1.0 - self._kept) * self._excess[0]
        return self._matrix @ self._smooth

    def bend(self, shift: Array, angle: Array) -> Array:
        """Returns the changes of the joint commands (6, 3) [rad] for shifts (3 n) [m]."""
        bend = np.zeros_like(angle)
        jacobian = self._legs.jacobian(angle)[self.standing]
        bend[self.standing] = np.linalg.solve(jacobian, shift.reshape(-1, 3, 1))[:, :, 0]
        return bend


def check_design(
    robot: Robot,
    gains: Gains,
    *,
    stance: str = "six legs",
    load: float = 1.0,
    gears_stick: bool = True,
    push: Array | None = None,
    spread: float = SPREAD,
) -> DesignCheck:
    """Simulates how the law of the paper's control answers to feet that are shifted.

    It runs on the FMU and in the linear closed loop. load: mean of the standing legs, in thirds of
    the weight; gears_stick: with the dry friction of the gears; push: shifts (3 n) of the standing
    feet of unit length, by default those that spread them; spread: their size [m].
    """
    period, friction = gains.period, robot.servo.coulomb_friction if gears_stick else 0.0
    with level_fmu(robot) as fmu:
        motion, inputs = rest(fmu, robot, standing=STANCES[stance], load=load)
        plant = linearise(fmu, robot, motion, inputs, period=period, coulomb_friction=friction)
        push = splay(robot, plant) if push is None else push
        delays = delay_steps(gains.requirements, period=period)
        time, forces = disturbed(
            closed_loop(robot, plant, gains.paper, delays=delays),
            push,
            duration=DURATION * size_of(robot).time,
        )
        bench = Bench(
            fmu, robot, coulomb_friction=friction, slope=robot.friction.slope, period=period
        )
        bench.start(motion, inputs)
        disturbance = np.outer(spread * rising(time), push)
        simulated = _run(bench, FeetLaw(robot, plant, gains), inputs, disturbance)
    seen = (simulated - simulated[0]) @ push / -spread
    return DesignCheck(time=time, predicted=-push @ forces, simulated=seen)


def _run(bench: Bench, law: FeetLaw, inputs: Array, disturbance: Array) -> Array:
    """Returns the forces on the standing feet in the closed loop (steps, 3 n) [N]."""
    commanded, found = inputs.copy(), []
    for k, extra in enumerate(disturbance):
        angle = bench.motion().angle
        force = bench.force().reshape(6, 3)[law.standing].reshape(-1)
        found.append(force)
        bend = law.bend(law.step(force) + extra, angle)
        commanded[:ANGLES] = inputs[:ANGLES] + bend.reshape(-1)
        bench.set_inputs(commanded)
        bench.step(k)
    return np.array(found)
