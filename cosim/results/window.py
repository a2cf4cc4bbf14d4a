"""Cuts out the part of a run that metrics use: whole gait cycles after the first two.

Of a drop it is the whole run.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.interface.names import foot_names, joint_names, vector_names
from hexapod_cosim.cosim.master.recorder import COMMAND_COLUMNS, Recording
from hexapod_cosim.models import FRICTION_LAWS
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.friction import LAWS, FrictionLaw
from hexapod_cosim.models.ground.surface import Surface

SKIPPED_CYCLES = 2  # the start is not yet a steady walk
CONTACT_SHARE = 0.01  # of the weight: a foot with less load does not stand
LIFT = 1e-3  # m    lifting the robot by it is the least work that the residual is compared with
LEAST_DISTANCE = 0.01  # m    less is standing, not walking
LEAST_TURN = 0.05  # rad    less is standing, not turning
SHOWN_CYCLES = 3  # in plots of what happens within a gait cycle
ROUND_OFF = 1e-6  # s    of a recorded time


def law_name(parameters: Mapping[str, float]) -> str:
    """Returns the name of the friction law of a run; by default that of the robot file."""
    return FRICTION_LAWS[round(parameters.get("friction.law", 1.0)) - 1]


def friction_law(parameters: Mapping[str, float]) -> FrictionLaw:
    """Returns the row of the friction law of a run."""
    return LAWS[law_name(parameters)]


@dataclass(frozen=True)
class View:
    """A run as metrics and plots use it."""

    recording: Recording
    parameters: Mapping[str, float]  # of the FMU
    period: float  # s    of the gait
    surface: Surface | None = None  # around the walk, for reports; None: a plane, or not needed

    @cached_property
    def window(self) -> JudgedWindow | None:
        """Whole gait cycles after the first two; None when there is none. A drop is whole."""
        return _whole_drop(self) if is_drop(self.recording) else _judged_window(self)

    @cached_property
    def energy_residual(self) -> float:
        """Largest |energy.residual| over the work of the motors; NaN without rows."""
        recording = self.recording
        if not len(recording.time):
            return np.nan
        residual = recording.column("energy.residual")
        works = recording.columns([*joint_names("positive_work"), *joint_names("negative_work")])
        work = float((works[-1] - works[0]).sum())
        missing = float(np.abs(residual - residual[0]).max())
        return missing / max(work, LIFT * robot_weight(self.parameters)) if missing else 0.0

    def last_cycles(self) -> View:
        """Returns the last SHOWN_CYCLES gait cycles of the run."""
        time = self.recording.time
        begin = int(np.searchsorted(time, time[-1] - SHOWN_CYCLES * self.period))
        return replace(self, recording=self.recording.rows(slice(begin, None)))


@dataclass(frozen=True, kw_only=True)
class JudgedWindow:
    """The part of a run that metrics use, and the quantities that they refer to."""

    whole: Recording  # the run
    recording: Recording  # its rows from begin to end, both included
    begin: float  # s
    end: float  # s
    period: float  # s    of the gait
    distance: float  # m    walked; NaN when standing or turning on the spot
    angle: float  # rad    turned on the spot; NaN when standing or walking
    weight: float  # N
    turned: Array  # rad    (rows,) commanded turn since the first row
    heading: float  # rad    of the commanded path at the first row

    @cached_property
    def weights(self) -> Array:
        """Share of the measured time that each row represents (rows,), by the trapezoidal rule."""
        return time_shares(self.recording.time)

    @property
    def duration(self) -> float:
        """Returns the length of the measured part [s]."""
        return self.end - self.begin

    def gained(self, names: list[str]) -> Array:
        """Returns the growth of cumulative outputs (names,) from begin to end, interpolated."""
        begin, end = (_values_at(self.whole, names, t) for t in (self.begin, self.end))
        return np.asarray(end - begin)

    def rms(self, values: Array) -> float:
        """Returns the RMS deviation of values (rows,) from their mean over time."""
        return float(np.sqrt(self.weights @ (values - self.weights @ values) ** 2))

    def steps(self) -> slice:
        """Returns the rows of the whole run after begin, up to end."""
        first, last = np.searchsorted(self.whole.time, np.array([self.begin, self.end]) + ROUND_OFF)
        return slice(int(first), int(last))


def _values_at(recording: Recording, names: Sequence[str], t: float) -> Array:
    """Returns variables (names,) at a time of the recording, by linear interpolation."""
    time = recording.time
    before = int(np.searchsorted(time, t, side="right")) - 1
    if before == len(time) - 1:  # the time is rounded, and the last row may be before it
        last: Array = recording.rows(slice(before, None)).columns(names)[0]
        return last
    (low, high), first = recording.rows(slice(before, before + 2)).columns(names), time[before]
    return np.asarray((high - low) / (time[before + 1] - first) * (t - first) + low)


def time_shares(time: Array) -> Array:
    """Returns the weights of the trapezoidal rule (rows,), as shares of the whole time."""
    steps = np.diff(time)
    weights = np.append(steps, 0.0) + np.insert(steps, 0, 0.0)
    return np.asarray(weights / weights.sum())


def _judged_window(view: View) -> JudgedWindow | None:
    recording, period = view.recording, view.period
    time = recording.time
    cycles = int((time[-1] - time[0] + ROUND_OFF) / period) if len(time) else 0
    if cycles <= SKIPPED_CYCLES:
        return None
    begin, end = time[0] + SKIPPED_CYCLES * period, time[0] + cycles * period
    part = _between(recording, begin, end)
    turned = hold_integral(part.time, part.column("command.yaw_rate"))
    yaw = np.unwrap(part.column("torso.yaw"))
    marks = begin + period * np.arange(cycles - SKIPPED_CYCLES + 1)
    distance, angle = _ways(part, yaw, marks)
    # the torso's yaw swings within a cycle, so the commanded path starts along its mean over the
    # first cycle
    first = part.time <= begin + period + ROUND_OFF
    heading = float(time_shares(part.time[first]) @ (yaw - turned)[first])
    return JudgedWindow(
        whole=recording,
        recording=part,
        begin=begin,
        end=end,
        period=period,
        distance=distance,
        angle=angle,
        weight=robot_weight(view.parameters),
        turned=turned,
        heading=heading,
    )


def is_drop(recording: Recording) -> bool:
    """Returns whether a run begins with all feet in the air and has no command."""
    needed = {*COMMAND_COLUMNS, *foot_names("contact")}
    if len(recording.time) < 2 or not needed <= set(recording.names):
        return False
    return not (
        recording.columns(list(COMMAND_COLUMNS)).any() or recording.feet("contact")[0].any()
    )


def _whole_drop(view: View) -> JudgedWindow:
    """Returns all of a drop, whose impacts come first; it has no figures per metre or radian."""
    recording, time = view.recording, view.recording.time
    return JudgedWindow(
        whole=recording,
        recording=recording,
        begin=float(time[0]),
        end=float(time[-1]),
        period=view.period,
        distance=math.nan,
        angle=math.nan,
        weight=robot_weight(view.parameters),
        turned=np.zeros_like(time),
        heading=float(recording.column("torso.yaw")[0]),
    )


def _between(recording: Recording, begin: float, end: float) -> Recording:
    """Returns the rows from begin to end, with rows interpolated at these times if needed."""
    time = recording.time
    first, last = np.searchsorted(time, [begin - ROUND_OFF, end + ROUND_OFF])
    ends = [t for t, row in ((begin, first), (end, last - 1)) if abs(time[row] - t) > ROUND_OFF]
    if not ends:
        return recording.rows(slice(first, last))
    added = np.array([_row_at(recording, t) for t in ends])
    data = np.concatenate([recording.data[first:last], added])
    return Recording(recording.names, data[np.argsort(data[:, 0], kind="stable")])


def _row_at(recording: Recording, t: float) -> Array:
    """Returns a row at time t by interpolation, but commands hold from a row to the next."""
    after = int(np.searchsorted(recording.time, t))
    before, behind = recording.data[after - 1], recording.data[after]
    share = (t - before[0]) / (behind[0] - before[0])
    row = before + share * (behind - before)
    held = [k for k, name in enumerate(recording.names) if name in COMMAND_COLUMNS]
    row[held] = before[held]
    return np.asarray(row)


def _ways(part: Recording, yaw: Array, marks: Array) -> tuple[float, float]:
    """Returns metres walked and radians turned on the spot, NaN for the one that does not apply.

    Both are summed from cycle to cycle, so that motion within a cycle does not count. A robot that
    is never commanded to walk turns on the spot, even if its feet slip.
    """
    places = [np.interp(marks, part.time, each) for each in part.vector("torso.position").T]
    walked = float(np.linalg.norm(np.diff(np.column_stack(places), axis=0), axis=1).sum())
    turned = float(np.abs(np.diff(np.interp(marks, part.time, yaw))).sum())
    on_the_spot = not part.columns(["command.vx", "command.vy"])[:-1].any()
    if on_the_spot and turned >= LEAST_TURN:
        return np.nan, turned
    return (walked if walked >= LEAST_DISTANCE else np.nan), np.nan


def robot_weight(parameters: Mapping[str, float]) -> float:
    """Returns the weight [N] of the robot that an FMU's parameters describe."""
    mass = sum(parameters[name] for name in _masses(tuple(parameters)))
    return float(mass * np.linalg.norm([parameters[name] for name in vector_names("gravity")]))


