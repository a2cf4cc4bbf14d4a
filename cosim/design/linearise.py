"""Linearises the plant FMU about the standing robot by central differences.

    x(k+1) = A x(k) + B u(k)        y(k) = C x(k)

x: torso's position and small rotation, joint angles, and the velocities of all these. One period of
the FMU from x with the inputs u held is the exact sampled system, so that only the differences are
approximate. Each column takes two starts from the `initial` parameters, one on either side; the
columns of angle_ref and speed_ref are kp and kd times those of torque_ref, by eq. 12.

The differences must be small against the scales of the non-linearities: the foot's depth in the
ground (0.1 mm and more), the slip speed at which friction saturates (10 mm/s), the joint speed at
which the gear's friction saturates (50 mrad/s); and large against the round-off of a start, 1e-15 m
in a contact of 5e4 N/m.

Two things are left out: the servos' torque limits, which small motions do not reach but a heavy
load does, and the error control, whose choice of steps would be noise. Steps are fixed, and short
against the times in which a foot swings on the ground.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import control
import numpy as np

from hexapod_cosim.controller.design.paper import StandingPlant
from hexapod_cosim.controller.size import Size, size_of
from hexapod_cosim.cosim.interface.names import JOINTS, LEGS, vector_names
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.master.sensors import MEASURED
from hexapod_cosim.cosim.master.signals import COMMANDED, PUSH
from hexapod_cosim.models import Robot
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.kinematics import quaternion_product

ANGLES = LEGS * JOINTS
POSES = 6 + ANGLES  # of torso and joints; the states are these and their velocities
STATES = 2 * POSES
CHANGE, RATE = 1e-6, 1e-5  # m and rad, m/s and rad/s    differences, for the usual size of robot
# fields of the servo besides coulomb_friction that are dry friction
DRY = (
    "stribeck_friction",
    "motor_load_friction",
    "external_load_friction",
    "stribeck_motor_load_friction",
    "stribeck_external_load_friction",
    "quadratic_motor_friction",
    "quadratic_external_friction",
)
TORQUE = 1e-4  # N m    difference, for servos of STIFFNESS; scales with the stiffness
STIFFNESS = 40.0  # N m/rad
LONGEST_STEP = 5e-4  # s    of the integration, for the usual size of robot
UNLIMITED = 1e6  # N m
LATEST = 600.0  # s    end of the longest simulation
TORSO = [f"torso.{name}[{k}]" for name in ("position", "rotation") for k in (1, 2, 3)]
TORSO_RATES = [*vector_names("torso.velocity"), *MEASURED["angular_velocity"]]
STATE_NAMES = [*TORSO, *MEASURED["angle"], *TORSO_RATES, *MEASURED["speed"]]
INPUT_NAMES = [name for names in COMMANDED.values() for name in names]
OUTPUT_NAMES = [*MEASURED["foot_force"], *MEASURED["angle"], *TORSO, *TORSO_RATES]


@dataclass(frozen=True, kw_only=True)
class Motion:
    """Position and velocity of torso and joints, from which an FMU starts."""

    values: Array  # (49,) position, quaternion, angles, velocity, angular velocity, joint speeds

    @property
    def angle(self) -> Array:
        """Joint angles (6, 3) [rad]."""
        return self.values[7 : 7 + ANGLES].reshape(LEGS, JOINTS)

    def moved(self, state: Array) -> Motion:
        """Returns the motion after small changes (48,)."""
        new = self.values.copy()
        new[:3] += state[:3]
        q_WV, q_VT = np.array([1.0, *(0.5 * state[3:6])]), self.values[3:7]
        new[3:7] = quaternion_product(q_WV, q_VT)
        new[7:] += state[6:]
        return Motion(values=new)

    def less(self, other: Motion) -> Array:
        """Returns the small changes (48,) that lead from another motion to this one."""
        q_WT, q_TV = self.values[3:7], other.values[3:7] * np.array([1.0, -1.0, -1.0, -1.0])
        q_WV = quaternion_product(q_WT, q_TV)
        return np.concatenate(
            [
                self.values[:3] - other.values[:3],
                2.0 * q_WV[1:] / q_WV[0],
                self.values[7:] - other.values[7:],
            ]
        )


class Bench:
    """Starts one FMU again and again.

    Inputs are (60,): angle_ref, speed_ref and torque_ref of all joints, push force and torque.
    """

    def __init__(
        self, plant: Fmu, robot: Robot, *, coulomb_friction: float, slope: float, period: float
    ) -> None:
        """robot: the FMU's; coulomb_friction [N m]: of the gears, 0 leaves out all their dry
        friction; slope [s/m]: of the feet's friction; period [s].
        """
        size = size_of(robot)
        self.plant, self.period = plant, period
        self._sizes, self._torque = difference_sizes(size), TORQUE * (robot.servo.kp / STIFFNESS)
        step = period / math.ceil(period / (LONGEST_STEP * size.time) - 1e-9)
        plain = ["servo.coulomb_friction", "servo.torque_max", "friction.slope", "solver.step"]
        servo = [f"servo.{name}" for name in DRY]
        self._settings = plant.block([*plain, *servo])
        dry = [getattr(robot.servo, name) if coulomb_friction > 0.0 else 0.0 for name in DRY]
        self._settings.values[:] = coulomb_friction, UNLIMITED, slope, step, *dry
        seen = [
            *vector_names("torso.position"), *MEASURED["quaternion"], *MEASURED["angle"],
            *TORSO_RATES, *MEASURED["speed"],
        ]  # fmt: skip
        self._seen = plant.block(seen)
        self._initial = plant.block([f"initial.{name.removeprefix('torso.')}" for name in seen])
        self._inputs = plant.block([*INPUT_NAMES, *PUSH])
        self._forces = plant.block(MEASURED["foot_force"])

    def start(self, motion: Motion, inputs: Array) -> None:
        """Starts the FMU at time 0 from a motion, with inputs (60,)."""
        self.plant.reset()
        self._settings.set()
        self._initial.values[:] = motion.values
        self._initial.set()
        self.plant.initialise(0.0, LATEST)
        self.set_inputs(inputs)

    def set_inputs(self, inputs: Array) -> None:
        """Sets the inputs (60,)."""
        self._inputs.values[:] = inputs
        self._inputs.set()

    def step(self, k: int = 0) -> None:
        """Steps over period number k."""
        self.plant.step(k * self.period, self.period)

    def motion(self) -> Motion:
        """Returns the present motion."""
        self._seen.get()
        return Motion(values=self._seen.values.copy())

    def force(self) -> Array:
        """Returns the present forces of the ground on the feet (18,) [N]."""
        self._forces.get()
        return np.array(self._forces.values)

    def differences(
        self, motion: Motion, inputs: Array, *, scale: float = 1.0
    ) -> tuple[Array, Array, Array]:
        """Returns A (48, 48), B (48, 18) of the joint torques and C (18, 48) of the foot forces.

        scale: factor on all differences.
        """
        a, b, c = np.zeros((STATES, STATES)), np.zeros((STATES, ANGLES)), np.zeros((ANGLES, STATES))
        for k, change in enumerate(scale * np.diag(self._sizes)):
            ahead, behind = (
                self._step_from(motion.moved(way), inputs) for way in (change, -change)
            )
            c[:, k] = (ahead[0] - behind[0]) / (2.0 * change[k])
            a[:, k] = ahead[1].less(behind[1]) / (2.0 * change[k])
        torques = np.eye(len(inputs))[2 * ANGLES : 3 * ANGLES]
        for k, change in enumerate(scale * self._torque * torques):
            ahead, behind = (self._step_from(motion, inputs + way) for way in (change, -change))
            b[:, k] = ahead[1].less(behind[1]) / (2.0 * scale * self._torque)
        return a, b, c

    def _step_from(self, motion: Motion, inputs: Array) -> tuple[Array, Motion]:
        """Returns the foot forces at a motion and the motion one period later."""
        self.start(motion, inputs)
        force = self.force()
        self.step()
        return force, self.motion()


def difference_sizes(size: Size) -> Array:
    """Returns the differences of the states (48,), for a robot's size."""
    sizes = np.repeat([CHANGE, RATE], POSES)
    sizes[:3] *= size.length
    sizes[POSES : POSES + 3] *= size.speed
    sizes[POSES + 3 :] /= size.time
    return sizes


