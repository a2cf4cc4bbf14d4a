"""Judges how a robot got ahead: whether it fell, and whether it arrived.

A robot has fallen when

- its torso leans by UPRIGHT or more against the ground's normal, at any time after the first foot
  contact; or
- its torso is lower than SUNK of the expected height for SUNK_TIME or until the run ends. The
  expected height is the height at the first foot contact plus the commanded change of height; or
- its torso is lower than half its own thickness, at any time: then it lies on the ground.

Heights are above the ground; on a surface, above the level of the feet in contact, and the normal
is the vertical. So a robot that starts in the air has not fallen unless it lands badly.

A robot that is stuck, at a stair or in snow, stands upright to the end of its run. Comparisons and
the course count it as a failure by the same rule: the path error, or the yaw drift of a turn on the
spot, is at most ARRIVE.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.results.facts import Locomotion
from hexapod_cosim.cosim.results.support import body_height, ground_normal
from hexapod_cosim.cosim.results.window import LEAST_DISTANCE, LEAST_TURN, View
from hexapod_cosim.models import JOINT_NAMES, LEG_NAMES, Robot

ARRIVE = 0.5  # m/m, rad/rad    largest path error, or yaw drift of a turn on the spot
FINDINGS = (  # flag of the controller, what its begin and its end mean
    *(
        (
            f"{joint}.faulty",
            f"the controller finds that the servo of {{leg}}.{joint} does not work",
            f"the controller finds that the servo of {{leg}}.{joint} works again",
        )
        for joint in JOINT_NAMES
    ),
    ("absent", "the controller walks without {leg}", "the controller walks with {leg} again"),
    (
        "outrun",
        "the command is too fast for the joints of {leg}: the body walks slower",
        "the command is no longer too fast for the joints of {leg}",
    ),
    (
        "doubted",
        "the controller replaces the force of the foot {leg}, whose sensor contradicts the plan",
        "the controller trusts the force sensor of the foot {leg} again",
    ),
)
SURELY = 2.0  # times the least walk: a shorter commanded way asks for no walk
UPRIGHT = 0.6  # rad
SUNK = 0.5  # 1
SUNK_TIME = 0.5  # s    longer than the legs stay bent after a landing


def missed_end(metrics: Mapping[str, float], *, arrive: float = ARRIVE) -> str:
    """Returns how a run that was commanded to walk missed the end of its path; "" if it arrived.

    metrics: of a run with whole gait cycles after the first two.
    arrive: largest path error [m/m], or yaw drift [rad/rad] of a turn on the spot.
    """
    missed, unit = metrics["path_error"], "m per metre walked"
    if math.isnan(missed):
        missed, unit = metrics["yaw_drift_per_radian"], "rad per radian turned"
    if math.isnan(missed):
        return "the robot did not get ahead"
    if missed > arrive:
        return f"the robot did not arrive: it missed the end by {missed:.2g} {unit}"
    return ""


def is_sent_ahead(view: View) -> bool:
    """Returns whether the command of the measured cycles leads further than standing still does."""
    window = view.window
    if window is None:
        return False
    steps = np.diff(window.recording.time)
    vx, vy, rate = window.recording.columns(["command.vx", "command.vy", "command.yaw_rate"])[:-1].T
    way, turn = float(steps @ np.hypot(vx, vy)), float(steps @ np.abs(rate))
    return way >= SURELY * LEAST_DISTANCE or turn >= SURELY * LEAST_TURN


def locomotion_of(view: View, *, upright: bool, missed: str = "") -> Locomotion:
    """Returns how the robot got ahead.

    upright: whether it stayed so; missed: how it missed the end of its path, "" if it arrived.
    """
    window = view.window
    distance = window.distance if window else math.nan
    lasted = float(window.recording.time[-1] - window.recording.time[0]) if window else math.nan
    fallen_back = fallback_columns(view.recording)
    return Locomotion(
        distance=distance,
        mean_speed=distance / lasted,
        upright=upright,
        fallback=float(np.mean(fallen_back.any(axis=1))) if len(fallen_back) else None,
        missed=missed,
    )


def fallback_columns(recording: Recording) -> NDArray[np.bool_]:
    """Returns when each leg walked without feedback (rows, 6); no rows when not reported."""
    names = [f"controller.{leg}.fallback" for leg in LEG_NAMES]
    if not set(names) <= set(recording.names):
        return np.zeros((0, len(LEG_NAMES)), dtype=np.bool_)
    return recording.columns(names) > 0.5


def found_faults(recording: Recording) -> list[dict[str, Any]]:
    """Returns time [s from the start] and text of what the controller found at servos and legs."""
    found, start = [], float(recording.time[0]) if len(recording.time) else 0.0
    for flag, begins, ends in FINDINGS:
        for leg in LEG_NAMES:
            if (name := f"controller.{leg}.{flag}") not in recording.names:
                continue
            edges = np.diff(recording.column(name) > 0.5, prepend=False)
            times = recording.time[edges] - start
            texts = itertools.cycle((begins.format(leg=leg), ends.format(leg=leg)))
            found += [
                {"time": float(t), "text": text} for t, text in zip(times, texts, strict=False)
            ]
    return sorted(found, key=lambda event: event["time"])


def describe_fall(view: View, robot: Robot) -> str:
    """Returns when and how the robot fell, as the module defines a fall; "" when it did not."""
    recording = view.recording
    landed = np.flatnonzero((recording.feet("contact") > 0.5).any(axis=1))
    begin = int(landed[0]) if len(landed) else len(recording.time)
    on_ground = np.arange(len(recording.time)) >= begin
    height = body_height(recording, view.parameters)
    wanted = recording.column("command.height") + (height[begin] if len(landed) else 0.0)
    lying = height < 0.5 * robot.torso.size[2]
    leaning = on_ground & (_lean(recording, view.parameters) >= UPRIGHT)
    sunk = _lasting(recording.time, on_ground & (height < SUNK * wanted))
    fallen = lying | leaning | sunk
    if not fallen.any():
        return ""
    k = int(np.argmax(fallen))
    how = (
        f"its torso leaned by more than {UPRIGHT} rad"
        if leaning[k]
        else f"its torso was only {height[k]:.3g} m above the ground"
    )
    return f"the robot fell at {recording.time[k]:.3f} s: {how}"


def _lasting(time: NDArray[np.float64], low: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Selects the rows (rows,) of `low` in periods that last SUNK_TIME or until the last row."""
    edges = np.flatnonzero(np.diff(low, prepend=False, append=False)).reshape(-1, 2)
    lasting = np.zeros_like(low)
    for begin, end in edges:
        lasting[begin:end] = end == len(low) or time[end] - time[begin] >= SUNK_TIME
    return lasting


def _lean(recording: Recording, parameters: Mapping[str, float]) -> NDArray[np.float64]:
    """Returns the angle [rad] between the torso's upward axis and the ground's normal (rows,)."""
    w, x, y, z = recording.vector("torso.quaternion", 4).T
    up = np.column_stack(
        [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)]
    )
    return np.asarray(np.arccos(np.clip(up @ ground_normal(parameters), -1.0, 1.0)))
