"""Metrics of a walk over whole gait cycles after the first two.

Work, heat, slip and peaks are integrals and maxima of the plant itself, so they do not depend on
how often it is read. Distributions over time (forces, friction cone, posture, feet) use the rows
given: one per macro-step in a run, whatever it records. A metric that the recording cannot give
(per metre for a robot that stands, any metric of a run shorter than three cycles) is NaN.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.interface.names import (
    foot_names,
    foot_vector_names,
    joint_names,
    vector_names,
)
from hexapod_cosim.cosim.master.connection import FLAGS
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.results.metric_table import METRICS, PER_RADIAN, Metrics
from hexapod_cosim.cosim.results.support import body_height, real_feet, stability_margins
from hexapod_cosim.cosim.results.window import (
    CONTACT_SHARE,
    JudgedWindow,
    View,
    bearing_load,
    commanded_path,
    friction_law,
    law_name,
)
from hexapod_cosim.models import LEG_NAMES, Friction, Servo
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.friction import yielding_velocity
from hexapod_cosim.models.measure import CONE_BINS, CONE_STARTS

PLANNED = tuple(name for leg in LEG_NAMES for name in vector_names(f"controller.{leg}.planned"))
# Time of all feet under load by the share of the friction cone used: bins begin at 0.9 (i/30)^2,
# the last holds all above 0.9
CONE_TIMES = tuple(vector_names("feet.cone_time", CONE_BINS))
_CONE_EDGES = np.append(CONE_STARTS, 1.0)


def _each(names: Callable[[str], Iterable[str]], *quantities: str) -> tuple[str, ...]:
    return tuple(name for quantity in quantities for name in names(quantity))


# outputs that the plant integrates or tracks for the metrics
MEASURED_BY_PLANT = (
    *_each(joint_names, "positive_work", "negative_work", "torque_squared"),
    *_each(foot_names, "slip_distance", "peak_force", "landing_rate", "landings"),
    *CONE_TIMES,
    "energy.residual",
)
# outputs that metrics and warnings use; the controller's only if it has them
_JUDGED = (
    *vector_names("torso.position"),
    *vector_names("torso.quaternion", 4),
    *("torso.roll", "torso.pitch", "torso.yaw"),
    *joint_names("angle"),
    *MEASURED_BY_PLANT,
    *_each(foot_names, "normal_force", "tangential_force", "slip_speed", "contact"),
    *foot_vector_names("position"),
    *(f"controller.{leg}.{flag}" for flag in FLAGS for leg in LEG_NAMES),
    *PLANNED,
)
_JUDGED_BRISTLES = _each(foot_vector_names, "velocity", "bristle")


def metric_columns(*, bristles: bool) -> tuple[str, ...]:
    """Returns the columns that metrics and warnings need; `bristles`: of a bristle friction law."""
    return (*_JUDGED, *_JUDGED_BRISTLES) if bristles else _JUDGED


def compute_metrics(view: View, *, servo: Servo, realtime_factor: float) -> Metrics:
    """Computes all METRICS of a run; the servo gives continuous rating and motor constant."""
    window = view.window
    of_the_run = {"energy_residual": view.energy_residual, "realtime_factor": realtime_factor}
    if window is None:
        return Metrics(dict.fromkeys(METRICS, np.nan) | of_the_run)
    parameters = view.parameters
    figures = _slip(window, parameters) | _cone(window, parameters) | _feet(window, parameters)
    figures |= (
        _path(window) | _posture(window, parameters) | _force(window) | _effort(window, servo)
    )
    margins = stability_margins(window.recording, parameters)
    figures["stability_margin"] = (
        float(np.nanmin(margins)) if np.isfinite(margins).any() else np.nan
    )
    figures |= of_the_run
    return Metrics((name, float(figures[name])) for name in METRICS)


def _per(window: JudgedWindow, amount: float, name: str) -> dict[str, float]:
    """Returns an amount per metre and per radian, by the metrics' names; NaN where not defined."""
    return {name: amount / window.distance, PER_RADIAN[name]: amount / window.angle}


