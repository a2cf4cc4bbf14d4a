"""Repeats a walk in steps of 0.1 ms, reads the plant's measures, and calculates the same figures
from samples of force, velocity, torque and speed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.interface.names import foot_names, foot_vector_names, joint_names
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.master.signals import COMMANDED
from hexapod_cosim.cosim.results.window import JudgedWindow
from hexapod_cosim.cosim.run.plan import make_plan
from hexapod_cosim.cosim.run.plant import initialise_plant, open_plant
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.models import Servo

Array = NDArray[np.float64]

FINE = 1e-4  # s
LOADED = 0.01  # of the weight
NEARLY_SLIDING = 0.9  # of the friction cone
PEAK = foot_names("peak_force")  # N    within the last communication step
AFTER = 0.020  # s    after touch-down
WINDOW = 0.001  # s    over which a force rises
QUANTITIES = {
    "torque": joint_names("torque"),
    "speed": joint_names("speed"),
    "normal": foot_names("normal_force"),
    "tangential": foot_names("tangential_force"),
    "velocity": foot_vector_names("velocity"),
}


@dataclass(frozen=True)
class Samples:
    """Samples of a walk on flat ground in intervals of 0.1 ms.

    Each quantity has its values at the start of the interval, under the new command, and at its
    end, under the same command.
    """

    time: Array  # s    (n,) starts of the intervals
    torque: Array  # N m    (2, n, 18)
    speed: Array  # rad/s    (2, n, 18)
    normal: Array  # N    (2, n, 6)
    tangential: Array  # N    (2, n, 6)
    velocity: Array  # m/s    (2, n, 6, 3)

    def after(self, time: float) -> Samples:
        """Returns the intervals after a time [s]."""
        k = int(np.searchsorted(self.time, time - 0.5 * FINE))
        parts = (self.torque, self.speed, self.normal, self.tangential, self.velocity)
        return Samples(self.time[k:], *(part[:, k:] for part in parts))


@dataclass(frozen=True)
class Repeated:
    """A walk that was repeated in steps of 0.1 ms."""

    samples: Samples
    recording: Recording  # outputs of the plant at the macro-steps, in the rows of the walk


def repeated(scenario: Scenario, recording: Recording, *, begin: float) -> Repeated:
    """Repeats a scenario on the plant with the recorded commands, each held for a macro-step.

    Samples it after a time [s] and reads the plant's own outputs in the same run. Columns that are
    no outputs of the plant are taken from the given recording.
    """
    names = [name for names in QUANTITIES.values() for name in names]
    joints = [name for names in COMMANDED.values() for name in names]
    commands, per_step = recording.columns(joints), round(scenario.macro_step / FINE)
    count, first = round(scenario.duration / FINE), round(begin / FINE)
    rows, again = np.empty((2, count - first, len(names))), recording.data.copy()
    with open_plant(scenario) as plant:
        initialise_plant(plant, make_plan(scenario))
        outputs = [name for name in plant.names("output") if name in recording.names]
        places = [recording.names.index(name) for name in outputs]
        peaks = [recording.names.index(name) for name in PEAK]
        seen, inputs = plant.block(names), plant.block(joints)
        measures, peak = plant.block(outputs), plant.block(PEAK)
        largest = np.zeros(len(PEAK))
        for k in range(count + 1):
            peak.get()
            largest = np.maximum(largest, peak.values)
            if k % per_step == 0:
                measures.get()
                again[k // per_step, places] = measures.values
                again[k // per_step, peaks] = largest
                largest[:] = 0.0
            if k == count:
                break
            if k % per_step == 0:
                inputs.values[:] = commands[k // per_step]
                inputs.set()
            if k >= first:
                seen.get()
                rows[0, k - first] = seen.values
            plant.step(k * FINE, FINE)
            if k >= first:
                seen.get()
                rows[1, k - first] = seen.values
    times = FINE * np.arange(first, count, dtype=np.float64)
    return Repeated(as_samples(times, rows), Recording(recording.names, again))


def as_samples(times: Array, rows: Array) -> Samples:
    """Splits rows (2, times, variables) by the quantities."""
    torque, speed, normal, across, velocity = np.split(
        rows, np.cumsum([len(each) for each in QUANTITIES.values()])[:-1], axis=2
    )
    return Samples(times, torque, speed, normal, across, velocity.reshape(2, -1, 6, 3))


def sampled_metrics(
    before: Samples, walk: JudgedWindow, servo: Servo, *, mu: float
) -> dict[str, float]:
    """Returns the metrics that use the plant's measures, calculated from samples alone.

    before: samples that begin at least half a gait cycle before the walk's measured part, to
    recognise touch-downs that are bounces of an earlier landing. Weight, distance [m] and times are
    those of the walk.
    """
    samples = before.after(walk.begin)
    squares, work = integral(samples.torque**2), driven(samples)
    load, square = walk.weight * walk.distance, float(squares.sum())
    use = cone_use(samples, walk.weight, mu)
    p50, p95 = np.percentile(use, [50.0, 95.0])
    rates = landing_rates(before, apart=0.5 * walk.period, after=walk.begin)
    return {
        "slip_per_metre": float(loaded_slip(samples, walk.weight).sum()) / walk.distance,
        "cone_use_p50": float(p50),
        "cone_use_p95": float(p95),
        "cone_use_over_90": float(np.mean(use > NEARLY_SLIDING)),
        "peak_force": float(samples.normal.max()) / walk.weight,
        "loading_rate": float(np.percentile(rates, 95)) / walk.weight,
        "torque_rms": float(np.sqrt(square / (18.0 * walk.duration))),
        "servo_load_max": float(np.sqrt(squares.max() / walk.duration)) / servo.torque_continuous,
        "heat": square / walk.distance,
        "cost_of_transport": work / load,
        "electrical_cost": (work + square / servo.motor_constant**2) / load,
    }


def integral(values: Array) -> Array:
    """Integrates values (2, n, m) at the ends of the intervals by the trapezoidal rule."""
    return np.asarray(0.5 * FINE * values.sum(axis=(0, 1)))


def loaded_slip(samples: Samples, weight: float) -> Array:
    """Returns the distance [m] that each foot slides under load on flat ground (6,)."""
    speed = np.linalg.norm(samples.velocity[..., :2], axis=-1)
    return integral(np.where(samples.normal > LOADED * weight, speed, 0.0))


def cone_use(samples: Samples, weight: float, mu: float) -> Array:
    """Returns f_t/(mu f_n) of all samples (n,) of feet that bear load."""
    loaded = samples.normal > LOADED * weight
    return np.asarray(samples.tangential[loaded] / (mu * samples.normal[loaded]))


def driven(samples: Samples) -> float:
    """Returns the positive work [J] of all motors."""
    return float(integral(np.maximum(samples.torque * samples.speed, 0.0)).sum())


def landing_rates(samples: Samples, *, apart: float, after: float) -> list[float]:
    """Returns the largest rise [N/s] over 1 ms of each landing in the 20 ms after its touch-downs.

    Only landings after a time [s] are returned. Touch-downs of a foot less than `apart` [s] after
    the first one of a landing belong to it. Before a touch-down there is no force.
    """
    found: list[float] = []
    for begin, end in samples.normal.transpose(2, 0, 1):
        first, judged = -np.inf, False
        for k in np.flatnonzero((end > 0.0) & (begin == 0.0)):
            steepest = _steepest(samples.time + FINE, end, int(k))
            if samples.time[k] - first > apart:
                first = samples.time[k]
                judged = bool(samples.time[k] > after)
                found += [steepest] if judged else []
            elif judged:
                found[-1] = max(found[-1], steepest)
    return found


def _steepest(time: Array, force: Array, k: int) -> float:
    """Returns the largest rise [N/s] over 1 ms in the 20 ms after a touch-down in the interval that
    ends at sample k.

    The depth of a Hertzian contact is proportional to force^(2/3) and grows linearly at first,
    which gives the time of the touch-down within the interval.
    """
    depth = force[k : k + 2] ** (2.0 / 3.0)
    touch = time[k] - FINE * min(depth[0] / max(depth[1] - depth[0], 1e-300), 1.0)
    late = touch + FINE * np.arange(1.0, 0.5 + AFTER / FINE)
    early = late - WINDOW
    before = np.where(early > touch, np.interp(early, time, force), 0.0)
    return float((np.interp(late, time, force) - before).max()) / WINDOW
