"""Checks a design on the FMU: the response to a small squeeze against the linear prediction."""

from __future__ import annotations

from collections import deque
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from hexapod_cosim.controller import Gains, LegSolver
from hexapod_cosim.controller.comply.compliance import LARGEST_LOAD
from hexapod_cosim.controller.comply.slip_pid import squeeze
from hexapod_cosim.controller.design.closed import closed_loop, disturbed, rising, splay
from hexapod_cosim.controller.design.laws import Laws, delay_steps
from hexapod_cosim.controller.design.standing import Places, weight_share
from hexapod_cosim.controller.size import size_of
from hexapod_cosim.cosim.design.gain_design import STANCES, level_fmu
from hexapod_cosim.cosim.design.linearise import ANGLES, Bench, Motion, linearise
from hexapod_cosim.cosim.design.standing import StanceError, rest
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.models import Robot
from hexapod_cosim.models.records import Array

DURATION = 0.6  # s    for a robot of the usual size
SQUEEZE = 0.03  # 1    of a third of the weight


@dataclass(frozen=True, kw_only=True)
class DesignCheck:
    """The squeezing force that remains over time, relative to the initial one."""

    time: Array  # s    (steps,)
    predicted: Array  # 1    (steps,) by the linear closed loop
    simulated: Array  # 1    (steps,) by the FMU

    @property
    def error(self) -> float:
        """Largest difference over the largest predicted force [1]."""
        return float(np.abs(self.simulated - self.predicted).max() / np.abs(self.predicted).max())


class FeetLaws:
    """Both control laws of the standing feet, with present loads and angles and delayed forces."""

    def __init__(
        self, robot: Robot, laws: Laws, standing: Places, force: Array, factors: Array | float
    ) -> None:
        """standing: indices of the standing legs (n,); force: at rest (n, 3) [N]; factors: on the
        answers of the feet, (n,) or one for all.
        """
        self._factors = np.broadcast_to(factors, len(standing))[:, None]
        self._legs, self._kp = LegSolver(robot), robot.servo.kp
        self._share, self._standing = weight_share(robot), standing
        self._rest, (self._pid, self._spring) = force[:, 2], laws.systems
        self._forces = deque([force] * (laws.delays + 1), maxlen=laws.delays + 1)
        self._slip = np.zeros((self._pid.nstates, 2 * len(standing)))
        self._bounce = np.zeros((self._spring.nstates, len(standing)))

    def step(self, force: Array, angle: Array) -> Array:
        """Returns by how much the servos are relieved (n, 3) [N].

        force: (n, 3) [N] of the standing feet; angle: (6, 3) [rad] of the joints.
        """
        self._forces.append(force)
        late = self._forces[0]
        feet = self._legs.forward(angle)[self._standing]
        left = squeeze(late[:, 0] + 1j * late[:, 1], late[:, 2], feet[:, 0] + 1j * feet[:, 1])
        squeezed = np.column_stack([left.real, left.imag])
        pid, spring = self._pid, self._spring
        answer = pid.C @ self._slip + pid.D * squeezed.reshape(-1)
        self._slip = pid.A @ self._slip + pid.B * squeezed.reshape(-1)
        excess = late[:, 2] - self._rest
        lift = spring.C @ self._bounce + spring.D * excess
        self._bounce = spring.A @ self._bounce + spring.B * excess
        load = np.minimum(force[:, 2] / self._share, LARGEST_LOAD)
        vertical = (self.jacobian(angle)[:, 2] ** 2).sum(axis=1) / self._kp
        yielded = np.column_stack([load[:, None] * answer.reshape(-1, 2), lift[0] / vertical])
        return np.asarray(self._factors * yielded)

    def jacobian(self, angle: Array) -> Array:
        """Returns the Jacobians of the standing legs (n, 3, 3)."""
        return np.asarray(self._legs.jacobian(angle)[self._standing])

    def shift(self, relief: Array, angle: Array) -> Array:
        """Returns the shift of the joint commands (6, 3) [rad] for a relief (n, 3) [N]."""
        shift = np.zeros_like(angle)
        shift[self._standing] = np.einsum("lji,lj->li", self.jacobian(angle), relief) / self._kp
        return shift


def check_design(
    robot: Robot,
    gains: Gains,
    *,
    stance: str | None = None,
    squeeze: float | None = None,
    factors: Array | float = 1.0,
) -> DesignCheck:
    """Simulates how both control laws remove a squeeze, in the FMU and in the linear closed loop.

    A force makes the standing legs splay. stance: by default the first in which the robot stands;
    squeeze [N]: by default SQUEEZE times a third of the weight; factors: on the answers of the
    standing feet in the FMU, which the prediction does not have.
    """
    period = gains.period
    laws = Laws(
        slip=gains.slip,
        suspension=gains.suspension,
        period=period,
        delays=delay_steps(gains.requirements, period=period),
    )
    force = SQUEEZE * weight_share(robot) if squeeze is None else squeeze
    friction = robot.servo.coulomb_friction
    with level_fmu(robot) as fmu:
        motion, inputs = _rest(fmu, robot, stance)
        plant = linearise(fmu, robot, motion, inputs, period=period, coulomb_friction=friction)
        push, places = splay(robot, plant), np.flatnonzero(plant.standing)
        time, forces = disturbed(
            closed_loop(robot, plant, laws), push, duration=DURATION * size_of(robot).time
        )
        bench = Bench(
            fmu, robot, coulomb_friction=friction, slope=robot.friction.slope, period=period
        )
        bench.start(motion, inputs)
        feet = FeetLaws(robot, laws, places, plant.force[places], factors)
        disturbance = np.outer(force * rising(time), push).reshape(len(time), -1, 3)
        simulated = _run(bench, feet, inputs, disturbance, places)
    seen = (simulated - simulated[0]).reshape(len(time), -1) @ push / -force
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
        shift = feet.shift(feet.step(force, angle) + extra, angle)
        commanded[:ANGLES] = inputs[:ANGLES] + shift.reshape(-1)
        bench.set_inputs(commanded)
        bench.step(k)
    return np.array(found)