def _slip(window: JudgedWindow, parameters: Mapping[str, float]) -> dict[str, float]:
    part = window.recording
    net = np.where(bearing_load(part, parameters), _net_slip(part, parameters), 0.0).sum(axis=1)
    slip = _per(window, float(window.gained(foot_names("slip_distance")).sum()), "slip_per_metre")
    return slip | {
        "slip_net_per_metre": float(window.weights @ net) * window.duration / window.distance
    }


def _net_slip(part: Recording, parameters: Mapping[str, float]) -> Array:
    """Returns the slip speed (rows, 6) without the friction law's own motion while sticking.

    That motion is the creep of the tanh law, or the stretch and return of a bristle.
    """
    law, friction = friction_law(parameters), _friction(parameters)
    if law.has_bristles:
        sliding = yielding_velocity(
            friction, part.foot_vectors("velocity"), part.foot_vectors("bristle")
        )
        return np.asarray(np.linalg.norm(sliding, axis=-1))
    speed = part.feet("slip_speed")
    if law.creep is None:
        return speed
    return np.maximum(speed - law.creep(friction, cone_use(part, parameters)), 0.0)


def _friction(parameters: Mapping[str, float]) -> Friction:
    """Returns the friction law of a run from the FMU's parameters."""
    names = ("mu", "mu_static", "slope", "presliding", "bristle_damping", "stribeck_speed")
    facts = {name: parameters[f"friction.{name}"] for name in names}
    return Friction(law=law_name(parameters), **facts)


def cone_use(part: Recording, parameters: Mapping[str, float]) -> Array:
    """Returns tangential force over the largest possible, mu f_n (rows, 6).

    It is 0 for feet without load, and without friction.
    """
    largest = parameters["friction.mu"] * part.feet("normal_force")
    loaded = bearing_load(part, parameters) & (largest > 0.0)
    return np.divide(
        part.feet("tangential_force"), largest, out=np.zeros_like(largest), where=loaded
    )


def _cone(window: JudgedWindow, parameters: Mapping[str, float]) -> dict[str, float]:
    names = ("cone_use_p50", "cone_use_p95", "cone_use_over_90")
    times = window.gained(list(CONE_TIMES))
    slippery = parameters["friction.mu"] == 0.0 or not friction_law(parameters).has_friction
    if slippery or not times.any():
        return dict.fromkeys(names, np.nan)
    # within a bin time is taken as even over the root of the share, by which bins are equally wide
    reached = np.append(0.0, np.cumsum(times)) / times.sum()
    p50, p95 = np.interp([0.50, 0.95], reached, np.sqrt(_CONE_EDGES)) ** 2
    return dict(zip(names, (float(p50), float(p95), float(times[-1] / times.sum())), strict=True))


def _spread(window: JudgedWindow) -> Array:
    """Returns the share of time that each row represents, for each foot (rows, 6)."""
    return np.broadcast_to(window.weights[:, None], (len(window.weights), len(LEG_NAMES)))


def percentiles(values: Array, weights: Array, wanted: tuple[float, ...]) -> list[float]:
    """Returns weighted percentiles; each value lies in the middle of its weight."""
    order = np.argsort(values, kind="stable")
    reached = np.cumsum(weights[order]) - 0.5 * weights[order]
    places = np.array(wanted) / 100.0 * weights.sum()
    return [float(value) for value in np.interp(places, reached, values[order])]


def _feet(window: JudgedWindow, parameters: Mapping[str, float]) -> dict[str, float]:
    part, names = window.recording, ("foot_error_stance", "foot_error_swing")
    error = foot_errors(part, parameters)
    if not len(error):
        return dict.fromkeys(names, np.nan)
    swinging = part.columns([f"controller.{leg}.swinging" for leg in LEG_NAMES]) > 0.5
    square, weights = np.sum(error * error, axis=-1), _spread(window)
    return {
        name: _rms_of(square, np.where(those, weights, 0.0))
        for name, those in zip(names, (~swinging, swinging), strict=True)
    }


def _rms_of(square: Array, weights: Array) -> float:
    return float(np.sqrt((square * weights).sum() / weights.sum())) if weights.any() else np.nan


