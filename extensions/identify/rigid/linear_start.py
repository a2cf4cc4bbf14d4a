"""Finds a start of the output error by linear least squares, without simulations.

The servos' law is linear in kp and kd, and the inverse dynamics in the inertial parameters, in the
rotors' inertia and in the dry friction of the gears. Equations are filtered alike on both sides,
which keeps them true, and weighted with the noise that they leave; large residuals, as at
touch-downs, count less (Huber). Masses and centres of mass are then those of possible bodies that
fit the equations best: the search is over the numbers of the table of unknowns, whose bodies have
pseudo-inertias that are positive definite for all values, and what the robot file says counts as an
equation with the table's deviation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.extensions.identify.experiment import Experiment
from hexapod_cosim.extensions.identify.log import Log
from hexapod_cosim.extensions.identify.numbers.unknown import Unknown
from hexapod_cosim.extensions.identify.rigid.base_parameters import (
    BaseEstimate,
    base_of,
    group_parameters,
    least_squares_base,
)
from hexapod_cosim.extensions.identify.rigid.regressor import (
    EQUATIONS,
    GROUPS,
    PARAMETERS,
    body_wrenches,
    foot_equations,
    frames,
    regressor,
)
from hexapod_cosim.extensions.identify.rigid.samples import Samples, lacking, samples_of
from hexapod_cosim.extensions.identify.unknowns import CURRENT, DELAYS, value_before
from hexapod_cosim.models import Robot
from hexapod_cosim.models.ground.faces import ground_normal
from hexapod_cosim.models.servos.motor import (
    back_emf_damping,
    friction_torque,
    has_measured_friction,
)

Array = NDArray[np.float64]
LONGEST_SHIFT = 10  # rows between a command and the reading that it causes
SATURATED = 0.8  # of torque_max: the law of a servo is not linear beyond
CUT_OFF = 10.0  # Hz    of the equations
LEAST_CONTACT = 1.0  # N    a foot with less has no force along the ground
OPEN_ENDS = 0.05  # s    at both ends of a log whose equations are not used
# Differences at touch-downs have errors that are no noise, so that equations tell less.
DOUBT = 5.0  # factor of their deviation
ROUNDS = 4  # of weighting
HUBER = 2.0  # deviations
KINDS = (0, 0, 0, 1, 1, 1, *(2, 3, 4) * 6)  # equations with one noise each
CONSTANTS = (CURRENT, "servo.torque_constant")  # of currents: without and with a motor's model
INERTIAL = GROUPS * PARAMETERS
SERVO = ("servo.kp", "servo.kd")
OTHERS = ("servo.rotor_inertia", "servo.coulomb_friction")  # columns behind the inertial ones
# A command that is held over a row makes the torque a saw-tooth, of which a reading is not the
# mean: it differs by a multiple of the speed. This column takes it up, with viscous friction.
VISCOUS = len(OTHERS)  # its place behind the inertial ones


@dataclass(frozen=True)
class LinearStart:
    """What linear least squares tell of a robot."""

    values: dict[str, float]  # by key of the table of unknowns
    base: BaseEstimate

    def z(self, rows: Sequence[Unknown], robot: Robot) -> Array:
        """Returns the distances of the values from the robot file's, in priors (rows,)."""
        found = []
        for row in rows:
            before = value_before(row, robot)
            found.append(row.distance(self.values.get(row.key, before), before))
        return np.array(found)


@dataclass(frozen=True)
class Equations:
    """Linear equations of the robot's numbers, in units of their noise."""

    matrix: Array  # (equations, 43 or 44)
    right: Array  # (equations,)  less what the robot file's numbers explain


def linear_start(
    experiments: Sequence[Experiment], robot: Robot, rows: Sequence[Unknown]
) -> tuple[LinearStart | None, str]:
    """Returns the start, or None with what the logs lack for it.

    rows: numbers that are to be found.
    """
    logs = [one.log.without([*set(one.log.measured) - set(one.columns)]) for one in experiments]
    missing = [lacking(log) for log in logs]
    usable = [k for k, text in enumerate(missing) if not text]
    if not usable:
        return None, missing[0]
    if robot.servo.mode == "kinematic":
        return None, "torques of servos: kinematic drives follow their commands"
    values: dict[str, float] = {}
    found = []
    for k in usable:
        shift = best_shift(logs[k], experiments[k].fitted, robot)
        found.append(samples_of(logs[k], experiments[k].fitted, robot, shift=shift))
        values |= dict.fromkeys(DELAYS.values(), (shift - 0.5) * found[-1].period)
        values |= found[-1].biases
    values |= servo_law(found, robot)
    equations = joined([rigid_equations(one, robot) for one in found])
    base = least_squares_base(base_of(robot), robot, equations.matrix, equations.right)
    base = replace(base, deviations=DOUBT * base.deviations)
    mass = [row for row in rows if row.group == "mass" or row.key in (*OTHERS, *CONSTANTS)]
    values |= possible_values(equations, robot, mass)
    return LinearStart({row.key: values[row.key] for row in rows if row.key in values}, base), ""