@lru_cache(maxsize=16)
def _masses(names: tuple[str, ...]) -> tuple[str, ...]:
    """Returns which of an FMU's parameters are masses."""
    return tuple(name for name in names if name.endswith(".mass"))


def hold_integral(time: Array, rate: Array) -> Array:
    """Returns the running integral (rows,) of a rate that holds from each row to the next."""
    return np.concatenate([[0.0], np.cumsum(rate[:-1] * np.diff(time))])


def running_integral(time: Array, values: Array) -> Array:
    """Returns the running integral of values (rows, ...) by the trapezoidal rule."""
    steps = 0.5 * (values[1:] + values[:-1])
    width = np.diff(time).reshape(-1, *(1 for _ in values.shape[1:]))
    return np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(steps * width, axis=0)])


def bearing_load(recording: Recording, parameters: Mapping[str, float]) -> NDArray[np.bool_]:
    """Returns whether each foot bears more than CONTACT_SHARE of the weight (rows, 6)."""
    return np.asarray(recording.feet("normal_force") > CONTACT_SHARE * robot_weight(parameters))


def slip_under_load(recording: Recording, parameters: Mapping[str, float]) -> Array:
    """Returns the slip speed along the ground [m/s] (rows, 6), 0 for feet without load."""
    return np.where(bearing_load(recording, parameters), recording.feet("slip_speed"), 0.0)


def commanded_path(recording: Recording, *, heading: float | None = None) -> Array:
    """Returns the path of the body command from the first row on (rows, 2), world x and y [m].

    `heading` [rad] is its initial direction; by default the torso's own in the first row.
    """
    begin = recording.vector("torso.position")[0, :2]
    heading = float(recording.column("torso.yaw")[0]) if heading is None else heading
    angle = heading + hold_integral(recording.time, recording.column("command.yaw_rate"))
    vx, vy = recording.column("command.vx"), recording.column("command.vy")
    velocity = (vx * np.cos(angle) - vy * np.sin(angle), vx * np.sin(angle) + vy * np.cos(angle))
    return begin + np.column_stack([hold_integral(recording.time, part) for part in velocity])
