"""Warnings about a run: settings without effect, a controller that gave up feedback, weak friction,
servos, legs that overlap and missing energy.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hexapod_cosim.cosim.interface.names import foot_names, joint_names, vector_names
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.results.locomotion import fallback_columns
from hexapod_cosim.cosim.results.summary import FIX, UNBALANCED
from hexapod_cosim.cosim.results.support import ground_normal
from hexapod_cosim.cosim.results.window import SKIPPED_CYCLES, View, friction_law
from hexapod_cosim.cosim.scenario.records import CONTROLS, Scenario
from hexapod_cosim.models import LEG_NAMES, Robot
from hexapod_cosim.models.contact.law import SELF_CONTACTS
from hexapod_cosim.models.ground.surface import Surface
from hexapod_cosim.models.records import Foot, Servo
from hexapod_cosim.models.soil.law import soil_radius
from hexapod_cosim.models.statics import sliding


def fallback_warnings(recording: Recording) -> list[str]:
    """Warns of legs that walked without feedback, with their share of time."""
    fallen_back = fallback_columns(recording)
    if not fallen_back.any():
        return []
    shares = zip(LEG_NAMES, fallen_back.mean(axis=0), strict=True)
    found = [f"{leg} {share:.0%}" for leg, share in shares if share]
    return [
        f"legs walked without feedback for a share of the time ({', '.join(found)}): the robot "
        "slid, or it is far too heavy for its servos"
    ]


def friction_warnings(parameters: Mapping[str, float]) -> list[str]:
    """Warns where friction is too weak for the robot to stay in place or to move forward."""
    law = friction_law(parameters)
    mu = parameters["friction.mu"] if law.has_friction else 0.0
    gravity = np.array([parameters[name] for name in vector_names("gravity")])
    static = parameters.get("friction.mu_static", 0.0) if law.has_bristles else 0.0
    slide = float(np.linalg.norm(sliding(gravity, ground_normal(parameters), mu, static)))
    if slide:
        why = "without friction" if mu == 0.0 else f"which friction (mu = {mu:g}) does not hold"
        return [
            f"the robot slides: the ground's slope pulls it downhill at {slide:.3g} m/s2, {why}"
        ]
    if max(mu, static) == 0.0:
        return ["the ground has no friction: feet cannot push, and the robot does not get ahead"]
    return []


def unused_settings(scenario: Scenario, robot: Robot) -> list[str]:
    """Warns of settings that have no effect on this run."""
    end = scenario.duration
    found = [
        f"the event at {event.time:g} s does nothing: the run ends at {end:g} s"
        for event in scenario.events
        if event.time >= end
    ]
    found += [
        f"the command at {command.time:g} s does nothing: the run ends at {end:g} s"
        for command in scenario.commands
        if command.time >= end
    ]
    if scenario.gains and scenario.control == CONTROLS[0]:
        found.append(f"[gains] does nothing: {CONTROLS[0]} control has none")
    kind = scenario.settings.get("terrain", {}).get("kind", robot.terrain.name)
    given = {**scenario.settings.get("terrain", {}), **scenario.parameters}
    sloped = [
        key for key in ("incline", "heading") if given.get(key) or given.get(f"terrain.{key}")
    ]
    if kind != "slope":
        ground = "flat ground" if kind == "flat" else f"the surface {kind}"
        found += [
            f"terrain.{key} does nothing on {ground}; set terrain.kind=slope" for key in sloped
        ]
    return found


def walk_warnings(view: View, robot: Robot) -> list[str]:
    """Warns of weak friction, legs out of reach, lost feedback, overloaded servos, legs that
    overlap, feet that sink too deep and missing energy.
    """
    recording, found = view.recording, friction_warnings(view.parameters)
    unreachable = [f"controller.{leg}.unreachable" for leg in LEG_NAMES]
    if len(recording.time) and set(unreachable) <= set(recording.names):
        share = float(np.mean(recording.columns(unreachable).max(axis=1)))
        found += [f"a foot was out of its leg's reach for {share:.1%} of the time"] if share else []
    found += [*fallback_warnings(recording), *servo_warnings(recording, robot)]
    found += overlap_warnings(recording, view.parameters)
    found += sinkage_warnings(recording, view.parameters)
    return [*found, *run_balance_warnings(view.energy_residual)]


def sinkage_warnings(recording: Recording, parameters: Mapping[str, float]) -> list[str]:
    """Warns of a foot that sinks into soil deeper than the radius of its sphere or pad.

    The laws of soil count the foot alone; deeper than that the leg above it is in the soil, too.
    """
    names = foot_names("sinkage")
    if not len(recording.time) or not set(names) <= set(recording.names):
        return []
    depth, pad = recording.columns(names), parameters.get("foot.pad_radius", 0.0)
    foot = Foot(radius=parameters["foot.radius"], pad_radius=pad, youngs_modulus=1.0, poisson=0.0)
    radius = soil_radius(foot)
    if not depth.max() > radius:
        return []
    row, leg = np.unravel_index(int(np.argmax(depth)), depth.shape)
    kind, deepest = "pad" if pad else "sphere", float(depth[row, leg])
    return [
        f"foot {LEG_NAMES[leg]} sinks too deep: got {1e3 * deepest:.3g} mm at "
        f"{recording.time[row]:.3f} s, expected at most the radius of its {kind}, "
        f"{1e3 * radius:.3g} mm; the soil's law counts the foot alone and not the leg above it, so "
        "depth and slip are not reliable; give the feet larger pads (foot.pad_radius), or walk on "
        "firmer soil"
    ]


def overlap_warnings(recording: Recording, parameters: Mapping[str, float]) -> list[str]:
    """Warns of legs that overlap (body.self_contact = warn) or push each other (force), with time
    and size of the largest overlap or force.
    """
    choice = SELF_CONTACTS[round(parameters.get("body.self_contact", 1.0)) - 1]
    stem = "neighbour_force" if choice == "force" else "clearance"
    names = [
        name
        for leg in LEG_NAMES
        for name in (vector_names(f"{leg}.{stem}") if choice == "force" else [f"{leg}.{stem}"])
    ]
    if choice == "off" or not len(recording.time) or not set(names) <= set(recording.names):
        return []
    columns = recording.columns(names)
    if choice == "force":
        size = np.linalg.norm(columns.reshape(-1, len(LEG_NAMES), 3), axis=2)  # N
    else:
        size = np.maximum(-1e3 * columns, 0.0)  # mm
    met = (size > 0.0).any(axis=1)
    if not met.any():
        return []
    row, leg = np.unravel_index(int(np.argmax(size)), size.shape)
    what, how, rest = {
        "force": ("pushed each other", f"with {size[row, leg]:.3g} N", ""),
        "warn": (
            "overlapped",
            f"by {size[row, leg]:.3g} mm",
            ", or let them push each other with body.self_contact=force",
        ),
    }[choice]
    return [
        f"legs {what} from {recording.time[int(np.argmax(met))]:.3f} s on, for {met.mean():.1%} of "
        f"the time: leg {LEG_NAMES[leg]} and its neighbour {how} at {recording.time[row]:.3f} s; "
        f"use shorter steps or a slower turn{rest}"
    ]


def off_map_warnings(recording: Recording, surface: Surface | None) -> list[str]:
    """Warns where the torso has left the map of a surface, with the time and the way out."""
    if surface is None or not len(recording.time):
        return []
    x, y, _ = recording.vector("torso.position").T
    left, right, low, high = surface.extent
    off = (x < left) | (x > right) | (y < low) | (y > high)
    if not off.any():
        return []
    k = int(np.argmax(off))
    return [
        f"the robot left the map of the ground at {recording.time[k]:.3f} s, at x = {x[k]:.3g} m, "
        f"y = {y[k]:.3g} m: beyond it the height of its border goes on; enlarge terrain.size, or "
        "shorten the run"
    ]


def servo_warnings(recording: Recording, robot: Robot) -> list[str]:
    """Warns of the servo whose RMS torque over the run is furthest above its continuous rating."""
    time, names = recording.time, joint_names("torque_squared")
    if len(time) < 2:
        return []
    squares = recording.columns(names)
    torque = np.sqrt((squares[-1] - squares[0]) / (time[-1] - time[0]))
    worst, limit = int(np.argmax(torque)), robot.servo.torque_continuous
    name = names[worst].removesuffix(".torque_squared")
    text = (
        f"servo {name} works at {torque[worst]:.2f} N m RMS, "
        f"above its continuous rating of {limit:g} N m"
    )
    return [text] if torque[worst] > limit else []


def short_run_warnings(view: View) -> list[str]:
    """Warns of a run that is too short for metrics, with the duration that it needs."""
    time, needed = view.recording.time, (SKIPPED_CYCLES + 1) * view.period
    if view.window is not None or not len(time):
        return []
    lasted, cycles = float(time[-1] - time[0]), SKIPPED_CYCLES + 1
    return [
        f"too short for metrics: got {lasted:.6g} s, expected {needed:.6g} s, "
        f"which is {cycles} whole gait cycles (metrics are of what comes after the first "
        f"{SKIPPED_CYCLES}, and a cycle takes {view.period:g} s); set duration={needed:.6g}"
    ]


def heat_warnings(recording: Recording, servo: Servo) -> list[str]:
    """Warns of windings that were above the temperature from which on the duty limit falls.

    recording: without temperatures, as of a run that records metrics alone, nothing is said.
    """
    names = joint_names("winding_temperature")
    if servo.winding_capacity == 0.0 or not set(names) <= set(recording.names):
        return []
    windings = recording.columns(names)  # (rows, joints) [K]
    hot = windings.max(axis=0) > servo.derate_temperature
    if not hot.any():
        return []
    first = int(np.argmax((windings > servo.derate_temperature).any(axis=1)))
    worst = names[int(np.argmax(windings.max(axis=0)))].removesuffix(".winding_temperature")
    return [
        f"{int(hot.sum())} of {len(names)} servos gave less torque because they were hot, from "
        f"{recording.time[first]:.3g} s on: the winding of {worst} reached {windings.max():.1f} K "
        f"(servo.derate_temperature {servo.derate_temperature:g} K, servo.temperature_max "
        f"{servo.temperature_max:g} K)"
    ]


def run_balance_warnings(residual: float) -> list[str]:
    """Warns where a run's balance misses more than metrics of energy can tolerate."""
    text = f"the energy balance does not explain {residual:.2%} of the motors' work: {FIX}"
    return [text] if residual > UNBALANCED else []