def best_shift(log: Log, rows: slice, robot: Robot) -> int:
    """Returns how many rows before a reading its command was sent, by the servos' law."""
    misfits = [
        _law(samples_of(log, rows, robot, shift=shift), robot)[1]
        for shift in range(1, LONGEST_SHIFT + 1)
    ]
    return 1 + int(np.argmin(misfits))


def servo_law(samples: Sequence[Samples], robot: Robot) -> dict[str, float]:
    """Returns kp and kd; nothing where the readings are currents or do not tell them."""
    laws = np.array([_law(one, robot)[0] for one in samples if not one.is_current])
    if not len(laws):
        return {}
    found = dict(zip(SERVO, np.mean(laws, axis=0).tolist(), strict=True))
    return {key: value for key, value in found.items() if value > 0.0}


def _law(samples: Samples, robot: Robot) -> tuple[Array, float]:
    """Returns kp and kd of the servos' law and the mean square that they leave [(N m)^2]."""
    servo, torque = robot.servo, samples.motor
    if samples.is_current and servo.drive == "motor":
        torque = servo.torque_constant * torque
    free = np.abs(torque) < SATURATED * servo.torque_max
    if servo.drive == "motor":
        torque = torque + back_emf_damping(servo) * samples.motion.speed
    matrix = np.column_stack([samples.error[free], samples.speed_error[free]])
    right = (torque - samples.torque_ref)[free]
    known = np.isfinite(matrix).all(axis=1) & np.isfinite(right)
    gains = np.asarray(
        np.linalg.lstsq(matrix[known], right[known], rcond=None)[0], dtype=np.float64
    )
    left = right[known] - matrix[known] @ gains
    return gains, float(np.mean(left**2))


def rigid_equations(samples: Samples, robot: Robot) -> Equations:
    """Returns the equations of motion of a log for what a robot differs by from its file.

    Columns: 40 inertial parameters, rotor inertia, dry and viscous friction and, for currents, the
    torque constant.
    """
    servo, motion = robot.servo, samples.motion
    bodies = frames(robot, motion)
    feet = foot_equations(robot, bodies, motion, np.array(ground_normal(robot.terrain)))
    count = len(motion.spin)
    slip = np.tanh(motion.speed / servo.friction_speed).reshape(count, -1)
    columns = VISCOUS + 1 + samples.is_current
    matrix = np.zeros((count, EQUATIONS, INERTIAL + columns))
    matrix[:, :, :INERTIAL] = regressor(bodies)
    matrix[:, 6:, INERTIAL] = motion.acceleration.reshape(count, -1)
    matrix[:, 6:, INERTIAL + 1] = slip
    matrix[:, 6:, INERTIAL + VISCOUS] = motion.speed.reshape(count, -1)
    constant = servo.torque_constant if servo.drive == "motor" else 1.0
    right = -body_wrenches(robot, bodies)
    right += np.einsum("nef,nf->ne", feet, samples.force.reshape(count, -1))
    torque = constant * samples.motor
    if samples.is_current:
        matrix[:, 6:, -1] = -samples.motor.reshape(count, -1)
        right[:, 6:] += 0.0 if servo.drive == "line" else torque.reshape(count, -1)
    else:
        right[:, 6:] += samples.motor.reshape(count, -1)
    right[:, 6:] -= servo.rotor_inertia * matrix[:, 6:, INERTIAL]
    right[:, 6:] += _file_friction(robot, motion.speed, torque).reshape(count, -1)
    return _weighted(samples, feet, matrix, right)


def _file_friction(robot: Robot, speed: Array, motor: Array) -> Array:
    """Returns the friction torques (samples, 6, 3) of the robot file's gears [N m].

    The load of a gear is taken as the motor's torque, as at rest.
    """
    servo = robot.servo
    if has_measured_friction(servo):
        return friction_torque(servo, speed, motor, -motor)
    return -servo.coulomb_friction * np.tanh(speed / servo.friction_speed)


