"""Renders the page of a live robot, one HTML file with the viewer, and describes to it the robot's
state: numbers of plain types, forces in body weights.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from hexapod_cosim.cosim.interface.names import foot_names, joint_names, vector_names
from hexapod_cosim.cosim.report.geometry import describe_ground, describe_shape, pack_surface
from hexapod_cosim.cosim.report.page import VIEWER, render, viewer_script
from hexapod_cosim.cosim.report.payload import as_json
from hexapod_cosim.cosim.results.window import robot_weight
from hexapod_cosim.cosim.scenario.reading import scenario_robot
from hexapod_cosim.extensions.live.robot import LiveRobot
from hexapod_cosim.extensions.live.settings import FLAT, OWN, Choices
from hexapod_cosim.models import LEG_NAMES, HexapodError, Robot
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.ground.faces import surface_of
from hexapod_cosim.models.ground.table import CATALOGUE

TEMPLATE = "live.html.jinja"
ABOUTS = {
    "kinematic": "Plays the planned joint angles; feels neither ground nor attitude.",
    "paper": "Moves feet back to their plan, by joint angles, foot forces and attitude.",
    "compliant": "Plans the forces of the feet and commands torques: softer landings, less slip.",
}


DIGITS = 5  # of positions [m], angles [rad] and shares
SHOWN = {  # variables of the plant by key of a frame
    "position": vector_names("torso.position"),
    "quaternion": vector_names("torso.quaternion", 4),
    "attitude": ["torso.roll", "torso.pitch", "torso.yaw"],
    "velocity": vector_names("torso.velocity"),
    "rate": vector_names("torso.angular_velocity"),
    "angle": joint_names("angle"),
    "slip": foot_names("slip_speed"),
}
FORCES = [name for leg in LEG_NAMES for name in vector_names(f"{leg}.foot.force")]


def render_page(
    choices: Choices, more: Mapping[str, Any] | None = None, *, module: str = ""
) -> str:
    """Returns the page with its viewer.

    Args:
        choices: the scenario and what the page may change.
        more: what a page without a server reads besides.
        module: the robot as WebAssembly in base64, for a page without a server.

    Raises HexapodError when the viewer was not built.
    """
    script = viewer_script()
    if script is None:
        raise HexapodError(
            "the page needs the viewer, which is not installed", got=f"no {VIEWER}",
            fix="install the package without HX_VIEWER=OFF",
        )  # fmt: skip
    return render(
        TEMPLATE,
        controls=list(choices.controls),
        package=__package__,
        title=choices.scenario.title,
        robot=choices.scenario.robot,
        setup=Markup(as_json(_describe(choices) | dict(more or {}))),
        viewer=script,
        module=module,
    )


def _describe(choices: Choices) -> dict[str, Any]:
    """Returns the choices of the page (viewer/messages.ts)."""
    own = scenario_robot(choices.scenario).terrain.name.replace("_", " ")
    about = {OWN: f"{own}, as in this scenario", FLAT: "a horizontal plane"}
    about |= {name: entry.about for name, entry in CATALOGUE.items()}
    return {
        "controls": list(choices.controls),
        "abouts": ABOUTS,
        "refused": choices.refused,
        "gaits": list(choices.gaits),
        "grounds": [{"name": name, "about": about[name]} for name in choices.grounds],
    }


def describe_world(robot: Robot, parameters: Mapping[str, float], step: float) -> dict[str, Any]:
    """Returns the robot's shape and the ground for the viewer (viewer/messages.ts).

    Args:
        robot: with its terrain.
        parameters: of the plant.
        step: the macro-step [s].
    """
    surface, ground = surface_of(robot.terrain), describe_ground(parameters)
    return {
        "robot": describe_shape(parameters, robot.torso.size),
        "ground": ground if surface is None else {**ground, "surface": 0},
        "surfaces": [] if surface is None else [pack_surface(surface, parameters)],
        "weight": round(robot_weight(parameters), 3),
        "step": step,
    }


def frame_of(robot: LiveRobot) -> dict[str, Any]:
    """Returns pose, motion and forces as of now (viewer/messages.ts)."""
    return {key: _rounded(_values(robot, names)) for key, names in SHOWN.items()} | {
        "time": round(robot.time, 6),
        "force": _rounded(_values(robot, FORCES) / robot.weight),
        "push": _rounded(robot.signals.push[:3]),
    }


def _values(robot: LiveRobot, names: list[str]) -> Array:
    """Returns variables of the plant by name."""
    return np.asarray(robot.signals.values[_indices(robot.signals.names, tuple(names))])


@lru_cache(maxsize=256)
def _indices(known: tuple[str, ...], names: tuple[str, ...]) -> NDArray[np.intp]:
    place = {name: k for k, name in enumerate(known)}
    return np.array([place[name] for name in names])


def _rounded(values: Array) -> list[float]:
    return [round(value, DIGITS) for value in values.tolist()]
