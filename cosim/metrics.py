"""Figures of merit of a walk, from a recording of the FMU's outputs over whole gait cycles after the first two.

A figure that the recording cannot give (per metre for a robot that stands, anything for a run shorter than three cycles) is NaN.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.recorder import Recording
from hexapod_cosim.cosim.signals import foot_names, foot_vector_names, joint_names, vector_names
from hexapod_cosim.cosim.support import stability_margins
from hexapod_cosim.models import FRICTION_LAWS, LEG_NAMES, TERRAINS
from hexapod_cosim.models.contact import sliding_velocity

Array = NDArray[np.float64]

SKIPPED_CYCLES = 2  # the start is no walk yet
CONTACT_SHARE = 0.01  # of the weight: a foot with less does not stand
TANH_LIMIT = 0.999  # atanh beyond it would call sliding a creep
LOADING_TIME = 0.020  # s after touch-down
LEAST_DISTANCE = 0.01  # m    less is standing, not walking
SHOWN_CYCLES = 3  # in figures of what happens within a gait cycle
ROUND_OFF = 1e-6  # s    of a recorded time
FLAT = TERRAINS.index("flat") + 1  # the FMU's number of it
TANH, BRISTLE = (FRICTION_LAWS.index(law) + 1 for law in ("tanh", "bristle"))  # the FMU's numbers of them

# name -> unit, whether less is better (None: neither), meaning
METRICS: dict[str, tuple[str, bool | None, str]] = {
    "slip_per_metre": ("m/m", True, "way slipped by all feet under load, per metre walked"),
    "slip_net_per_metre": ("m/m", True, "the same, less the creep of the tanh friction law or what bristles give back"),
    "path_error": ("m/m", True, "distance from the end of the commanded path, per metre walked"),
    "yaw_drift": ("rad/m", True, "heading lost against the commanded one, per metre walked"),
    "height_rms": ("m", True, "torso height above the ground, about its mean"),
    "roll_rms": ("rad", True, "roll, about its mean"),
    "pitch_rms": ("rad", True, "pitch, about its mean"),
    "peak_force": ("BW", True, "largest foot normal force, in body weights"),
    "force_p95": ("BW", True, "95th percentile of the normal force of feet under load"),
    "loading_rate": ("BW/s", True, "95th percentile of the normal force's rate in the 20 ms after touch-down"),
    "torque_rms": ("N m", True, "motor torque over all joints and time"),
    "cost_of_transport": ("1", True, "positive motor work per weight and distance"),
    "stability_margin": ("m", False, "least distance of the centre of mass from the support polygon's edge"),
    "realtime_factor": ("1", None, "simulated over wall time of the whole loop"),
}

# what all this and the warnings of a run look at; of controllers, those that tell
_JUDGED = (
    *vector_names("torso.position"), *vector_names("torso.quaternion", 4), "torso.roll", "torso.pitch", "torso.yaw",
    *(name for quantity in ("angle", "speed", "torque") for name in joint_names(quantity)),
    *(name for quantity in ("normal_force", "tangential_force", "slip_speed", "contact") for name in foot_names(quantity)),
    *foot_vector_names("position"), *(f"controller.{leg}.{flag}" for flag in ("unreachable", "fallback") for leg in LEG_NAMES),
)  # fmt: skip
_JUDGED_BRISTLES = tuple(name for quantity in ("velocity", "bristle") for name in foot_vector_names(quantity))

# name -> the least change, in the metric's unit, that means anything: less than this no one could measure on the robot
# (a tenth of a millimetre, a tenth of a milliradian, the resolution of its force and torque sensing), so it reads "same"
FLOORS: dict[str, float] = {
    "slip_per_metre": 1e-4, "slip_net_per_metre": 1e-4, "path_error": 1e-3, "yaw_drift": 1e-3, "height_rms": 1e-4, "roll_rms": 1e-4,
    "pitch_rms": 1e-4, "peak_force": 5e-3, "force_p95": 5e-3, "loading_rate": 5e-2, "torque_rms": 5e-3, "cost_of_transport": 1e-3,
    "stability_margin": 1e-4, "realtime_factor": 0.0,
}  # fmt: skip
DUST = 1e-6  # of the floor: a value below it is round-off, and is shown as 0


def judged_columns(*, bristles: bool) -> tuple[str, ...]:
    """What has to be recorded of a robot for its metrics and warnings; `bristles`: whether its friction has them."""
    return (*_JUDGED, *_JUDGED_BRISTLES) if bristles else _JUDGED


@dataclass(frozen=True)
class View:
    """A run, as metrics and figures see it."""

    recording: Recording
    parameters: Mapping[str, float]  # of the FMU
    period: float  # s    of the gait

    @cached_property
    def walk(self) -> Walk | None:
        """Whole gait cycles after the first two; None when there is none."""
        return _cut_walk(self)

    def last_cycles(self) -> View:
        """The end of the run."""
        time = self.recording.time
        begin = int(np.searchsorted(time, time[-1] - SHOWN_CYCLES * self.period))
        return View(self.recording.rows(slice(begin, None)), self.parameters, self.period)


@dataclass(frozen=True)
class Walk:
    """The part of a recording that is judged, and what it is measured by."""

    recording: Recording
    distance: float  # m    walked, NaN when it is standing
    weight: float  # N
    turned: Array  # rad    (rows,) commanded turn since the first row
    heading: float  # rad    of the commanded path at the first row


def compute_metrics(view: View, *, realtime_factor: float) -> dict[str, float]:
    """All figures of METRICS."""
    walk, parameters = view.walk, view.parameters
    if walk is None:
        return dict.fromkeys(METRICS, np.nan) | {"realtime_factor": realtime_factor}
    figures = _slip(walk, parameters) | _path(walk) | _posture(walk, parameters) | _force(walk) | _effort(walk)
    margins = stability_margins(walk.recording, parameters)
    figures["stability_margin"] = float(np.nanmin(margins)) if np.isfinite(margins).any() else np.nan
    figures["realtime_factor"] = realtime_factor
    return {name: float(figures[name]) for name in METRICS}


def _cut_walk(view: View) -> Walk | None:
    recording, period = view.recording, view.period
    time = recording.time - recording.time[0] if len(recording.time) else np.zeros(1)
    cycles = int((time[-1] + ROUND_OFF) / period)
    if cycles <= SKIPPED_CYCLES:
        return None
    begin, end = np.searchsorted(time, [SKIPPED_CYCLES * period - ROUND_OFF, cycles * period + ROUND_OFF])
    part = recording.rows(slice(begin, end))
    turned = _held_integral(part.time, part.column("command.yaw_rate"))
    yaw = np.unwrap(part.column("torso.yaw"))
    # the torso's yaw swings within a cycle: the commanded path sets out along its mean over the first one
    first = part.time < part.time[0] + period - ROUND_OFF
    heading = float(np.mean((yaw - turned)[first]))
    return Walk(part, _distance(part, period), robot_weight(view.parameters), turned, heading)


def robot_weight(parameters: Mapping[str, float]) -> float:
    """Weight [N] of the robot that an FMU's parameters describe."""
    mass = sum(value for name, value in parameters.items() if name.endswith(".mass"))
    return float(mass * np.linalg.norm([parameters[name] for name in vector_names("gravity")]))


