"""The plant FMU itself, linearised about the standing robot by central differences.

    x(k+1) = A x(k) + B u(k)        y(k) = C x(k)

x: torso's position and small rotation, joint angles, and the velocities of all these. One period of the FMU from x with the inputs u
held is the exact sampled system, so nothing is approximated but the differences. Each column takes two fresh starts from the `initial`
parameters, one on either side; those of angle_ref and speed_ref are kp and kd times torque_ref's, by eq. 13.

Sizes of the differences. They must be small against what bends: the foot's depth in the ground (0.1 mm and more), the slip speed at which
friction saturates (10 mm/s), the joint speed at which the gear's friction does (50 mrad/s); and large against the round-off of a start,
1e-15 m in a contact of 5e4 N/m.

Left out are the servos' torque limits, which no small motion sees but a heavy load does, and the error control, whose choice of steps
would be noise: steps are fixed, and short against the times in which a foot swings on the ground.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import control
import numpy as np

from hexapod_cosim.controller import LegSolver
from hexapod_cosim.controller.design.standing import StandingPlant, weight_share
from hexapod_cosim.cosim.fmu import Fmu
from hexapod_cosim.cosim.signals import COMMANDED, JOINTS, LEGS, MEASURED, PUSH, vector_names
from hexapod_cosim.models import LEG_NAMES, FmuError, Robot
from hexapod_cosim.models.dynamics import masses
from hexapod_cosim.models.kinematics import body_states, quaternion_product
from hexapod_cosim.models.records import Array

ANGLES = LEGS * JOINTS
POSES = 6 + ANGLES  # of torso and joints; the states are these and their velocities
STATES = 2 * POSES
SIZES = np.repeat([1e-6, 1e-5], POSES)  # m and rad, m/s and rad/s    of the differences
TORQUE = 1e-4  # N m    the same
LONGEST_STEP = 5e-4  # s    of the integration
LIFT = 0.04  # m    of the feet that do not stand
SETTLING, SETTLING_STEP = 2.0, 0.05  # s
SETTLING_SLOPE = 0.1  # 1    of the friction's: the pose of rest is the same, and feet get there as much faster
REST = 1e-3  # m/s or rad/s
UNLIMITED = 1e3  # N m
LATEST = 60.0  # s    no start is stepped beyond it
TORSO = [f"torso.{name}[{k}]" for name in ("position", "rotation") for k in (1, 2, 3)]
TORSO_RATES = [*vector_names("torso.velocity"), *MEASURED["angular_velocity"]]
STATE_NAMES = [*TORSO, *MEASURED["angle"], *TORSO_RATES, *MEASURED["speed"]]
INPUT_NAMES = [name for names in COMMANDED.values() for name in names]
OUTPUT_NAMES = [*MEASURED["foot_force"], *MEASURED["angle"], *TORSO, *TORSO_RATES]


@dataclass(frozen=True, kw_only=True)
class Motion:
    """Where the torso and the joints are and how they move: what an FMU starts from."""

    values: Array  # (49,) position, quaternion, angles, velocity, angular velocity, joint speeds

    @property
    def angle(self) -> Array:
        """rad    (6, 3)"""
        return self.values[7 : 7 + ANGLES].reshape(LEGS, JOINTS)

    def moved(self, state: Array) -> Motion:
        """The same after small changes (48,)."""
        new = self.values.copy()
        new[:3] += state[:3]
        new[3:7] = quaternion_product(np.array([1.0, *(0.5 * state[3:6])]), self.values[3:7])
        new[7:] += state[6:]
        return Motion(values=new)

    def less(self, other: Motion) -> Array:
        """(48,) small changes that lead here from another."""
        w, x, y, z = other.values[3:7]
        turn = quaternion_product(self.values[3:7], np.array([w, -x, -y, -z]))
        return np.concatenate([self.values[:3] - other.values[:3], 2.0 * turn[1:] / turn[0], self.values[7:] - other.values[7:]])


class Bench:
    """An FMU that is started over and over again. Inputs (60,): angle_ref, speed_ref, torque_ref of all joints, push force and torque."""

    def __init__(self, plant: Fmu, *, coulomb_friction: float, slope: float, period: float) -> None:
        """coulomb_friction: of the gears [N m]; slope: of the feet's friction [s/m]; period [s]."""
        self.plant, self.period = plant, period
        step = period / math.ceil(period / LONGEST_STEP - 1e-9)
        self._settings = plant.block(["servo.coulomb_friction", "servo.torque_max", "friction.slope", "solver.step"])
        self._settings.values[:] = coulomb_friction, UNLIMITED, slope, step
        pose, rates = [*vector_names("torso.position"), *MEASURED["quaternion"], *MEASURED["angle"]], [*TORSO_RATES, *MEASURED["speed"]]
        seen = [*pose, *rates]
        self._seen = plant.block(seen)
        self._initial = plant.block([f"initial.{name.removeprefix('torso.')}" for name in seen])
        self._inputs = plant.block([*INPUT_NAMES, *PUSH])
        self._forces = plant.block(MEASURED["foot_force"])

    def start(self, motion: Motion, inputs: Array) -> None:
        """Ready to step at time 0."""
        self.plant.reset()
        self._settings.set()
        self._initial.values[:] = motion.values
        self._initial.set()
        self.plant.initialise(0.0, LATEST)
        self.tell(inputs)

    def tell(self, inputs: Array) -> None:
        """Sets the inputs (60,)."""
        self._inputs.values[:] = inputs
        self._inputs.set()

    def step(self, k: int = 0) -> None:
        """The period after k of them."""
        self.plant.step(k * self.period, self.period)

    def motion(self) -> Motion:
        """How the FMU moves now."""
        self._seen.get()
        return Motion(values=self._seen.values.copy())

    def force(self) -> Array:
        """N    (18,) ground on feet now"""
        self._forces.get()
        return np.array(self._forces.values)

    def settle(self, motion: Motion, inputs: Array) -> Motion:
        """Where it comes to rest. Raises FmuError when it does not."""
        self.start(motion, inputs)
        for k in range(round(SETTLING / SETTLING_STEP)):
            self.plant.step(k * SETTLING_STEP, SETTLING_STEP)
        way = self.motion().less(motion)
        speed = float(np.abs(way[POSES:]).max())
        if not speed < REST:
            raise FmuError(
                "the robot does not come to rest", got=f"{speed:.3g} m/s or rad/s", expected=f"less than {REST:g}",
                fix="give it servos that carry it", where=self.plant.path.name,
            )  # fmt: skip
        way[POSES:] = 0.0
        return motion.moved(way)

    def differences(self, motion: Motion, inputs: Array, *, scale: float = 1.0) -> tuple[Array, Array, Array]:
        """A (48, 48), B (48, 18) of the joints' torques and C (18, 48) of the feet's forces about a motion; scale: of the differences."""
        a, b, c = np.zeros((STATES, STATES)), np.zeros((STATES, ANGLES)), np.zeros((ANGLES, STATES))
        for k, change in enumerate(scale * np.diag(SIZES)):
            ahead, behind = (self._step_from(motion.moved(way), inputs) for way in (change, -change))
            c[:, k], a[:, k] = (ahead[0] - behind[0]) / (2.0 * change[k]), ahead[1].less(behind[1]) / (2.0 * change[k])
        for k, change in enumerate(scale * TORQUE * np.eye(len(inputs))[2 * ANGLES : 3 * ANGLES]):
            ahead, behind = (self._step_from(motion, inputs + way) for way in (change, -change))
            b[:, k] = ahead[1].less(behind[1]) / (2.0 * scale * TORQUE)
        return a, b, c

    def _step_from(self, motion: Motion, inputs: Array) -> tuple[Array, Motion]:
        self.start(motion, inputs)
        force = self.force()
        self.step()
        return force, self.motion()


