"""Controls posture and path of the torso slowly, by the positions of the standing feet.

C: hold.h. Standing feet are fixed to the ground, so their positions by the joint encoders give the
height and tilt of the torso over them (C37). This tilt and that of the attitude sensor give the
inclination of the ground. The torso is held parallel to the smoothed inclination; fast tilts are
corrected by the sensor (C38). Between two updates, the feet that stood all the time give the path
of the torso over the ground (C39); its deviation from the command is corrected by an addition to
the commanded velocity (C40).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from hexapod_cosim.controller.gains import HoldGains, Parts
from hexapod_cosim.controller.memory import Stateful
from hexapod_cosim.controller.plane import LEGS, Array, Plane, cis, clamp

UPDATE_TIME = 0.04  # s    between two updates, at least a period
LOADED_FROM = 0.4  # 1    thirds of the weight; a foot with more load does not slide
DETERMINANT_FLOOR = 1e-6  # m4    feet on one line determine no plane


class HoldInput(NamedTuple):
    """Measurements at an update; feet (6,) are in the walking frame."""

    plane: Plane  # m    contact points by the encoders, x + i y
    height: Array  # m    centres of the feet by the encoders, z
    planned: Plane  # m    planned contact points, x + i y
    planned_height: Array  # m    planned centres of the feet, z
    load: Array  # 1    thirds of the weight
    tilt: Array  # rad    (2,) roll and pitch beyond the commanded ones
    yaw: float  # rad
    velocity: complex  # m/s    commanded, walking frame
    yaw_rate: float  # rad/s    commanded


def fit_plane(feet: Plane, height: Array, weight: Array) -> Array | None:
    """Fits the plane height = c + s_x x + s_y y by weighted least squares (C37).

    Args:
        feet: (6,) x + i y [m].
        height: (6,) [m].
        weight: (6,) feet with no more than LOADED_FROM are left out.

    Returns:
        (3,) c, s_x, s_y; None when the feet do not span a plane.
    """
    loaded = weight > LOADED_FROM
    if np.count_nonzero(loaded) < 3:
        return None
    part = np.where(loaded, weight, 0.0)
    part = part / part.sum()
    centre, middle = part @ feet, part @ height
    x, y, z = feet.real - centre.real, feet.imag - centre.imag, height - middle
    xx, yy, xy, xz, yz = (float(part @ product) for product in (x * x, y * y, x * y, x * z, y * z))
    determinant = xx * yy - xy * xy
    if determinant < DETERMINANT_FLOOR:
        return None
    along, across = (xz * yy - yz * xy) / determinant, (yz * xx - xz * xy) / determinant
    return np.array([middle - along * centre.real - across * centre.imag, along, across])


class Hold(Stateful):
    """Corrections of posture and path.

    Attributes:
        lift: (6,) of the feet [m].
        velocity, yaw_rate: additions to the commanded ones [m/s, rad/s].
        way, heading: deviation of the path from the command, ground frame [m, rad].
        ground: (2,) inclination of the ground, roll and pitch [rad]; None: not known yet.
        angle, height: (2,) roll and pitch and the height of the correction [rad, m].
        last: contact points (6,) turned by the yaw [m], their loads (6,) [1] and the yaw [rad] at
            the last update; None: there was none.
    """

    STATE = ("lift", "velocity", "yaw_rate", "way", "heading", "ground", "angle", "height", "last")

    def __init__(self, gains: HoldGains, parts: Parts, *, period: float) -> None:
        self.gains, self.parts = gains, parts
        self.every = max(1, round(UPDATE_TIME / period))  # periods between two updates
        self.time = self.every * period  # s
        self.smooth = min(self.time / gains.ground_time, 1.0)
        self.reset()

    def reset(self) -> None:
        """Removes all corrections and measurements."""
        self.lift, self.velocity, self.yaw_rate = np.zeros(LEGS), 0j, 0.0
        self.way, self.heading = 0j, 0.0
        self.ground: Array | None = None
        self.angle, self.height = np.zeros(2), 0.0
        self.last: tuple[Plane, Array, float] | None = None

    def _hold_posture(self, seen: HoldInput) -> None:
        """Integrates height and tilt against the ground (C38)."""
        fit = fit_plane(seen.planned, seen.height - seen.planned_height, seen.load)
        if fit is None:
            return
        low, along, across = fit
        gains = self.gains
        # against the planned feet the torso is pitched by s_x and rolled by -s_y
        leaning = seen.tilt + np.array([across, -along])
        ground = leaning if self.ground is None else self.ground
        self.ground = ground + self.smooth * (leaning - ground)
        step = gains.attitude_rate * self.time
        angle = self.angle - step * (seen.tilt - self.ground)
        self.angle = clamp(angle, -gains.angle_limit, gains.angle_limit)
        height = self.height + gains.height_rate * self.time * low
        self.height = float(clamp(height, -gains.height_limit, gains.height_limit))
        roll, pitch = self.angle
        self.lift = seen.planned.real * pitch - seen.planned.imag * roll - self.height

    def _add_lost_way(self, seen: HoldInput, feet: Plane) -> None:
        """Adds the deviation of the path since the last update (C39).

        feet: (6,) contact points turned by the yaw [m].
        """
        if self.last is None:
            return
        before, loads, yaw = self.last
        least = np.minimum(loads, seen.load)
        both = np.where(least > LOADED_FROM, least, 0.0)
        total = both.sum()
        ahead = cis(yaw + self.heading + 0.5 * seen.yaw_rate * self.time)
        commanded = ahead * seen.velocity * self.time
        walked = -(both @ (feet - before)) / total if total > 0.0 else commanded
        self.way = complex(self.way + commanded - walked)
        turned = math.remainder(seen.yaw - yaw, math.tau)
        self.heading += seen.yaw_rate * self.time - turned

    def _hold_path(self, seen: HoldInput) -> None:
        """Computes the added velocity that leads the robot back to its path (C39, C40)."""
        gains, R_WK = self.gains, complex(cis(seen.yaw))
        feet = R_WK * seen.plane
        self._add_lost_way(seen, feet)
        self.last = feet, seen.load, seen.yaw
        back = gains.path_rate * self.way * R_WK.conjugate()
        self.velocity = back * (gains.speed_limit / max(abs(back), gains.speed_limit))
        turn = gains.path_rate * self.heading
        self.yaw_rate = min(max(turn, -gains.turn_limit), gains.turn_limit)

    def update(self, seen: HoldInput) -> None:
        """Updates the corrections of height, tilt and velocity from the measured posture."""
        if self.parts.posture:
            self._hold_posture(seen)
        if self.parts.path:
            self._hold_path(seen)