def _distance(part: Recording, period: float) -> float:
    """Way of the torso from cycle to cycle, so that its bobbing within a cycle does not count."""
    cycles = round((part.time[-1] - part.time[0]) / period)
    marks = part.time[0] + period * np.arange(cycles + 1)
    positions = np.column_stack([np.interp(marks, part.time, column) for column in part.vector("torso.position").T])
    walked = float(np.linalg.norm(np.diff(positions, axis=0), axis=1).sum())
    return walked if walked >= LEAST_DISTANCE else np.nan


def _held_integral(time: Array, rate: Array) -> Array:
    """Running integral of a rate that is held from each row to the next."""
    return np.concatenate([[0.0], np.cumsum(rate[:-1] * np.diff(time))])


def _slip(walk: Walk, parameters: Mapping[str, float]) -> dict[str, float]:
    part = walk.recording
    loaded = bearing_load(part, parameters)
    slips = {"slip_per_metre": part.feet("slip_speed"), "slip_net_per_metre": _net_slip(part, parameters, loaded)}
    return {name: _integral(part.time, np.where(loaded, value, 0.0)) / walk.distance for name, value in slips.items()}


def _net_slip(part: Recording, parameters: Mapping[str, float], loaded: NDArray[np.bool_]) -> Array:
    """(rows, 6) slip speed less what the friction law makes of sticking: the tanh law's creep, a bristle's stretching and its return."""
    mu, normal, speed = parameters["friction.mu"], part.feet("normal_force"), part.feet("slip_speed")
    if parameters.get("friction.law", TANH) == BRISTLE:
        sliding = sliding_velocity(parameters["friction.presliding"], part.foot_vectors("velocity"), part.foot_vectors("bristle"))
        return np.asarray(np.linalg.norm(sliding, axis=-1))
    share = np.divide(part.feet("tangential_force"), mu * normal, out=np.zeros_like(normal), where=loaded & (mu > 0.0))
    creep = np.arctanh(np.minimum(share, TANH_LIMIT)) / parameters["friction.slope"]
    return np.maximum(speed - creep, 0.0)


