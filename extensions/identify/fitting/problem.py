"""The residuals of logs and their derivatives, as functions of the unknown numbers.

A residual is (predicted - measured) / noise of a reading. Numbers are distances z from the robot
file's, in units of what was known of them beforehand (priors), which are the last residuals.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from queue import SimpleQueue

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.extensions.identify.experiment import (
    Experiment,
    first_part,
    needs_simulation,
    readings,
    simulated,
)
from hexapod_cosim.extensions.identify.fitting.covariance import Series
from hexapod_cosim.extensions.identify.fitting.least_squares import (
    ROUGH,
    Differences,
    Slopes,
    differences,
)
from hexapod_cosim.extensions.identify.log import CHANNELS, LogError
from hexapod_cosim.extensions.identify.numbers import Unknown
from hexapod_cosim.extensions.identify.plant import LogPlant
from hexapod_cosim.extensions.identify.unknowns import is_delay
from hexapod_cosim.models import FmuError, Robot
from hexapod_cosim.models.arrays import Array

Flags = NDArray[np.bool_]
ALL = tuple(channel.key for channel in CHANNELS)
TO_DEVIATION = 1.4826  # from the median of absolute values, of a normal distribution
MOST_RESIDUALS = 150_000  # rows are thinned evenly where there would be more
# A reading is left out around a jump of the simulated signal: there a shift in time by a fraction
# of a row, of which a difference says nothing, is a large error.
JUMP = 1.0  # second difference of a simulated signal [deviations]
BESIDE = 6  # rows before and after a jump
BENT = 0.05  # deviations    second difference over short steps of a number, of a reading that jumps
FLOOR = 1e-9  # smallest noise, in the units of the channels


class Problem:
    """Residuals and derivatives; readings of all fitted rows are in one array (predictions,).

    Args:
        plants: FMUs of one robot; simulations for derivatives run on all of them at a time.
        robot: this robot.
        experiments: what is compared.
        rows: the unknown numbers.
        most: residuals, at most about.
    """

    def __init__(
        self,
        plants: Sequence[LogPlant],
        robot: Robot,
        experiments: Sequence[Experiment],
        rows: Sequence[Unknown],
        *,
        most: int = MOST_RESIDUALS,
    ) -> None:
        self.plants, self.robot = plants, robot
        self.experiments, self.rows = tuple(experiments), tuple(rows)
        self.before = {row.key: row.read(robot) for row in rows}
        self.noise: dict[str, float] = {}  # by channel
        self._kept: Flags = np.zeros(len(rows), dtype=np.bool_)  # see `keeping`
        self._needs = np.array([needs_simulation(row) for row in rows], dtype=np.bool_)
        self.use({})
        own = [np.arange(*one.fitted.indices(len(one.log.time))) for one in experiments]
        size = sum(len(a) * len(one.columns) for a, one in zip(own, experiments, strict=True))
        self._fitted = [one[:: -(-size // most)] for one in own]
        self._measured = self._flat([one.measured for one in experiments])
        channels = [[ALL.index(key) for key in one.channels] for one in experiments]
        sides = zip(channels, self._fitted, strict=True)
        self._channels = np.concatenate([np.tile(keys, len(own)) for keys, own in sides])
        self.known = np.isfinite(self._measured)  # which readings are numbers
        self.counted = self.known.copy()  # and which of them count

    def _flat(self, tables: Sequence[Array]) -> Array:
        """Returns the fitted rows that are not thinned out of tables (rows, columns)."""
        pairs = zip(tables, self._fitted, strict=True)
        return np.concatenate([table[rows].ravel() for table, rows in pairs])

    def shortened(
        self, seconds: float, *, parameters: Mapping[str, float], most: int = MOST_RESIDUALS
    ) -> Problem:
        """Returns the problem of the first seconds of the logs, without held-out rows.

        parameters: further ones of the FMU, by name.
        """
        parts = [first_part(one, seconds) for one in self.experiments]
        found = Problem(self.plants, self.robot, parts, self.rows, most=most)
        found.use(parameters)
        return found

    def use(self, parameters: Mapping[str, float]) -> None:
        """Replaces the further parameters of the FMU."""
        self.parameters = dict(parameters)
        self._outputs: tuple[bytes, list[Array]] = (b"", [])  # of the last numbers
        self._differences: Differences | None = None  # the last ones

    def bounds(self) -> tuple[Array, Array]:
        """Returns the limits of z, which are 0 of numbers that are kept."""
        low, high = zip(*(row.bounds(self.before[row.key]) for row in self.rows), strict=True)
        return np.where(self._kept, 0.0, low), np.where(self._kept, 0.0, high)

    @contextmanager
    def keeping(self, numbers: Flags) -> Iterator[None]:
        """Keeps some numbers (rows,) at the robot file's values, z = 0, within the block."""
        before, self._kept = self._kept, numbers
        yield
        self._kept = before

    def values(self, z: Array) -> dict[str, float]:
        """Returns the numbers by key."""
        pairs = zip(self.rows, z.tolist(), strict=True)
        return {row.key: row.value(one, self.before[row.key]) for row, one in pairs}

    def predictions(self, z: Array) -> list[Array]:
        """Returns the readings of each experiment (rows, columns)."""
        key = z[self._needs].tobytes()
        if self._outputs[0] != key or not self._outputs[1]:
            self._outputs = key, self._simulated(z, self.plants[0])
        return self._read(self._outputs[1], z)

    def _simulated(self, z: Array, plant: LogPlant) -> list[Array]:
        values = self.values(z)
        return [
            simulated(plant, one, self.robot, self.rows, values, self.parameters)
            for one in self.experiments
        ]

    def _read(self, outputs: Sequence[Array], z: Array) -> list[Array]:
        values = self.values(z)
        pairs = zip(self.experiments, outputs, strict=True)
        return [readings(one, own, values) for one, own in pairs]

    def errors(self, z: Array) -> Array:
        """Returns predicted - measured (predictions,); 0 where a reading does not count."""
        return np.where(self.counted, self._flat(self.predictions(z)) - self._measured, 0.0)

    def residuals(self, z: Array) -> Array:
        """Returns all residuals in deviations; infinite ones where the plant refuses z."""
        try:
            return np.concatenate([self.errors(z) / self._noises(), z])
        except (LogError, FmuError):
            return np.full(len(self._measured) + len(z), np.inf)

    def _noises(self) -> Array:
        """Returns the noise of each prediction (predictions,)."""
        found: Array = np.array([self.noise.get(key, 1.0) for key in ALL])[self._channels]
        return found

    def set_noise(
        self,
        errors: Array,
        *,
        share: float = 1.0,
        least: Mapping[str, float] | None = None,
        channels: Sequence[str] = ALL,
    ) -> None:
        """Sets the noise of each channel to a share of its typical error, at least `least`.

        Other channels than these count nothing from then on.
        """
        for k in np.unique(self._channels).tolist():
            own = np.abs(errors[(self._channels == k) & self.counted])
            # in which rare peaks count little
            typical = TO_DEVIATION * float(np.median(own)) if len(own) else 0.0
            noise = max(share * typical, (least or {}).get(ALL[k], 0.0), FLOOR)
            self.noise[ALL[k]] = noise if ALL[k] in channels else np.inf

    def leave_out_jumps(self, z: Array) -> None:
        """Makes readings count that are numbers and not beside a jump of the simulated signal."""
        tables = []
        for one, own in zip(self.experiments, self.predictions(z), strict=True):
            second = np.zeros(own.shape)
            second[1:-1] = np.diff(own, n=2, axis=0)
            jump = np.abs(second) > JUMP * np.array([self.noise[key] for key in one.channels])
            near = jump.copy()
            for shift in range(1, BESIDE + 1):
                near[shift:] |= jump[:-shift]
                near[:-shift] |= jump[shift:]
            tables.append(near.astype(float))
        self.counted = self.known & (self._flat(tables) == 0.0)

    def leave_out_bent(self, z: Array, made: Slopes) -> None:
        """Makes readings not count that jump between the numbers at which derivatives are made."""
        bent = self._known(z, made).bend / self._noises() > BENT
        self.counted = self.counted & ~bent

    def jacobian(self, z: Array, made: Slopes = ROUGH) -> Array:
        """Returns the residuals' derivatives (residuals, rows), by differences of simulations."""
        known = self._known(z, made)
        scale = np.where(self.counted, 1.0 / self._noises(), 0.0)
        return np.vstack([known.slopes * scale[:, None], np.eye(len(z))])

    def _known(self, z: Array, made: Slopes) -> Differences:
        """Returns the differences at z, or those near it that count there."""
        if self._differences is None or not self._differences.count_at(z, made):
            self._differences = self._made(z, made)
        return self._differences

    def _made(self, z: Array, made: Slopes) -> Differences:
        """Returns the differences of all predictions by each number."""
        base = self._flat(self.predictions(z))
        steps = [(k, step) for k in range(len(z)) for step in self._steps(k, z, made)]
        points = np.tile(z, (len(steps), 1))
        for point, (k, step) in zip(points, steps, strict=True):
            point[k] += step
        changes: list[list[tuple[float, Array]]] = [[] for _ in z]
        outputs = self._all_outputs(points, [bool(self._needs[k]) for k, _ in steps])
        for (k, step), point, own in zip(steps, points, outputs, strict=True):
            if own is not None:
                changes[k].append((step, self._flat(self._read(own, point)) - base))
        slopes, bend = np.zeros((len(base), len(z))), np.zeros(len(base))
        for k, row in enumerate(self.rows):
            slopes[:, k], second = differences(changes[k], len(base))
            if not is_delay(row):  # by which readings jump when a command comes
                np.maximum(bend, second, out=bend)
        return Differences(z.copy(), made, slopes, bend)

    def _steps(self, k: int, z: Array, made: Slopes) -> list[float]:
        """Returns the steps of the differences of a number within its limits."""
        row = self.rows[k]
        low, high = row.bounds(self.before[row.key])
        both = (made.step, -made.step)
        steps = [step for step in both if low <= z[k] + step <= high]
        return steps if made.both or is_delay(row) else steps[:1]

    def _all_outputs(self, points: Array, needed: Sequence[bool]) -> Iterator[list[Array] | None]:
        """Yields the simulated outputs at each point; None where the plant refuses it.

        needed: whether a point needs a simulation; one that moves a number of sensors does not.
        The simulations do not depend on the FMU that makes them, nor the result on their order.
        """
        base, idle = self._outputs[1], SimpleQueue[LogPlant]()
        for plant in self.plants:
            idle.put(plant)

        def simulate(z: Array) -> list[Array] | None:
            plant = idle.get()
            try:
                return self._simulated(z, plant)
            except (LogError, FmuError):
                return None
            finally:
                idle.put(plant)

        with ThreadPoolExecutor(len(self.plants)) as pool:
            found = pool.map(simulate, points[np.array(needed, dtype=np.bool_)])
            yield from (next(found) if own else base for own in needed)

    def series(self, jacobian: Array, residuals: Array) -> list[Series]:
        """Returns residuals and derivatives of each channel of each log, without the priors."""
        found, start = [], 0
        for one, rows in zip(self.experiments, self._fitted, strict=True):
            shape = len(rows), len(one.columns)
            part = slice(start, start + shape[0] * shape[1])
            start = part.stop
            counted, error = (own[part].reshape(shape) for own in (self.counted, residuals))
            slopes = jacobian[part].reshape(*shape, -1)
            channels = np.array(one.channels)
            for key in dict.fromkeys(one.channels):
                at = channels == key
                share = float(np.mean(counted[:, at]))
                found.append(Series(error[:, at], slopes[:, at], share))
        return found
