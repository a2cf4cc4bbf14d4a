"""Computes the linear part of the force laws: slip PID, virtual suspension and smoothed load.

C: foot_law.c.
"""

from __future__ import annotations

import math

import numpy as np

from hexapod_cosim.controller.comply.slip_pid import SlipPid
from hexapod_cosim.controller.comply.suspension import discretise
from hexapod_cosim.controller.gains import Gains
from hexapod_cosim.controller.memory import Stateful
from hexapod_cosim.controller.plane import LEGS, Array, Plane


class FootLaw(Stateful):
    """Slip PIDs and suspensions of six feet.

    Attributes, (6,) each:
        pid: the slip PIDs.
        answer: output forces of the PIDs, x + i y [N].
        deflection, rate: of the suspensions [m, m/s].
        load: smoothed load of the feet in thirds of the weight [1].
    """

    STATE = ("pid", "answer", "deflection", "rate", "load")

    def __init__(self, gains: Gains, *, period: float) -> None:
        self.pid = SlipPid(gains.slip, period=period)
        self.a, self.b = discretise(gains.suspension, period=period)
        self.keep = math.exp(-period / gains.slip.load_time)
        self.reset()

    def reset(self) -> None:
        """Puts the laws of all feet to rest: no answer, deflection, rate or load."""
        self.pid.reset()
        self.answer: Plane = np.zeros(LEGS, dtype=np.complex128)
        self.deflection, self.rate, self.load = np.zeros((3, LEGS))

    def step(self, push: Plane, excess: Array, load: Array) -> None:
        """Advances the laws by one period.

        Args:
            push: (6,) tangential forces that the PIDs reduce, x + i y [N] (C25).
            excess: (6,) normal forces above the planned shares [N] (C26).
            load: (6,) measured loads in thirds of the weight [1] (C27).
        """
        z, rate, a, b = self.deflection, self.rate, self.a, self.b
        self.answer = self.pid.step(push)
        self.deflection = a[0, 0] * z + a[0, 1] * rate + b[0] * excess
        self.rate = a[1, 0] * z + a[1, 1] * rate + b[1] * excess
        self.load = self.keep * self.load + (1.0 - self.keep) * load
