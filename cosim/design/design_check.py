"""Checks a design on the FMU: the response to a small spread against the linear prediction."""

from __future__ import annotations

from collections import deque
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from hexapod_cosim.controller import Gains, LegSolver
from hexapod_cosim.controller.design.closed import disturbed, rising, splay
from hexapod_cosim.controller.design.laws import Laws, delay_steps
from hexapod_cosim.controller.design.paper import paper_loop
from hexapod_cosim.controller.design.standing import Places
from hexapod_cosim.controller.size import size_of
from hexapod_cosim.cosim.design.design import STANCES, level_fmu
from hexapod_cosim.cosim.design.linearise import ANGLES, Bench, Motion, linearise
from hexapod_cosim.cosim.design.standing import StanceError, rest
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.models import Robot
from hexapod_cosim.models.records import Array

DURATION = 0.6  # s    for a robot of the usual size
SPREAD = 1e-4  # m    shift of the feet, which friction answers linearly


@dataclass(frozen=True, kw_only=True)
class DesignCheck:
    """The squeezing force over time, per metre by which the feet are spread."""

    time: Array  # s    (steps,)
    predicted: Array  # N/m    (steps,) by the linear closed loop
    simulated: Array  # N/m    (steps,) by the FMU

    @property
    def error(self) -> float:
        """Largest difference over the largest predicted force [1]."""
        return float(np.abs(self.simulated - self.predicted).max() / np.abs(self.predicted).max())


class FeetLaws:
    """Both laws of the paper's control for the standing feet, with delayed forces."""

    def __init__(self, robot: Robot, laws: Laws, standing: Places, force: Array) -> None:
        """standing: indices of the standing legs (n,); force: at rest (n, 3) [N]."""
        self._legs, self._standing, self._rest = LegSolver(robot), standing, force
        self._pid, self._spring = laws.systems
        self._forces = deque([force] * (laws.delays + 1), maxlen=laws.delays + 1)
        self._slip = np.zeros((self._pid.nstates, 2 * len(standing)))
        self._bounce = np.zeros((self._spring.nstates, len(standing)))

    def step(self, force: Array) -> Array:
        """Returns by how much the feet are shifted (n, 3) [m] for forces (n, 3) [N] on them."""
        self._forces.append(force)
        excess, pid, spring = self._forces[0] - self._rest, self._pid, self._spring
        flat, up = excess[:, :2].reshape(-1), excess[:, 2]
        shift = pid.C @ self._slip + pid.D * flat
        self._slip = pid.A @ self._slip + pid.B * flat
        lift = spring.C @ self._bounce + spring.D * up
        self._bounce = spring.A @ self._bounce + spring.B * up
        return np.column_stack([shift.reshape(-1, 2), lift[0]])

    def bend(self, shift: Array, angle: Array) -> Array:
        """Returns the changes of the joint commands (6, 3) [rad] for shifts (n, 3) [m]."""
        bend = np.zeros_like(angle)
        jacobian = self._legs.jacobian(angle)[self._standing]
        bend[self._standing] = np.linalg.solve(jacobian, shift[:, :, None])[:, :, 0]
        return bend


def check_design(
    robot: Robot, gains: Gains, *, stance: str | None = None, spread: float = SPREAD
) -> DesignCheck:
    """Simulates how the laws of the paper's control answer to feet that are spread.

    They run in the FMU and in the linear closed loop. stance: by default the first in which the
    robot stands; spread: of the feet [m].
    """
    period = gains.period
    laws = Laws(
        slip=gains.paper_slip,
        suspension=gains.paper_suspension,
        period=period,
        delays=delay_steps(gains.requirements, period=period),
    )
    friction = robot.servo.coulomb_friction
    with level_fmu(robot) as fmu:
        motion, inputs = _rest(fmu, robot, stance)
        plant = linearise(fmu, robot, motion, inputs, period=period, coulomb_friction=friction)
        push, places = splay(robot, plant), np.flatnonzero(plant.standing)
        time, forces = disturbed(
            paper_loop(robot, plant, laws), push, duration=DURATION * size_of(robot).time
        )
        bench = Bench(
            fmu, robot, coulomb_friction=friction, slope=robot.friction.slope, period=period
        )
        bench.start(motion, inputs)
        feet = FeetLaws(robot, laws, places, plant.force[places])
        disturbance = np.outer(spread * rising(time), push).reshape(len(time), -1, 3)
        simulated = _run(bench, feet, inputs, disturbance, places)
    seen = (simulated - simulated[0]).reshape(len(time), -1) @ push / -spread
    return DesignCheck(time=time, predicted=-push @ forces, simulated=seen)


def _rest(fmu: Fmu, robot: Robot, stance: str | None) -> tuple[Motion, Array]:
    """Returns the robot at rest in a stance, or in the first possible one. Raises StanceError."""
    *others, last = STANCES if stance is None else [stance]
    for name in others:
        with suppress(StanceError):
            return rest(fmu, robot, standing=STANCES[name], load=1.0)
    return rest(fmu, robot, standing=STANCES[last], load=1.0)


def _run(bench: Bench, feet: FeetLaws, inputs: Array, disturbance: Array, places: Places) -> Array:
    """Returns the forces on the standing feet in the closed loop (steps, n, 3) [N]."""
    commanded, found = inputs.copy(), []
    for k, extra in enumerate(disturbance):
        force, angle = bench.force().reshape(6, 3)[places], bench.motion().angle
        found.append(force)
        bend = feet.bend(feet.step(force) + extra, angle)
        commanded[:ANGLES] = inputs[:ANGLES] + bend.reshape(-1)
        bench.set_inputs(commanded)
        bench.step(k)
    return np.array(found)