def rest(plant: Fmu, robot: Robot, *, standing: Sequence[str], load: float) -> tuple[Motion, Array]:
    """How the robot stands on the named legs, and the inputs (60,) under which it does.

    load: mean of the standing legs', in thirds of the weight; the torso is pushed down or up to have it. The servos are told the torques
    that carry it. Raises FmuError when it does not come to rest.
    """
    angle, total = lifted_stance(robot, standing), load * len(standing) * weight_share(robot)
    share, feet = shares(robot, angle, standing, total), LegSolver(robot).forward(angle) - np.array(robot.torso.com)
    push = robot.weight - total
    inputs = np.zeros(3 * ANGLES + len(PUSH))
    inputs[:ANGLES] = angle.reshape(-1)
    inputs[2 * ANGLES : 3 * ANGLES] = -(LegSolver(robot).jacobian(angle)[:, 2] * share[:, None]).reshape(-1)
    inputs[3 * ANGLES + 2] = push
    depth = (share.max() / robot.contact.stiffness) ** (2.0 / 3.0)
    start = np.zeros(1 + STATES)
    start[2], start[3], start[7 : 7 + ANGLES] = robot.foot.radius - depth - feet[:, 2].min(), 1.0, angle.reshape(-1)
    bench = Bench(plant, coulomb_friction=0.0, slope=SETTLING_SLOPE * robot.friction.slope, period=SETTLING_STEP)
    settled = bench.settle(Motion(values=start), inputs)
    stands = [leg for leg, force in zip(LEG_NAMES, bench.force()[2::3], strict=True) if force > 0.0]
    if stands != [leg for leg in LEG_NAMES if leg in standing]:
        fix = "choose legs with the centre of mass between them"
        raise FmuError("the robot does not stay on its legs", got=" ".join(stands), expected=" ".join(standing), fix=fix)
    return settled, inputs


