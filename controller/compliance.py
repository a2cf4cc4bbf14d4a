"""Compliant control: what the measured foot forces add to the planned feet, in the walking frame.

Tangential. Of its force a foot should give way only to what does no work for the body: the legs' common push, shared in proportion to
the load, moves the robot and is left alone; the rest is legs squeezing against each other. Giving way to the rest moves no body, so
the loop that is designed with the torso held (controller/design) is the loop that runs. Most squeezing comes from legs that splay under
their load, so the shift that relieves it is stored per load and goes when the load goes: a foot that is about to lift off is not
dragged over the ground by the shift it needed under load. The load meant is the planned one. With the measured one the shift would
answer the normal force, a second loop through the leg's stiffness that rings at the controller's rate.

Normal. The suspension answers to the difference from the force that the leg carries when all standing legs share the weight evenly
about the centre of mass. Its preload may exceed that share: then the leg is held longer by what its servos sag, as a vehicle's spring is
set for its ride height.
"""

from __future__ import annotations

import math

import numpy as np

from hexapod_cosim.controller.gains import TRIPOD_LEGS, Gains
from hexapod_cosim.controller.kinematics import LEGS, Array, Mask, Plane
from hexapod_cosim.controller.slip_pid import SlipPid
from hexapod_cosim.controller.suspension import Suspension

LOAD_FLOOR = 1e-6  # N    below it no foot carries anything
LARGEST_LOAD = 2.0  # 1    in shares of the weight: the design's margins hold up to it
DETERMINANT_FLOOR = 1e-9  # m4    feet on one line share no moment


class Compliance:
    """The two laws of all feet. Horizontal shifts and forces are complex numbers x + i y.

    Attributes: tangential: (2, 6) shift and shift_rate; normal: (2, 6) lift and lift_rate;
    (6,) each: shift, shift_rate: horizontal correction and its rate [m, m/s]; lift, lift_rate: the vertical one;
    squeeze: tangential force the feet give way to [N]; excess: normal force beyond the preload [N]; share: of the weight [N].
    """

    def __init__(self, gains: Gains, *, weight: float, centre: complex, period: float) -> None:
        """weight [N] and centre of mass x + i y [m] of the robot in the walking frame."""
        self.pid = SlipPid(gains.slip, period=period)
        self.suspension = Suspension(gains.suspension, period=period)
        self.normal = self.suspension.state
        self.lift, self.lift_rate = self.normal
        self._weight, self._centre = weight, centre
        self._preloads, self._per_share = np.full(LEGS, gains.suspension.preload), np.full(LEGS, TRIPOD_LEGS / weight)
        self._follow = np.full(LEGS, 1.0 - math.exp(-period / gains.slip.load_time))
        self._largest, self._per_second = np.full(LEGS, LARGEST_LOAD), np.full(LEGS, 1.0 / period)
        self.squeeze = np.zeros(LEGS, dtype=np.complex128)
        self.tangential = np.zeros((2, LEGS), dtype=np.complex128)
        self.shift, self.shift_rate = self.tangential
        self._new, self._common = np.zeros((2, LEGS), dtype=np.complex128)
        self.excess, self.share, self._load, self._scale, self._t, self._zero = np.zeros((6, LEGS))
        self._stance, self._gone = np.empty((2, LEGS), dtype=np.bool_)

    def reset(self) -> None:
        """Both laws at rest."""
        self.pid.reset()
        self.suspension.reset()
        for plane in (self.shift, self.shift_rate, self.squeeze):
            plane[:] = 0.0
        for buffer in (self.excess, self.share, self._scale):
            buffer[:] = 0.0

    def step(self, push: Plane, normal: Array, contact: Mask, *, swinging: Mask, plane: Plane) -> None:
        """One period.

        Args:
            push, normal: (6,) ground on foot in the walking frame, x + i y and z [N]; contact: (6,) measured.
            swinging, plane: (6,) of the foot paths.
        """
        np.logical_not(swinging, self._stance)
        load = self._load
        np.maximum(normal, self._zero, out=load)
        np.multiply(load, contact, load)
        self.share[:] = even_shares(plane.tolist(), self._stance.tolist(), self._weight, self._centre)
        self._split(push, contact)
        self._yield(swinging, contact)
        np.multiply(self.share, self._preloads, self.excess)
        np.subtract(load, self.excess, self.excess)
        np.multiply(self.excess, self._stance, self.excess)
        self.suspension.step(self.excess)

    def _split(self, push: Plane, contact: Mask) -> None:
        """squeeze = f_t - (f_n / sum f_n) sum f_t over the feet in contact."""
        squeeze = self.squeeze
        np.multiply(push, contact, squeeze)
        total = sum(self._load.tolist())
        if total > LOAD_FLOOR:
            np.multiply(self._load, sum(squeeze.tolist()) / total, self._common)
            np.subtract(squeeze, self._common, squeeze)

    def _yield(self, swinging: Mask, contact: Mask) -> None:
        """shift = PID(squeeze) x smoothed share in thirds of the weight; the PID starts afresh when its foot has lifted off."""
        np.greater(swinging, contact, self._gone)
        if True in self._gone.tolist():
            self.pid.reset(self._gone)
        scale, new = self._scale, self._new
        np.multiply(self.share, self._per_share, self._t)
        np.minimum(self._t, self._largest, out=self._t)
        np.subtract(self._t, scale, self._t)
        np.multiply(self._t, self._follow, self._t)
        np.add(scale, self._t, scale)
        np.multiply(self.pid.step(self.squeeze), scale, new)
        np.subtract(new, self.shift, self.shift_rate)
        np.multiply(self.shift_rate, self._per_second, self.shift_rate)
        self.shift[:] = new


def even_shares(feet: list[complex], standing: list[bool], weight: float, centre: complex) -> list[float]:
    """What each foot carries [N]: least squares with sum f = weight and no moment about the centre of mass; never negative.

    f = a + b x + c y over the standing feet, p = x + i y [m] from the centre:
    (n sx sy; sx sxx sxy; sy sxy syy) (a b c) = (weight 0 0), with sums s over the standing feet.
    Plain numbers: six legs are too few for arrays to pay.
    """
    n, sx, sy, sxx, sxy, syy = 0, 0.0, 0.0, 0.0, 0.0, 0.0
    for foot, stands in zip(feet, standing, strict=True):
        if stands:
            arm = foot - centre
            x, y = arm.real, arm.imag
            n, sx, sy = n + 1, sx + x, sy + y
            sxx, sxy, syy = sxx + x * x, sxy + x * y, syy + y * y
    a, b, c = sxx * syy - sxy * sxy, sxy * sy - sx * syy, sx * sxy - sxx * sy
    determinant = n * a + sx * b + sy * c
    if determinant < DETERMINANT_FLOOR:
        each = weight / max(n, 1)
        return [each if stands else 0.0 for stands in standing]
    per = weight / determinant
    a, b, c = (a - b * centre.real - c * centre.imag) * per, b * per, c * per
    shares = [a + b * p.real + c * p.imag if stands else 0.0 for p, stands in zip(feet, standing, strict=True)]
    return [0.0 if share < 0.0 else share for share in shares]
