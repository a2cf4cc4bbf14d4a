"""What a reader of a run should know besides its figures.

Whether it fell, what it did not use, where its controller gave up. A robot has fallen when

- its torso leans by UPRIGHT or more against the ground's normal, from the first moment on at which
  a foot touches the ground; or
- its torso is lower than SUNK of the height at which it should be, for SUNK_TIME or until the run
  ends. The height at which it should be is the one at which its feet first touched the ground, and
  the commanded change of height; or
- its torso is lower than half its own thickness, at any time: then it lies on the ground.

Heights are above the ground. So a robot that begins in the air has not fallen unless it lands
badly.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.interface.names import joint_names, vector_names
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.results.metrics import energy_residual
from hexapod_cosim.cosim.results.walk import SKIPPED_CYCLES, View, body_height
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.models import FRICTION_LAWS, LEG_NAMES, TERRAINS, Robot, Terrain
from hexapod_cosim.models.records import STATIC_LAWS
from hexapod_cosim.models.statics import sliding
from hexapod_cosim.models.terrain import ground_normal

UPRIGHT = 0.6  # rad
SUNK = 0.5  # 1
SUNK_TIME = 0.5  # s    longer than a landing bends the legs
UNBALANCED = 0.01  # of the motors' work: books that miss more are told


def describe_walk(view: View, robot: Robot) -> dict[str, Any]:
    """Distance [m] and mean speed [m/s] over the judged cycles (NaN when none was walked), whether
    the robot stayed upright, and the share of time in which the controller fell back to kinematic
    control, if it tells.
    """
    walk = view.walk
    distance = walk.distance if walk else math.nan
    lasted = float(walk.recording.time[-1] - walk.recording.time[0]) if walk else math.nan
    doubted = fallback_columns(view.recording)
    fallback = {"fallback": float(np.mean(doubted.any(axis=1)))} if len(doubted) else {}
    return {
        "distance": distance,
        "mean_speed": distance / lasted,
        "upright": not fall(view, robot),
    } | fallback


def fallback_columns(recording: Recording) -> NDArray[np.bool_]:
    """(rows, 6) when each leg walked without feedback; no rows when the controller does not
    tell.
    """
    names = [f"controller.{leg}.fallback" for leg in LEG_NAMES]
    return (
        recording.columns(names) > 0.5
        if set(names) <= set(recording.names)
        else np.zeros((0, len(LEG_NAMES)), dtype=np.bool_)
    )


def fallen_back(recording: Recording) -> list[str]:
    """For how long which legs walked without feedback."""
    doubted = fallback_columns(recording)
    if not doubted.any():
        return []
    together = float(doubted.all(axis=1).mean())
    legs = {
        leg: float(share) - together
        for leg, share in zip(LEG_NAMES, doubted.mean(axis=0), strict=True)
    }
    found = [
        f"leg {leg} walked without feedback for {share:.0%} of the time: its foot's sensor contradicted the plan"
        for leg, share in legs.items()
        if share
    ]
    slid = (
        f"all legs walked without feedback for {together:.0%} of the time: "
        "the robot slid, its joints could not follow, or too many sensors failed"
    )
    return [slid, *found] if together else found


def fall(view: View, robot: Robot) -> str:
    """When and how the robot fell, "" when it did not; the module says what a fall is."""
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
    """(rows,) those of `low` whose spell lasts for SUNK_TIME or until the last row."""
    edges = np.flatnonzero(np.diff(low, prepend=False, append=False)).reshape(-1, 2)
    lasting = np.zeros_like(low)
    for begin, end in edges:
        lasting[begin:end] = end == len(low) or time[end] - time[begin] >= SUNK_TIME
    return lasting


def _lean(recording: Recording, parameters: Mapping[str, float]) -> NDArray[np.float64]:
    """(rows,) angle [rad] between the torso's upward axis and the ground's normal."""
    w, x, y, z = recording.vector("torso.quaternion", 4).T
    up = np.column_stack(
        [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)]
    )
    return np.asarray(np.arccos(np.clip(up @ _normal(parameters), -1.0, 1.0)))


def _normal(parameters: Mapping[str, float]) -> NDArray[np.float64]:
    """(3,) the ground's normal."""
    kind = TERRAINS[round(parameters.get("terrain.kind", 1.0)) - 1]
    heading, incline = (
        parameters.get("terrain.heading", 0.0),
        parameters.get("terrain.incline", 0.0),
    )
    return ground_normal(Terrain(kind=kind, height=0.0, incline=incline, heading=heading))