def lifted_stance(robot: Robot, standing: Sequence[str]) -> Array:
    """(6, 3) joint angles [rad] of the stance, the feet of the other legs lifted."""
    legs = LegSolver(robot)
    feet = legs.forward(robot.stance)
    feet[[leg not in standing for leg in LEG_NAMES], 2] += LIFT
    return legs.inverse(feet)


def shares(robot: Robot, angle: Array, standing: Sequence[str], total: float) -> Array:
    """N    (6,) least vertical forces that add up to `total` and hold the torso level, pushed at its centre of mass."""
    level, still = np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3)
    body = body_states(robot, still, level, still, still, angle, np.zeros((LEGS, JOINTS)))
    moment = masses(robot) @ body[:, :2] * float(np.linalg.norm(robot.gravity))
    feet = LegSolver(robot).forward(angle) - np.array(robot.torso.com)
    rows = np.array([np.ones(LEGS), feet[:, 0], feet[:, 1]]) * [leg in standing for leg in LEG_NAMES]
    return np.asarray(np.linalg.pinv(rows) @ [total, *moment])


def linearise(
    plant: Fmu, robot: Robot, motion: Motion, inputs: Array, *, period: float, coulomb_friction: float, scale: float = 1.0
) -> StandingPlant:
    """The FMU of a robot about a motion at rest, sampled with a period [s] over which the inputs are held.

    coulomb_friction: of the gears [N m]; scale: of the differences.
    """
    bench = Bench(plant, coulomb_friction=coulomb_friction, slope=robot.friction.slope, period=period)
    a, b, c = bench.differences(motion, inputs, scale=scale)
    bench.start(motion, inputs)
    force = bench.force().reshape(LEGS, 3)
    shown = np.eye(STATES)[[*range(6, POSES), *range(6), *range(POSES, POSES + 6)]]
    system = control.ss(
        a, np.hstack([robot.servo.kp * b, robot.servo.kd * b, b]), np.vstack([c, shown]), 0, period,
        states=_plain(STATE_NAMES), inputs=_plain(INPUT_NAMES), outputs=_plain(OUTPUT_NAMES),
    )  # fmt: skip
    torque = inputs[2 * ANGLES : 3 * ANGLES].reshape(LEGS, JOINTS)
    return StandingPlant(system=system, angle=motion.angle.copy(), force=force, torque=torque, standing=force[:, 2] > 0.0)


def _plain(names: Sequence[str]) -> list[str]:
    # python-control takes no dots
    return [name.replace(".", "_") for name in names]
