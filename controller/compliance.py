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
from collections.abc import Sequence
from typing import Any

import numpy as np

from hexapod_cosim.controller.gains import TRIPOD_LEGS, Gains
from hexapod_cosim.controller.kinematics import LEGS, Array, Feet, Mask, Plane
from hexapod_cosim.controller.slip_pid import SlipPid
from hexapod_cosim.controller.suspension import Suspension

LOAD_FLOOR = 1e-6  # N    below it no foot carries anything
LARGEST_LOAD = 2.0  # 1    in shares of the weight: the design's margins hold up to it
DETERMINANT_FLOOR = 1e-9  # m4    feet on one line share no moment


class Compliance:
    """The two laws of all feet. Horizontal shifts and forces are complex numbers x + i y.

    What the planned paths ask is laid out beforehand by `plan`; `step` takes it step by step and answers to the forces.

    Attributes, (6,) each:
        shift, lift: horizontal and vertical correction [m]; shift_rate: of the horizontal one [m/s];
        squeeze: tangential force the feet give way to [N]; excess: normal force beyond the preload [N].
    """

    def __init__(self, gains: Gains, *, weight: float, centre: complex, period: float) -> None:
        """weight [N] and centre of mass x + i y [m] of the robot in the walking frame."""
        self.pid = SlipPid(gains.slip, period=period)
        self.suspension = Suspension(gains.suspension, period=period)
        self._weight, self._centre, self._per_second = weight, centre, 1.0 / period
        self._preload, self._per_share = gains.suspension.preload, TRIPOD_LEGS / weight
        self._follow = 1.0 - math.exp(-period / gains.slip.load_time)
        self.shift: Plane = np.zeros(LEGS, dtype=np.complex128)
        self.lift: Array = np.zeros(LEGS)
        self.reset()

    def reset(self) -> None:
        """Both laws at rest, and nothing planned."""
        self.pid.reset()
        self.suspension.reset()
        self.shift[:] = self.lift[:] = 0.0
        self.squeeze, self.shift_rate, self._last_shift = ([0j] * LEGS for _ in range(3))
        self.excess = [0.0] * LEGS
        self._at, self._scale = 0, [(0.0,) * LEGS]
        self._known: tuple[list[bool], list[bool]] = ([], [])

    def save(self) -> tuple[Any, ...]:
        """What both laws remember."""
        return self.pid.state, self.pid.output, self.suspension.state, self._scale[self._at], self._last_shift

    def restore(self, state: tuple[Any, ...]) -> None:
        """Goes back to it; nothing more is planned."""
        self.pid.state, self.pid.output, self.suspension.state, scale, self._last_shift = state
        self.shift[:], self.lift[:] = self._last_shift, self.suspension.state[0]
        self._scale, self._at, self._known = [scale], 0, ([], [])

    def plan(self, plane: Plane, swinging: Mask) -> None:
        """Lays out what the coming steps ask: planned feet (n, 6) x + i y [m], and which of them (6,) swing throughout."""
        self.shares = even_shares(plane, ~swinging, self._weight, self._centre)
        self._preloads, self._swinging = (self._preload * self.shares).tolist(), swinging.tolist()
        loads = np.minimum(self._per_share * self.shares, LARGEST_LOAD).T.tolist()
        follow, smoothed = self._follow, []
        for planned, scale in zip(loads, self._scale[self._at], strict=True):
            last = scale
            smoothed.append([last] + [last := last + follow * (load - last) for load in planned])
        self._scale, self._at = list(zip(*smoothed, strict=True)), 0

    def step(self, push: Plane, normal: Array, contact: Mask) -> Feet:
        """One planned period on: shift and lift of the feet, and their rates.

        push, normal: (6,) ground on foot in the walking frame, x + i y and z [N]; contact: (6,) measured.
        """
        preloads = self._preloads[self._at]
        self._at += 1
        swinging, touching = self._swinging, contact.tolist()
        loads = [f if touches and f > 0.0 else 0.0 for f, touches in zip(normal.tolist(), touching, strict=True)]
        self._split([f if touches else 0j for f, touches in zip(push.tolist(), touching, strict=True)], loads)
        if (swinging, touching) != self._known:
            self._forget(swinging, touching)
        self._yield()
        self.excess = [0.0 if swings else f - held for f, held, swings in zip(loads, preloads, swinging, strict=True)]
        lift, lift_rate = self.suspension.step(self.excess)
        self.lift[:] = lift
        return self._last_shift, lift, self.shift_rate, lift_rate

    def _split(self, push: Sequence[complex], loads: Sequence[float]) -> None:
        """squeeze = f_t - (f_n / sum f_n) sum f_t over the feet in contact."""
        total = sum(loads)
        common = sum(push) / total if total > LOAD_FLOOR else 0j
        self.squeeze = [f - load * common for f, load in zip(push, loads, strict=True)]

    def _forget(self, swinging: list[bool], touching: list[bool]) -> None:
        """The PID starts afresh when its foot has lifted off; until it is back nothing pushes it."""
        self._known = swinging, touching
        self.pid.reset([swings and not touches for swings, touches in zip(swinging, touching, strict=True)])

    def _yield(self) -> None:
        """shift = PID(squeeze) x smoothed share in thirds of the weight."""
        shift = [u * scale for u, scale in zip(self.pid.step(self.squeeze), self._scale[self._at], strict=True)]
        self.shift_rate = [(new - old) * self._per_second for new, old in zip(shift, self._last_shift, strict=True)]
        self._last_shift, self.shift[:] = shift, shift


def even_shares(feet: Plane, standing: Mask, weight: float, centre: complex) -> Array:
    """(n, 6) what each foot carries [N]: least squares with sum f = weight and no moment about the centre of mass; never negative.

    f = a + b x + c y over the standing feet (6,), the same in all rows, p = x + i y [m] from the centre:
    (n sx sy; sx sxx sxy; sy sxy syy) (a b c) = (weight 0 0), with sums s over the standing feet.
    """
    shares, arm = np.zeros(feet.shape), feet.T[standing] - centre
    x, y, n = arm.real, arm.imag, max(len(arm), 1)
    sx, sy, sxx, sxy, syy = x.sum(axis=0), y.sum(axis=0), (x * x).sum(axis=0), (x * y).sum(axis=0), (y * y).sum(axis=0)
    a, b, c = sxx * syy - sxy * sxy, sxy * sy - sx * syy, sx * sxy - sxx * sy
    determinant = n * a + sx * b + sy * c
    solvable = determinant >= DETERMINANT_FLOOR
    per = weight / np.where(solvable, determinant, 1.0)
    shares[:, standing] = np.where(solvable, np.maximum((a + b * x + c * y) * per, 0.0), weight / n).T
    return shares