def linearise(
    plant: Fmu,
    robot: Robot,
    motion: Motion,
    inputs: Array,
    *,
    period: float,
    coulomb_friction: float,
    scale: float = 1.0,
) -> StandingPlant:
    """Linearises a robot's FMU about a motion at rest, sampled with a period [s].

    The inputs are held over a period. coulomb_friction [N m]: of the gears; scale: factor on all
    differences.
    """
    bench = Bench(
        plant, robot, coulomb_friction=coulomb_friction, slope=robot.friction.slope, period=period
    )
    a, b, c = bench.differences(motion, inputs, scale=scale)
    bench.start(motion, inputs)
    force = bench.force().reshape(LEGS, 3)
    shown = np.eye(STATES)[[*range(6, POSES), *range(6), *range(POSES, POSES + 6)]]
    system = control.ss(
        a, np.hstack([robot.servo.kp * b, robot.servo.kd * b, b]), np.vstack([c, shown]), 0, period,
        states=_plain(STATE_NAMES), inputs=_plain(INPUT_NAMES), outputs=_plain(OUTPUT_NAMES),
    )  # fmt: skip
    torque = inputs[2 * ANGLES : 3 * ANGLES].reshape(LEGS, JOINTS)
    return StandingPlant(
        system=system,
        angle=motion.angle.copy(),
        force=force,
        torque=torque,
        standing=force[:, 2] > 0.0,
    )


def _plain(names: Sequence[str]) -> list[str]:
    """Returns names without dots, which python-control does not accept."""
    return [name.replace(".", "_") for name in names]
