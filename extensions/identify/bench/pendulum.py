"""Simulates many servos on the benches of many logs at once, with the servo's equations of
`models`, those that the hexapod walks with.

The joint has J q'' = motor + weight - friction. Friction and back-EMF are solved for the speed at
the end of a step, so that stiff dry friction does not shorten the steps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from hexapod_cosim.extensions.identify.bench.log import BenchLog
from hexapod_cosim.models.actuator import servo_torque
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.records import Servo
from hexapod_cosim.models.servos.motor import (
    Power,
    back_emf_damping,
    count_overload,
    friction_budget,
    overload_share,
    position_gain,
    setpoint_rate,
)

GRAVITY = 9.80665  # m/s2
STEP = 0.0015  # s  about
NEWTON = 2  # iterations for the speed at the end of a step


@dataclass(frozen=True)
class Swing:
    """What servos do on benches: (rows, servos, logs), of logs with fewer rows up to their last."""

    angle: Array  # rad  as the encoder reads it
    speed: Array  # rad/s
    duty: Array  # 1


def stacked(servos: Sequence[Servo]) -> Servo:
    """Returns servos as one whose numbers are arrays (servos, 1)."""
    numbers = {
        item.name: np.array([[getattr(one, item.name)] for one in servos])
        for item in fields(Servo)
        if isinstance(getattr(servos[0], item.name), float)
    }
    same = {key: float(own[0, 0]) for key, own in numbers.items() if np.all(own == own[0])}
    changed: dict[str, Any] = {**numbers, **same}
    return replace(servos[0], **changed)


class Bench:
    """Logs on a common grid of steps of about `step` [s], of which each row has the same number."""

    def __init__(self, logs: Sequence[BenchLog], *, step: float = STEP) -> None:
        self.logs = tuple(logs)
        rows = max(len(log.time) for log in logs)
        self.time = _table(logs, "time", rows)
        # rows behind a log's last one repeat it, with the usual distance
        for k, log in enumerate(logs):
            more = np.arange(1, rows - len(log.time) + 1)
            self.time[len(log.time) :, k] = log.time[-1] + more * np.median(np.diff(log.time))
        self.parts = max(1, round(float(np.median(np.diff(self.time, axis=0))) / step))
        self.measured = _table(logs, "angle", rows)
        self.counted = np.arange(rows)[:, None] < np.array([len(log.time) for log in logs])
        self.speed, self.duty = _table(logs, "speed", rows), _table(logs, "duty", rows)
        self.voltage, self.on = _table(logs, "voltage", rows), _table(logs, "on", rows)
        self.gain = np.array([log.gain for log in logs])
        mass, rod, length = (
            np.array([getattr(log, name) for log in logs]) for name in ("mass", "rod", "length")
        )
        self.inertia = (mass + rod / 3.0) * length**2
        self.weight = (mass + 0.5 * rod) * GRAVITY * length

    def simulate(self, servo: Servo, offset: Array | float, delay: Array | float) -> Swing:
        """Simulates servos from the first row of each log on.

        Args:
            servo: one servo, or several of `stacked`.
            offset: hanging position less the encoder's zero, (servos, 1) [rad].
            delay: of the goals on their way to the servo, (servos, 1) [s].
        """
        gains: Any = position_gain(servo, 1.0) * self.gain
        servo = replace(servo, kp=gains)
        shape = np.broadcast_shapes(np.shape(servo.kp), np.shape(offset), self.gain.shape)
        shape = (1,) * (2 - len(shape)) + shape
        rows, parts = len(self.time), self.parts
        goals = self.goals(delay) + offset
        angle = np.broadcast_to(self.measured[0] + offset, shape).copy()
        state = _State(angle, np.broadcast_to(self.speed[0], shape).copy(), angle.copy())
        found = Swing(*(np.empty((rows, *shape)) for _ in range(3)))
        for row in range(rows):
            later = min(row + 1, rows - 1)
            h = (self.time[later] - self.time[row]) / parts
            supply = self.voltage[row] / servo.voltage
            found.angle[row], found.speed[row] = state.angle - offset, state.speed
            for part in range(parts if later > row else 0):
                goal = goals[row * parts + part]
                duty = state.step(servo, self, h, goal, supply, self.on[row])
                if part == 0:
                    found.duty[row] = duty
        found.duty[-1] = found.duty[-2]
        return found

    def goals(self, delay: Array | float) -> Array:
        """Returns the goals (steps, servos, logs) at the middle of each step, less a delay."""
        h = np.diff(self.time, axis=0)[:, None] / self.parts
        middle = (np.arange(self.parts) + 0.5)[:, None] * h
        time = (self.time[:-1, None] + middle).reshape(-1, 1, len(self.logs)) - delay
        return np.stack(
            [np.interp(time[..., k], log.time, log.goal) for k, log in enumerate(self.logs)],
            axis=-1,
        )


def _table(logs: Sequence[BenchLog], name: str, rows: int) -> Array:
    """Returns a column of each log (rows, logs); shorter ones repeat their last row."""
    own = [getattr(log, name) for log in logs]
    return np.column_stack([np.pad(one, (0, rows - len(one)), mode="edge") for one in own])


@dataclass
class _State:
    angle: Array  # rad  from the hanging position
    speed: Array  # rad/s
    setpoint: Array  # rad
    loaded: Array | float = 0.0  # s  of the duty above the overload limit

    def step(
        self, servo: Servo, bench: Bench, h: Array, goal: Array, supply: Array, on: Array
    ) -> Array:
        """Advances by h [s] with semi-implicit Euler; returns the duty."""
        if np.any(servo.goal_speed_max):
            goal = self.setpoint + h * setpoint_rate(servo, self.setpoint, goal, h)
        self.setpoint = goal
        power = Power(supply, supply * overload_share(servo, self.loaded), on)
        rest = np.zeros(())  # commands of speed and torque
        motor = servo_torque(servo, self.angle, self.speed, self.setpoint, rest, rest, power=power)
        external = -bench.weight * np.sin(self.angle)
        budget = friction_budget(servo, self.speed, motor, external)
        brake = back_emf_damping(servo) * on
        inertia = (bench.inertia + servo.rotor_inertia) / h
        driven = inertia * self.speed + motor + brake * self.speed + external
        speed = _ending(driven, inertia + brake + servo.viscous_friction, budget, servo)
        self.angle = self.angle + 0.5 * h * (self.speed + speed)
        self.speed = speed
        wanted = servo.kp * (self.setpoint - self.angle)
        self.loaded = count_overload(servo, wanted, self.loaded, h)
        back = back_emf_damping(servo) * self.speed
        return (motor + back) / position_gain(servo, 1.0) / supply * on


def _ending(driven: Array, slope: Array, budget: Array, servo: Servo) -> Array:
    """Returns the speed w that solves slope w + budget tanh(w/w_f) = driven, by Newton's method."""
    size, most = np.abs(driven), servo.friction_speed
    held = np.minimum(size / (budget + slope * most), 0.99)
    speed = np.maximum((size - budget) / slope, most * np.arctanh(held))
    for _ in range(NEWTON):
        t = np.tanh(speed / most)
        speed = speed - (slope * speed + budget * t - size) / (
            slope + budget / most * (1.0 - t * t)
        )
    return np.copysign(speed, driven)
