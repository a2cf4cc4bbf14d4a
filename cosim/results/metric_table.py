"""The metrics of a walk: units, meanings, and the least changes that are meaningful."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from hexapod_cosim.cosim.results.window import friction_law
from hexapod_cosim.models import HexapodError, unknown_name


class UnknownMetricError(HexapodError, KeyError):
    """A metric that there is not."""


class Metrics(dict[str, float]):
    """Metrics by name; an unknown name is refused with the nearest one."""

    def __missing__(self, name: str) -> float:
        raise unknown_name("metric", name, self, error=UnknownMetricError)


class Metric(NamedTuple):
    """Definition of a metric."""

    unit: str
    less_is_better: bool | None  # None: neither
    meaning: str
    # least change, in the unit, that is meaningful: the resolution of measurements on the robot (a
    # tenth of a millimetre, of a milliradian, of its force and torque sensing)
    floor: float


_TABLE: dict[str, Metric] = {
    "foot_error_stance": Metric(
        "m", True, "feet on the ground from where the plan has them, torso frame, RMS", 1e-4
    ),
    "foot_error_swing": Metric(
        "m", True, "feet in the air from where the plan has them, torso frame, RMS", 1e-4
    ),
    "path_error": Metric(
        "m/m", True, "distance from the end of the commanded path, per metre walked", 1e-3
    ),
    "yaw_drift": Metric(
        "rad/m", True, "heading lost against the commanded one, per metre walked", 1e-3
    ),
    "height_rms": Metric("m", True, "torso height above the ground, about its mean", 1e-4),
    "roll_rms": Metric("rad", True, "roll, about its mean", 1e-4),
    "pitch_rms": Metric("rad", True, "pitch, about its mean", 1e-4),
    "peak_force": Metric("BW", True, "largest foot normal force, in body weights", 5e-3),
    "force_p95": Metric("BW", True, "95th percentile of the normal force of feet under load", 5e-3),
    "loading_rate": Metric(
        "BW/s",
        True,
        "largest rise of the force over 1 ms in 20 ms after touch-down, 95th percentile",
        5e-2,
    ),
    "torque_rms": Metric("N m", True, "motor torque over all joints and time", 5e-3),
    "servo_load_max": Metric(
        "1", True, "largest RMS torque of a servo over its continuous rating", 5e-3
    ),
    "heat": Metric(
        "N2 m2 s/m", True, "integral of the sum of squared motor torques, per metre walked", 0.5
    ),
    "cost_of_transport": Metric("1", True, "positive motor work per weight and distance", 1e-3),
    "electrical_cost": Metric(
        "1", True, "positive motor work and copper loss per weight and distance", 5e-3
    ),
    "path_error_per_radian": Metric(
        "m/rad", True, "distance from the commanded place, per radian turned", 1e-3
    ),
    "yaw_drift_per_radian": Metric(
        "rad/rad", True, "heading lost against the commanded one, per radian turned", 1e-3
    ),
    "heat_per_radian": Metric(
        "N2 m2 s/rad", True, "integral of the sum of squared motor torques, per radian turned", 0.5
    ),
    "cost_per_radian": Metric(
        "m/rad", True, "positive motor work per weight and angle turned", 1e-3
    ),
    "electrical_cost_per_radian": Metric(
        "m/rad", True, "positive motor work and copper loss per weight and angle", 5e-3
    ),
    "stability_margin": Metric(
        "m", False, "least distance of the centre of mass from the support polygon's edge", 1e-4
    ),
    "cone_use_p50": Metric(
        "1", True, "share of the friction cone that loaded feet use, median over time", 5e-3
    ),
    "cone_use_p95": Metric("1", True, "the same, 95th percentile", 5e-3),
    "cone_use_over_90": Metric(
        "1", True, "share of the time in which loaded feet use over 90 % of the cone", 5e-3
    ),
    "slip_per_metre": Metric(
        "m/m", True, "way slipped by all feet under load, per metre walked", 1e-4
    ),
    "slip_net_per_metre": Metric(
        "m/m",
        True,
        "slip per metre less the creep of the tanh friction law or what bristles give back",
        1e-4,
    ),
    "slip_per_radian": Metric(
        "m/rad", True, "way slipped by all feet under load, per radian turned", 1e-4
    ),
    "energy_residual": Metric(
        "1", None, "energy that the balance does not explain, over the motors' work", 0.0
    ),
    "realtime_factor": Metric("1", None, "simulated over wall time of the whole loop", 0.0),
}
OF_THE_RUN = ("energy_residual", "realtime_factor")  # defined for any run, however short
# metrics of a robot that turns on the spot, which replace those per metre
PER_RADIAN = {
    "slip_per_metre": "slip_per_radian",
    "path_error": "path_error_per_radian",
    "yaw_drift": "yaw_drift_per_radian",
    "heat": "heat_per_radian",
    "cost_of_transport": "cost_per_radian",
    "electrical_cost": "electrical_cost_per_radian",
}
# name -> unit, whether less is better (None: neither), meaning
METRICS = {name: (each.unit, each.less_is_better, each.meaning) for name, each in _TABLE.items()}
FLOORS = {name: each.floor for name, each in _TABLE.items()}
DUST = 1e-6  # of the floor: a smaller value is round-off and is shown as 0


def shown_metrics(runs: Mapping[str, Mapping[str, float | None]], *, net_slip: bool) -> list[str]:
    """Returns the metrics for a table of runs: per radian for turns on the spot, else per metre.

    `net_slip`: whether to show slip_net_per_metre; see `has_net_slip`.
    """

    def given(name: str) -> bool:
        values = [run.get(name) for run in runs.values()]
        return any(value is not None and np.isfinite(value) for value in values)

    turned = {metre: radian for metre, radian in PER_RADIAN.items() if given(radian)}
    hidden = {radian for radian in PER_RADIAN.values() if radian not in turned.values()}
    hidden |= {metre for metre in turned if not given(metre)}
    hidden |= set() if net_slip else {"slip_net_per_metre"}
    return [name for name in METRICS if name not in hidden]


def has_net_slip(parameters: Mapping[str, float]) -> bool:
    """Returns whether slip_net_per_metre is meaningful: under the tanh law it only inverts it."""
    return friction_law(parameters).creep is None