def bearing_load(recording: Recording, parameters: Mapping[str, float]) -> NDArray[np.bool_]:
    """(rows, 6) whether a foot bears more than CONTACT_SHARE of the robot's weight: only then can it slip."""
    return np.asarray(recording.feet("normal_force") > CONTACT_SHARE * robot_weight(parameters))


def slip_under_load(recording: Recording, parameters: Mapping[str, float]) -> Array:
    """(rows, 6) speed along the ground [m/s], 0 of a foot that bears no load."""
    return np.where(bearing_load(recording, parameters), recording.feet("slip_speed"), 0.0)


def running_integral(time: Array, values: Array) -> Array:
    """Of values (rows, ...) over time, 0 at the first row; the trapezoidal rule."""
    steps = 0.5 * (values[1:] + values[:-1])
    width = np.diff(time).reshape(-1, *(1 for _ in values.shape[1:]))
    return np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(steps * width, axis=0)])


def _integral(time: Array, values: Array) -> float:
    """Over time, summed over everything else."""
    return float(np.trapezoid(values.reshape(len(time), -1).sum(axis=1), time))


def commanded_path(recording: Recording, *, heading: float | None = None) -> Array:
    """(rows, 2) where the body command leads from the first row's position on, world x and y [m].

    `heading` [rad] is the direction it sets out in; by default the torso's own at the first row.
    """
    begin = recording.vector("torso.position")[0, :2]
    heading = float(recording.column("torso.yaw")[0]) if heading is None else heading
    angle = heading + _held_integral(recording.time, recording.column("command.yaw_rate"))
    vx, vy = recording.column("command.vx"), recording.column("command.vy")
    velocity = (vx * np.cos(angle) - vy * np.sin(angle), vx * np.sin(angle) + vy * np.cos(angle))
    return begin + np.column_stack([_held_integral(recording.time, part) for part in velocity])


def _path(walk: Walk) -> dict[str, float]:
    part = walk.recording
    end = commanded_path(part, heading=walk.heading)[-1]
    yaw = np.unwrap(part.column("torso.yaw"))
    return {
        "path_error": float(np.linalg.norm(part.vector("torso.position")[-1, :2] - end)) / walk.distance,
        "yaw_drift": abs(float(yaw[-1] - yaw[0] - walk.turned[-1])) / walk.distance,
    }


def _posture(walk: Walk, parameters: Mapping[str, float]) -> dict[str, float]:
    part = walk.recording
    height = body_height(part, parameters)
    return {"height_rms": float(np.std(height)), "roll_rms": _angle_rms(part, "torso.roll"), "pitch_rms": _angle_rms(part, "torso.pitch")}


def body_height(part: Recording, parameters: Mapping[str, float]) -> Array:
    """(rows,) height of the torso above the ground along z [m]."""
    x, y, z = part.vector("torso.position").T
    heading, incline = parameters.get("terrain.heading", 0.0), parameters.get("terrain.incline", 0.0)
    slope = 0.0 if parameters.get("terrain.kind", FLAT) == FLAT else np.tan(incline)
    ground: Array = parameters.get("terrain.height", 0.0) + slope * (x * np.cos(heading) + y * np.sin(heading))
    return np.asarray(z - ground)


def _angle_rms(part: Recording, name: str) -> float:
    return float(np.std(np.unwrap(part.column(name))))


def _force(walk: Walk) -> dict[str, float]:
    part = walk.recording
    normal = part.feet("normal_force") / walk.weight
    loaded = normal[normal > CONTACT_SHARE]
    rates = loading_rates(part.time, normal, part.feet("contact") > 0.5)
    return {
        "peak_force": float(normal.max()),
        "force_p95": float(np.percentile(loaded, 95)) if len(loaded) else np.nan,
        "loading_rate": float(np.percentile(rates, 95)) if len(rates) else np.nan,
    }


def loading_rates(time: Array, force: Array, contact: NDArray[np.bool_]) -> Array:
    """Rates of a force (rows, feet) between rows that lie in the 20 ms after a touch-down, all feet together.

    A touch-down is a row in contact after one without; the rise from that last free row counts, for the foot touched in between.
    """
    rate = np.diff(force, axis=0) / np.diff(time)[:, None]
    touched = contact[1:] & ~contact[:-1]
    last = np.where(touched, time[1:, None], -np.inf)
    since = time[1:, None] - np.maximum.accumulate(last, axis=0)
    return rate[since <= LOADING_TIME + ROUND_OFF]


def _effort(walk: Walk) -> dict[str, float]:
    part = walk.recording
    torque, speed = part.joints("torque"), part.joints("speed")
    work = _integral(part.time, np.maximum(torque * speed, 0.0))
    return {"torque_rms": float(np.sqrt(np.mean(torque**2))), "cost_of_transport": work / (walk.weight * walk.distance)}