def _weighted(samples: Samples, feet: Array, matrix: Array, right: Array) -> Equations:
    """Returns filtered equations in units of their noise, without the forces along the ground."""
    thin = max(int(0.25 / (CUT_OFF * samples.period)), 1)
    ends = round(OPEN_ENDS / samples.period)
    keep = slice(ends, len(right) - ends, thin)
    matrix, right = (_filtered(each, samples.period)[keep] for each in (matrix, right))
    weights = np.ones(EQUATIONS)
    unknown = None if samples.tangential else _filtered(_along(samples, feet), samples.period)[keep]
    counts = np.ones((len(right), 1))
    whole, left = matrix, right
    for _ in range(ROUNDS):
        scaled = matrix * weights[:, None], right * weights
        if unknown is not None:
            scaled = _without(unknown * weights[:, None], *scaled)
        whole, left = counts[:, :, None] * scaled[0], counts * scaled[1]
        found = _solved(whole.reshape(-1, whole.shape[2]), left.ravel())
        misfit = scaled[1] - scaled[0] @ found
        weights = weights / np.array([_typical(misfit[:, np.array(KINDS) == k]) for k in KINDS])
        size = np.sqrt(np.mean(misfit**2, axis=1, keepdims=True))
        counts = np.sqrt(np.minimum(1.0, HUBER * np.median(size) / np.maximum(size, 1e-300)))
    return Equations(whole.reshape(-1, whole.shape[2]), left.ravel())


def _typical(misfit: Array) -> float:
    return max(float(np.sqrt(np.mean(misfit**2))), 1e-12)


def _filtered(values: Array, period: float) -> Array:
    """Returns values (samples, ...) after a low-pass filter that does not shift them."""
    from scipy.signal import butter, sosfiltfilt  # noqa: PLC0415  slow to import

    if CUT_OFF * period > 0.4:
        return values
    sections = butter(2, CUT_OFF, fs=1.0 / period, output="sos")
    return np.asarray(sosfiltfilt(sections, values, axis=0))


def _along(samples: Samples, feet: Array) -> Array:
    """Returns the columns (samples, 24, 12) of the forces along level ground of loaded feet."""
    loaded = samples.force[:, :, 2] > LEAST_CONTACT
    columns = [3 * leg + axis for leg in range(6) for axis in range(2)]
    return np.asarray(feet[:, :, columns] * np.repeat(loaded, 2, axis=1)[:, None, :])


def _without(unknown: Array, matrix: Array, right: Array) -> tuple[Array, Array]:
    """Returns equations projected on what unknown forces do not change."""
    inverse = np.linalg.pinv(unknown, rcond=1e-9)
    matrix = matrix - unknown @ (inverse @ matrix)
    right = right - np.einsum("nec,nc->ne", unknown, np.einsum("nce,ne->nc", inverse, right))
    return matrix, right


def _solved(matrix: Array, right: Array) -> Array:
    """Returns the least-squares solution of the smallest size, with columns at equal length."""
    size = np.linalg.norm(matrix, axis=0)
    scale = np.where(size > 0.0, size, 1.0)
    return np.asarray(np.linalg.lstsq(matrix / scale, right, rcond=1e-6)[0] / scale)


def joined(parts: Sequence[Equations]) -> Equations:
    """Returns the equations of several logs with the same columns, at most as many as columns."""
    width = max(part.matrix.shape[1] for part in parts)
    own = [part for part in parts if part.matrix.shape[1] == width]
    both = np.vstack([np.column_stack([part.matrix, part.right]) for part in own])
    return Equations(both[:, :-1], both[:, -1])


def possible_values(
    equations: Equations, robot: Robot, rows: Sequence[Unknown]
) -> dict[str, float]:
    """Returns values of rows that fit the equations best, with what the robot file says.

    rows: masses, centres of mass and numbers of OTHERS; each value is that of a possible body.
    """
    from scipy.optimize import least_squares  # noqa: PLC0415  slow to import

    if not rows:
        return {}
    whole = np.column_stack([equations.matrix, equations.right]) / DOUBT
    both = np.asarray(np.linalg.qr(whole, mode="r"))
    matrix, right = both[:, :-1], both[:, -1]
    before = {row.key: value_before(row, robot) for row in rows}
    start = group_parameters(robot)

    def values(z: Array) -> dict[str, float]:
        pairs = zip(rows, z[: len(rows)].tolist(), strict=True)
        return {row.key: row.value(each, before[row.key]) for row, each in pairs}

    def residuals(z: Array) -> Array:
        own = values(z)
        changed = robot
        for row in rows:
            if row.write is not None:
                changed = row.write(changed, own[row.key])
        step = np.zeros(matrix.shape[1])
        step[:INERTIAL] = group_parameters(changed) - start
        for k, key in enumerate(OTHERS):
            step[INERTIAL + k] = own.get(key, before.get(key, 0.0)) - before.get(key, 0.0)
        if matrix.shape[1] > INERTIAL + VISCOUS + 1:
            step[-1] = own.get(CURRENT, 0.0)
            step[-1] += own.get(CONSTANTS[1], 0.0) - before.get(CONSTANTS[1], 0.0)
        step[INERTIAL + VISCOUS] = z[-1]
        return np.concatenate([matrix @ step - right, z[:-1]])

    low, high = zip(*(row.bounds(before[row.key]) for row in rows), strict=True)
    limits = ((*low, -np.inf), (*high, np.inf))
    found = least_squares(residuals, np.zeros(len(rows) + 1), bounds=limits)
    return values(found.x[:-1])