def slipping_ground(parameters: Mapping[str, float]) -> list[str]:
    """Whether friction is too weak for a robot to stay where it is, or to get anywhere."""
    law = FRICTION_LAWS[round(parameters["friction.law"]) - 1]
    mu = 0.0 if law == "none" else parameters["friction.mu"]
    gravity = np.array([parameters[name] for name in vector_names("gravity")])
    static = parameters.get("friction.mu_static", 0.0) if law in STATIC_LAWS else 0.0
    slide = float(np.linalg.norm(sliding(gravity, _normal(parameters), mu, static)))
    if slide:
        why = "without friction" if mu == 0.0 else f"which friction (mu = {mu:g}) does not hold"
        return [
            f"the robot slides: the ground's slope pulls it downhill at {slide:.3g} m/s2, {why}"
        ]
    return (
        ["the ground has no friction: feet cannot push, and the robot does not get ahead"]
        if max(mu, static) == 0.0
        else []
    )


def idle_settings(scenario: Scenario, robot: Robot) -> list[str]:
    """Settings that this run does not use."""
    late = [event.time for event in scenario.events if event.time >= scenario.duration]
    found = [
        f"the event at {time:g} s does nothing: the run ends at {scenario.duration:g} s"
        for time in late
    ]
    late = [command.time for command in scenario.commands if command.time >= scenario.duration]
    found += [
        f"the command at {time:g} s does nothing: the run ends at {scenario.duration:g} s"
        for time in late
    ]
    terrain = replace(robot.terrain, **scenario.settings.get("terrain", {}))
    given = {**scenario.settings.get("terrain", {}), **scenario.parameters}
    sloped = [
        key for key in ("incline", "heading") if given.get(key) or given.get(f"terrain.{key}")
    ]
    if terrain.kind == "flat":
        found += [
            f"terrain.{key} does nothing on flat ground; set terrain.kind=slope" for key in sloped
        ]
    return found


def doubts(view: View, robot: Robot) -> list[str]:
    """What a reader of the results should know: a fall, legs out of reach, servos hotter than
    they may be for long.
    """
    recording, fell = view.recording, fall(view, robot)
    found = [*([fell] if fell else []), *slipping_ground(view.parameters)]
    unreachable = [f"controller.{leg}.unreachable" for leg in LEG_NAMES]
    if len(recording.time) and set(unreachable) <= set(recording.names):
        share = float(np.mean(recording.columns(unreachable).max(axis=1)))
        found += [f"a foot was out of its leg's reach for {share:.1%} of the time"] if share else []
    return [*found, *fallen_back(recording), *hot_servo(recording, robot), *unbalanced_books(view)]


def hot_servo(recording: Recording, robot: Robot) -> list[str]:
    """The servo whose RMS torque over the run is furthest above its continuous rating."""
    time, names = recording.time, joint_names("torque_squared")
    if len(time) < 2:
        return []
    squares = recording.columns(names)
    torque = np.sqrt((squares[-1] - squares[0]) / (time[-1] - time[0]))
    worst, limit = int(np.argmax(torque)), robot.servo.torque_continuous
    name = names[worst].removesuffix(".torque_squared")
    text = f"servo {name} works at {torque[worst]:.2f} N m RMS, above the {limit:g} N m it bears for long"
    return [text] if torque[worst] > limit else []


def unbalanced_books(view: View) -> list[str]:
    """That more energy is missing than figures made of it can bear."""
    share = energy_residual(view)
    fix = "tighten solver.tolerance or, with a fixed step, shorten solver.step"
    text = f"the energy books do not explain {share:.2%} of the motors' work: {fix}"
    return [text] if share > UNBALANCED else []


def too_short(view: View) -> list[str]:
    """Why a run has no metrics, and what gives it some."""
    time, needed = view.recording.time, (SKIPPED_CYCLES + 1) * view.period
    if view.walk is not None or not len(time):
        return []
    lasted, cycles = float(time[-1] - time[0]), f"{SKIPPED_CYCLES + 1} whole gait cycles"
    reason = f"metrics are of what comes after the first {SKIPPED_CYCLES}, and a cycle takes {view.period:g} s"
    return [
        f"too short for metrics: got {lasted:.6g} s, expected {needed:.6g} s, which is {cycles} ({reason}); set duration={needed:.6g}"
    ]
