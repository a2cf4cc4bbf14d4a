"""The test bench of Duclusaud et al. (ICRA 2025), written from their published equations: a servo
turns a rod with a mass at its end. Nothing here is shared with the plant or the twin.

Angles are from the hanging position [rad]. The servo's duty is proportional to the error of its
position; friction is a budget that clips the torque which would stop the joint.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

GRAVITY = 9.80665  # m/s2, as in their test bench
Table = Mapping[str, float]
Path = Callable[[float], float]


@dataclass(frozen=True)
class Rod:
    """A uniform rod with a point mass at its end."""

    mass: float = 0.5  # kg  at the end
    rod: float = 0.1  # kg  of the rod
    length: float = 0.15  # m

    @property
    def inertia(self) -> float:
        """Inertia about the joint [kg m2]."""
        return (self.mass + self.rod / 3.0) * self.length**2

    def weight(self, angle: float) -> float:
        """Torque of gravity [N m]."""
        return -(self.mass + self.rod / 2.0) * GRAVITY * self.length * math.sin(angle)


def motor(p: Table, duty_gain: float, target: float, angle: float, speed: float) -> float:
    """Returns k_t V/R - k_t^2 w/R [N m], V = V_in clip(duty)."""
    duty = min(max(duty_gain * (target - angle), -p["duty_max"]), p["duty_max"])
    kt, r = p["torque_constant"], p["resistance"]
    return kt * p["voltage"] * duty / r - kt**2 * speed / r


def budget(p: Table, speed: float, drive: float, external: float) -> float:
    """Returns the budget of M6 without its viscous term [N m]; other models have fewer terms."""
    sum_ = p["coulomb_friction"] + abs(
        p.get("motor_load_friction", 0.0) * drive - p.get("external_load_friction", 0.0) * external
    )
    if "stribeck_speed" not in p:
        return sum_
    q = 0.0
    if drive * external < 0.0 and abs(drive) > abs(external):
        q = p.get("quadratic_external_friction", 0.0) * external**2
    elif drive * external < 0.0 and abs(drive) < abs(external):
        q = p.get("quadratic_motor_friction", 0.0) * drive**2
    stribeck = p["stribeck_friction"] + q
    stribeck += abs(
        p.get("stribeck_motor_load_friction", 0.0) * drive
        - p.get("stribeck_external_load_friction", 0.0) * external
    )
    decay = math.exp(-(abs(speed / p["stribeck_speed"]) ** p["stribeck_exponent"]))
    return sum_ + decay * stribeck


def smooth_swing(
    p: Table,
    duty_gain: float,
    rod: Rod,
    target: Path,
    times: NDArray[np.float64],
    friction_speed: float,
) -> NDArray[np.float64]:
    """Returns angles and speeds (2, n) at times [s] from rest at 0, where the budget acts with
    tanh(speed / friction_speed).
    """
    total = rod.inertia + p["rotor_inertia"]

    def rate(t: float, y: NDArray[np.float64]) -> list[float]:
        angle, speed = float(y[0]), float(y[1])
        drive, external = motor(p, duty_gain, target(t), angle, speed), rod.weight(angle)
        held = budget(p, speed, drive, external) * math.tanh(speed / friction_speed)
        friction = held + p["viscous_friction"] * speed
        return [speed, (drive + external - friction) / total]

    pieces = [np.zeros((2, 1))]
    for start, end in pairwise(times):
        step = solve_ivp(
            rate, (start, end), pieces[-1][:, -1], "DOP853", rtol=1e-11, atol=1e-12, max_step=0.01
        )
        pieces.append(step.y[:, -1:])
    return np.hstack(pieces)


def clipped_swing(
    p: Table, duty_gain: float, rod: Rod, target: Path, times: NDArray[np.float64], step: float
) -> NDArray[np.float64]:
    """Returns angles (n,) at times [s] from rest at 0 by their scheme: the torque that stops the
    joint within a step is clipped to the budget.
    """
    total, angle, speed = rod.inertia + p["rotor_inertia"], 0.0, 0.0
    found = [0.0]
    for start, end in pairwise(times):
        count = round((end - start) / step)
        for k in range(count):
            t = start + k * step
            drive, external = motor(p, duty_gain, target(t), angle, speed), rod.weight(angle)
            most = budget(p, speed, drive, external) + p["viscous_friction"] * abs(speed)
            stop = total / step * speed + drive + external
            net = drive + external - math.copysign(min(abs(stop), most), stop)
            speed += net / total * step
            angle += speed * step
        found.append(angle)
    return np.array(found)