def foot_errors(recording: Recording, parameters: Mapping[str, float]) -> Array:
    """Returns actual minus planned position of each foot's centre [m] (rows, 6, 3), torso frame.

    There are no rows when the controller does not report its plan.
    """
    if not set(PLANNED) <= set(recording.names):
        return np.zeros((0, len(LEG_NAMES), 3))
    return real_feet(recording, parameters) - planned_feet(recording)


def plans_feet(recording: Recording) -> bool:
    """Returns whether the controller reports where it plans the feet."""
    return set(PLANNED) <= set(recording.names)


def planned_feet(recording: Recording) -> Array:
    """Returns each foot's planned centre [m] (rows, 6, 3), torso frame.

    Raises ColumnError when the controller does not report it.
    """
    return recording.columns(PLANNED).reshape(-1, len(LEG_NAMES), 3)


def _path(window: JudgedWindow) -> dict[str, float]:
    part = window.recording
    end = commanded_path(part, heading=window.heading)[-1]
    missed = float(np.linalg.norm(part.vector("torso.position")[-1, :2] - end))
    yaw = np.unwrap(part.column("torso.yaw"))
    lost = abs(float(yaw[-1] - yaw[0] - window.turned[-1]))
    return _per(window, missed, "path_error") | _per(window, lost, "yaw_drift")


def _posture(window: JudgedWindow, parameters: Mapping[str, float]) -> dict[str, float]:
    part = window.recording
    angles = {
        f"{name}_rms": window.rms(np.unwrap(part.column(f"torso.{name}")))
        for name in ("roll", "pitch")
    }
    return {"height_rms": window.rms(body_height(part, parameters))} | angles


def _force(window: JudgedWindow) -> dict[str, float]:
    normal = window.recording.feet("normal_force") / window.weight
    loaded = normal > CONTACT_SHARE
    rates = landing_rates(window) / window.weight
    peaks = window.whole.rows(window.steps()).feet("peak_force")
    return {
        "peak_force": float(peaks.max()) / window.weight,
        "force_p95": percentiles(normal[loaded], _spread(window)[loaded], (95.0,))[0]
        if loaded.any()
        else np.nan,
        "loading_rate": float(np.percentile(rates, 95)) if len(rates) else np.nan,
    }


def landing_rates(window: JudgedWindow) -> Array:
    """Returns the largest rise of the force over 1 ms [N/s] in the 20 ms after each landing.

    Landings of all feet between begin and end count. A landing is the first contact of a foot after
    its swing: a touch-down within half a gait cycle of it is a bounce of the same landing, which
    has the steepest rise of all; a later one begins the next landing.
    """
    found: list[float] = []
    steps = window.steps()
    time, counts, rates = (
        window.whole.time,
        window.whole.feet("landings"),
        window.whole.feet("landing_rate"),
    )
    for count, rate in zip(counts.T, rates.T, strict=True):
        contacts = 1 + np.flatnonzero(np.diff(count) > 0.0)
        begins = _first_contacts(contacts, time, apart=0.5 * window.period)
        ends = np.append(begins[1:], len(time))
        judged = (begins >= steps.start) & (begins < steps.stop)
        found += [
            float(rate[first:last].max())
            for first, last in zip(begins[judged], ends[judged], strict=True)
        ]
    return np.array(found)


def _first_contacts(contacts: NDArray[np.intp], time: Array, *, apart: float) -> NDArray[np.intp]:
    """Returns the rows of touch-downs that come later than `apart` [s] after the one before."""
    found: list[np.intp] = []
    for row in contacts:
        if not found or time[row] - time[found[-1]] > apart:
            found.append(row)
    return np.array(found, dtype=np.intp)


def _effort(window: JudgedWindow, servo: Servo) -> dict[str, float]:
    squares = window.gained(joint_names("torque_squared"))  # N2 m2 s
    work = float(window.gained(joint_names("positive_work")).sum())  # J
    square = float(squares.sum())
    copper = square / servo.motor_constant**2  # J
    return {
        "torque_rms": float(np.sqrt(square / (len(squares) * window.duration))),
        "servo_load_max": float(np.sqrt(squares.max() / window.duration)) / servo.torque_continuous,
        **_per(window, square, "heat"),
        **_per(window, work / window.weight, "cost_of_transport"),
        **_per(window, (work + copper) / window.weight, "electrical_cost"),
    }
