"""Slow loops on what the standing legs say about the torso: its height and tilt over the ground,
and the way it has walked.

Feet that stand are fixed points, so where the encoders see them tells how the torso lies. Against
the planned feet they lie higher by c + s_x x + s_y y: the torso is c too low, pitched by s_x and
rolled by -s_y against the ground. That tilt, and what a gravity-aware sensor says, give the
ground's own inclination; smoothed it is what the torso is held parallel to, while quick tilts, of a
torso on uneven ground as well, are those of the sensor. From look to look the way over the ground
is -d(e^(i yaw) p) of the feet that stood all the time.
"""

from __future__ import annotations

import math
from cmath import rect
from collections.abc import Sequence
from typing import Any, NamedTuple

from hexapod_cosim.controller.gains import HoldGains
from hexapod_cosim.controller.kinematics import LEGS
from hexapod_cosim.controller.parts import Parts

LOOK_TIME = 0.04  # s    between two looks, at least a period
LOADED = 0.3  # 1    thirds of the weight on a foot that certainly does not slip along
DETERMINANT_FLOOR = 1e-6  # m4    feet on one line tell no tilt


class Sight(NamedTuple):
    """What is seen at a look. Feet in the walking frame, of each leg."""

    plane: Sequence[complex]  # m    where the encoders see the contact points, x + i y
    height: Sequence[float]  # m    and the feet's centres, z
    planned: Sequence[complex]  # m    where they were planned
    planned_height: Sequence[float]  # m
    load: Sequence[float]  # 1    thirds of the weight
    tilt: tuple[float, float]  # rad    roll and pitch beyond the commanded ones
    yaw: float  # rad
    velocity: complex  # m/s    commanded, walking frame
    yaw_rate: float  # rad/s


class Hold:
    """Corrections of posture and way.

    Attributes: lift: (6) of the feet [m]; velocity [m/s], yaw_rate [rad/s]: additions to the
    commanded ones; way, heading: those lost.
    """

    def __init__(self, gains: HoldGains, parts: Parts, *, period: float) -> None:
        self.every = max(1, round(LOOK_TIME / period))  # steps between two looks
        self._gains, self._parts, self._time = gains, parts, self.every * period
        self.reset()

    def reset(self) -> None:
        """Nothing seen yet."""
        self.lift, self.velocity, self.yaw_rate = [0.0] * LEGS, 0j, 0.0
        self.way, self.heading = 0j, 0.0
        self._ground: tuple[float, float] | None = None
        self._angles, self._height = (0.0, 0.0), 0.0
        self._before: tuple[list[complex], Sequence[float], float] | None = None

    def save(self) -> dict[str, Any]:
        """Returns the state that restore() takes."""
        return {
            name: value
            for name, value in vars(self).items()
            if name not in {"every", "_gains", "_parts", "_time"}
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Restores a state returned by save()."""
        vars(self).update(state)

    def look(self, seen: Sight) -> None:
        """Brings the corrections up to date."""
        if self._parts.posture:
            self._hold_posture(seen)
        if self._parts.path:
            self._hold_path(seen)

    def _hold_posture(self, seen: Sight) -> None:
        found = fit_plane(
            seen.planned,
            [z - p for z, p in zip(seen.height, seen.planned_height, strict=True)],
            seen.load,
        )
        if found is None:
            return
        low, along, across = found
        gains, time = self._gains, self._time
        leaning = seen.tilt[0] + across, seen.tilt[1] - along  # of the ground
        ground = self._ground or leaning
        smooth = min(time / gains.ground_time, 1.0)
        self._ground = ground = (
            ground[0] + smooth * (leaning[0] - ground[0]),
            ground[1] + smooth * (leaning[1] - ground[1]),
        )
        step, most = gains.attitude_rate * time, gains.angle_limit
        roll, pitch = (
            _within(c - step * (t - g), most)
            for c, t, g in zip(self._angles, seen.tilt, ground, strict=True)
        )
        self._angles = roll, pitch
        self._height = _within(self._height + gains.height_rate * time * low, gains.height_limit)
        self.lift = [p.real * pitch - p.imag * roll - self._height for p in seen.planned]

    def _hold_path(self, seen: Sight) -> None:
        time, turned = self._time, rect(1.0, seen.yaw)
        feet = [turned * p for p in seen.plane]
        if self._before is not None:
            before, loads, yaw = self._before
            both = [
                min(a, b) if min(a, b) > LOADED else 0.0
                for a, b in zip(loads, seen.load, strict=True)
            ]
            commanded, total = (
                rect(1.0, yaw + self.heading + 0.5 * seen.yaw_rate * time) * seen.velocity * time,
                sum(both),
            )
            walked = (
                -sum(w * (p - q) for w, p, q in zip(both, feet, before, strict=True)) / total
                if total
                else commanded
            )
            self.way += commanded - walked
            self.heading += seen.yaw_rate * time - math.remainder(seen.yaw - yaw, math.tau)
        self._before = feet, seen.load, seen.yaw
        gains = self._gains
        back = gains.path_rate * self.way * turned.conjugate()
        self.velocity = back * (gains.speed_limit / max(abs(back), gains.speed_limit))
        self.yaw_rate = _within(gains.path_rate * self.heading, gains.turn_limit)


def _within(value: float, most: float) -> float:
    return min(max(value, -most), most)


def fit_plane(
    feet: Sequence[complex], height: Sequence[float], weight: Sequence[float]
) -> tuple[float, float, float] | None:
    """c, s_x, s_y of the weighted least squares height = c + s_x x + s_y y; None when the feet
    do not span a plane.
    """
    loaded = [
        (w, p.real, p.imag, z) for p, z, w in zip(feet, height, weight, strict=True) if w > LOADED
    ]
    total = sum(w for w, *_ in loaded)
    if len(loaded) < 3 or not total:
        return None
    x0, y0, z0 = (sum(row[0] * row[k] for row in loaded) / total for k in (1, 2, 3))
    about = [(w / total, x - x0, y - y0, z - z0) for w, x, y, z in loaded]
    xx, yy, xy = (
        sum(w * x * x for w, x, _, _ in about),
        sum(w * y * y for w, _, y, _ in about),
        sum(w * x * y for w, x, y, _ in about),
    )
    xz, yz = sum(w * x * z for w, x, _, z in about), sum(w * y * z for w, _, y, z in about)
    determinant = xx * yy - xy * xy
    if determinant < DETERMINANT_FLOOR:
        return None
    along, across = (xz * yy - yz * xy) / determinant, (yz * xx - xz * xy) / determinant
    return z0 - along * x0 - across * y0, along, across
