"""Writes a page in which the default robot walks without a server: one HTML file.

The page is that of `hexapod live`; plant and controller are inside as a WebAssembly module.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from hexapod_cosim.controller import PATTERNS, Gait, make_gait
from hexapod_cosim.cosim.common.components import CONTROLLER
from hexapod_cosim.cosim.common.files import write_text
from hexapod_cosim.cosim.interface.plant_interface import enumerations_of, load_interface
from hexapod_cosim.cosim.report.geometry import describe_ground, describe_shape
from hexapod_cosim.cosim.results.walk import robot_weight
from hexapod_cosim.cosim.scenario.records import CONTROLS
from hexapod_cosim.cosim.scenario.scenario import load_scenario
from hexapod_cosim.extensions.live.gait_change import SHARE
from hexapod_cosim.extensions.live.module import walker_module
from hexapod_cosim.extensions.live.page import describe, fill_page
from hexapod_cosim.extensions.live.settings import FLAT, Choices, control_texts, find_limits
from hexapod_cosim.models import Robot, load_robot

SCENARIO = "walk_flat"


def write_static_page(path: Path) -> Path:
    """Writes the page and returns its path.

    Raises HexapodError without the viewer or the module, and when the path cannot be written.
    """
    write_text(path, render_static_page())
    return path


def render_static_page() -> str:
    """Returns the page. Raises HexapodError without the viewer or the module."""
    scenario = load_scenario(SCENARIO)
    choices = Choices(scenario, control_texts(scenario), {})
    robot = load_robot(scenario.robot)
    return fill_page(choices, _setup(choices, robot), walker_module())


def _setup(choices: Choices, robot: Robot) -> dict[str, Any]:
    """Returns what the page reads (cosim/viewer/src/browser/local.ts)."""
    parameters, types = _parameters(robot), enumerations_of(CONTROLLER)
    world = {
        "robot": describe_shape(parameters, robot.torso.size),
        "ground": describe_ground(parameters),
        "surfaces": [],
        "weight": round(robot_weight(parameters), 3),
        "step": choices.scenario.macro_step,
    }
    return describe(choices) | {
        "world": world,
        "first": vars(replace(choices.first(), ground=FLAT)),
        "grounds": [],
        "numbers": {name: types["Control"].number(name) for name in CONTROLS},
        "share": SHARE,
        "walks": {
            name: _walk(make_gait(robot, name), types["GaitPattern"].number(name), robot)
            for name in PATTERNS
        },
    }


def _walk(gait: Gait, pattern: int, robot: Robot) -> dict[str, Any]:
    """Returns a gait with its pattern's number in the order of hxWalk, and the largest commands
    with it.
    """
    numbers = [pattern, gait.period, gait.duty, gait.step_height, gait.touchdown_speed]
    return {"gait": numbers, "limits": vars(find_limits(robot, gait))}


def _parameters(robot: Robot) -> dict[str, float]:
    """Returns the start values of the plant's parameters by name."""
    return {
        variable.name: float(variable.start)
        for variable in load_interface(robot).variables
        if variable.causality == "parameter" and variable.start is not None
    }
