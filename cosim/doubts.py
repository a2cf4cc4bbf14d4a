"""What a reader of a run should know besides its figures: whether it fell, what it did not use, where its controller gave up."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.metrics import View, body_height
from hexapod_cosim.cosim.recorder import Recording
from hexapod_cosim.cosim.scenario_records import Scenario
from hexapod_cosim.cosim.signals import joint_names
from hexapod_cosim.models import LEG_NAMES, Robot

UPRIGHT = 0.6  # rad    of roll or pitch: beyond it the robot has fallen
SUNK = 0.5  # of the height it is commanded to hold: below it the robot has fallen too


def describe_walk(view: View, robot: Robot) -> dict[str, Any]:
    """Distance [m] and mean speed [m/s] over the judged cycles (NaN when none was walked), whether the robot stayed upright, and the
    share of time in which the controller fell back to kinematic control, if it tells.
    """
    walk = view.walk
    distance = walk.distance if walk else math.nan
    lasted = float(walk.recording.time[-1] - walk.recording.time[0]) if walk else math.nan
    doubted = fallback_columns(view.recording)
    fallback = {"fallback": float(np.mean(doubted.any(axis=1)))} if len(doubted) else {}
    return {"distance": distance, "mean_speed": distance / lasted, "upright": not fall(view, robot)} | fallback


def fallback_columns(recording: Recording) -> NDArray[np.bool_]:
    """(rows, 6) when each leg walked without feedback; no rows when the controller does not tell."""
    names = [f"controller.{leg}.fallback" for leg in LEG_NAMES]
    return recording.columns(names) > 0.5 if set(names) <= set(recording.names) else np.zeros((0, len(LEG_NAMES)), dtype=np.bool_)


def fallen_back(recording: Recording) -> list[str]:
    """For how long which legs walked without feedback."""
    doubted = fallback_columns(recording)
    if not doubted.any():
        return []
    together = float(doubted.all(axis=1).mean())
    legs = {leg: float(share) - together for leg, share in zip(LEG_NAMES, doubted.mean(axis=0), strict=True)}
    found = [f"leg {leg} walked without feedback for {share:.0%} of the time: its foot's sensor contradicted the plan"
             for leg, share in legs.items() if share]  # fmt: skip
    slid = (
        f"all legs walked without feedback for {together:.0%} of the time: "
        "the robot slid, its joints could not follow, or too many sensors failed"
    )
    return [slid, *found] if together else found


def fall(view: View, robot: Robot) -> str:
    """When and how the robot fell, "" when it stayed upright: roll and pitch within bounds, the torso off the ground and not sunk."""
    recording = view.recording
    if not len(recording.time):
        return ""
    height = body_height(recording, view.parameters)
    commanded = height[0] + recording.column("command.height")
    tilted = np.abs(recording.columns(["torso.roll", "torso.pitch"])).max(axis=1) >= UPRIGHT
    low = (height < SUNK * commanded) | (height < 0.5 * robot.torso.size[2])
    fallen = tilted | low
    if not fallen.any():
        return ""
    k = int(np.argmax(fallen))
    how = f"roll or pitch beyond {UPRIGHT} rad" if tilted[k] else f"the torso only {height[k]:.3g} m above the ground"
    return f"the robot fell at {recording.time[k]:.3f} s: {how}"


def idle_settings(scenario: Scenario, robot: Robot) -> list[str]:
    """Settings that this run does not use."""
    late = [event.time for event in scenario.events if event.time >= scenario.duration]
    found = [f"the event at {time:g} s does nothing: the run ends at {scenario.duration:g} s" for time in late]
    late = [command.time for command in scenario.commands if command.time >= scenario.duration]
    found += [f"the command at {time:g} s does nothing: the run ends at {scenario.duration:g} s" for time in late]
    terrain = replace(robot.terrain, **scenario.settings.get("terrain", {}))
    given = {**scenario.settings.get("terrain", {}), **scenario.parameters}
    sloped = [key for key in ("incline", "heading") if given.get(key) or given.get(f"terrain.{key}")]
    if terrain.kind == "flat":
        found += [f"terrain.{key} does nothing on flat ground; set terrain.kind=slope" for key in sloped]
    return found


def doubts(view: View, robot: Robot) -> list[str]:
    """What a reader of the results should know: a fall, legs out of reach, servos hotter than they may be for long."""
    recording, fell = view.recording, fall(view, robot)
    found = [fell] if fell else []
    unreachable = [f"controller.{leg}.unreachable" for leg in LEG_NAMES]
    if len(recording.time) and set(unreachable) <= set(recording.names):
        share = float(np.mean(recording.columns(unreachable).max(axis=1)))
        found += [f"a foot was out of its leg's reach for {share:.1%} of the time"] if share else []
    found += fallen_back(recording)
    if len(recording.time):
        torque = np.sqrt(np.mean(recording.columns(joint_names("torque")) ** 2, axis=0))
        worst, limit = int(np.argmax(torque)), robot.servo.torque_continuous
        name = joint_names("torque")[worst].removesuffix(".torque")
        found += (
            [f"servo {name} works at {torque[worst]:.2f} N m RMS, above the {limit:g} N m it bears for long"]
            if torque[worst] > limit
            else []
        )
    return found
