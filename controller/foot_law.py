"""The linear part of a foot's laws as one discrete system, stepped for all feet by one product of
matrices.

A foot's row holds its inputs and states; the system is the block-diagonal of the slip PID along x
and along y, the virtual suspension and the smoothing of the load. Attributes are views of the new
row, so that what limits and forgets works in place.
"""

from __future__ import annotations

import math

import numpy as np

from hexapod_cosim.controller import slip_pid, suspension
from hexapod_cosim.controller.gains import Gains
from hexapod_cosim.controller.kinematics import LEGS, Array

# columns of a row: answers of the PID, its states by direction, those of the suspension, the load,
# the inputs
ANSWER, LAST, SMOOTH, SUM, SLOPE = (slice(k, k + 2) for k in (0, 2, 4, 6, 8))
SUSPENSION, LOAD, INPUTS = slice(10, 12), 12, slice(13, 17)
PUSH_X, PUSH_Y, EXCESS, SHARE = range(13, 17)
COLUMNS = 18  # one more, so that columns pair up to complex numbers


class FootLaw:
    """Six feet. Inputs: tangential force x, y and normal force to give way to [N], load [1].

    Attributes, views: inputs: (6, 4);  answer: (6, 2) of the PID [N];  integral: (6, 2) its [N];
    deflection, rate: (6,) of the suspension [m, m/s];  load: (6,) smoothed [1].
    """

    def __init__(self, gains: Gains, *, period: float) -> None:
        self._step = law_matrix(gains, period=period)
        self.row, self._next = np.zeros((2, LEGS, COLUMNS))
        self.inputs, self.answer, self.integral, self.load = (
            self.row[:, INPUTS],
            self.row[:, ANSWER],
            self.row[:, SUM],
            self.row[:, LOAD],
        )
        self.deflection, self.rate = self.row[:, SUSPENSION].T

    def reset(self) -> None:
        """Everything at rest."""
        self.row[...] = 0.0

    def step(self) -> None:
        """One period on, under the inputs as they are."""
        np.dot(self.row, self._step, out=self._next)
        self.row[...] = self._next


def law_matrix(gains: Gains, *, period: float) -> Array:
    """(18, 18) acts on a foot's row from the right. The inputs' columns come out as 0."""
    matrix = np.zeros((COLUMNS, COLUMNS))
    pid = slip_pid.system(gains.slip, period=period)  # on e-, e'-, i-, d-, e; gives u, e, e', i, d
    for axis, force in enumerate((PUSH_X, PUSH_Y)):
        states = [part.start + axis for part in (LAST, SMOOTH, SUM, SLOPE)]
        matrix[np.ix_([*states, force], [ANSWER.start + axis, *states])] = pid
    a, b = suspension.discretise(gains.suspension, period=period)
    deflection = [SUSPENSION.start, SUSPENSION.start + 1]
    matrix[np.ix_(deflection, deflection)], matrix[np.ix_([EXCESS], deflection)] = a.T, b
    keep = math.exp(-period / gains.slip.load_time)
    matrix[LOAD, LOAD], matrix[SHARE, LOAD] = keep, 1.0 - keep
    return matrix
