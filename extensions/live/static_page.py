"""Writes a page in which the default robot walks without a server: one HTML file.

The page is that of `hexapod live`. Plant, controller and the macro-step of both
(cosim/master/src/macro_step.c) are inside as a WebAssembly module (wasm/robot.c).
"""

from __future__ import annotations

import base64
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from hexapod_cosim.controller import PATTERNS, Gait, make_gait
from hexapod_cosim.cosim.common.components import CONTROLLER
from hexapod_cosim.cosim.common.files import write_text
from hexapod_cosim.cosim.common.plant_files import in_source_tree, plant_folders
from hexapod_cosim.cosim.export.cross_build import BROWSER, Library, build_library
from hexapod_cosim.cosim.interface.plant import enumerations_of, load_interface
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.cosim.scenario.records import CONTROLS
from hexapod_cosim.extensions.live.gait_change import plan_change
from hexapod_cosim.extensions.live.page import render_page
from hexapod_cosim.extensions.live.settings import FLAT, Choices, control_texts, find_limits
from hexapod_cosim.extensions.live.state import describe_world
from hexapod_cosim.models import HexapodError, Robot, load_robot

SCENARIO = "walk_flat"
MODULE = "robot"
CONTROLLER_ROBOT = "controller/fmu/generated/defaults.c"  # wasm/controller_defaults.c says why
_TREE = Path(__file__).resolve().parents[2]


def write_static_page(path: Path) -> Path:
    """Writes the page and returns its path.

    Raises HexapodError without the viewer or the module, and when the path cannot be written.
    """
    scenario = load_scenario(SCENARIO)
    choices = Choices(scenario, control_texts(scenario), {})
    module = base64.b64encode(robot_module()).decode("ascii")
    more = _setup(choices, load_robot(scenario.robot))
    write_text(path, render_page(choices, more, module=module))
    return path


def _setup(choices: Choices, robot: Robot) -> dict[str, Any]:
    """Returns what the page reads (viewer/local.ts)."""
    types = enumerations_of(CONTROLLER)
    gaits = {name: make_gait(robot, name) for name in PATTERNS}
    return {
        "world": describe_world(robot, _parameters(robot), choices.scenario.macro_step),
        "first": vars(replace(choices.first(), ground=FLAT)),
        "grounds": [],
        "numbers": {name: types["Control"].number(name) for name in CONTROLS},
        "walks": {
            name: _walk(robot, gait, gaits, types["GaitPattern"].number(name))
            for name, gait in gaits.items()
        },
    }


def _walk(robot: Robot, gait: Gait, gaits: Mapping[str, Gait], pattern: int) -> dict[str, Any]:
    """Returns a gait in the order of hx_page_gait (wasm/robot.c), and the changes from it."""
    plans = {name: plan_change(robot, gait, other) for name, other in gaits.items()}
    return {
        "gait": [pattern, gait.period, gait.duty, gait.step_height, gait.touchdown_speed],
        "limits": vars(find_limits(robot, gait)),
        "changes": {
            name: vars(plan) | {"limits": vars(plan.limits)} for name, plan in plans.items()
        },
    }


def _parameters(robot: Robot) -> dict[str, float]:
    """Returns the start values of the plant's parameters by name."""
    return {
        variable.name: float(variable.start)
        for variable in load_interface(robot).variables
        if variable.causality == "parameter" and variable.start is not None
    }


def robot_module() -> bytes:
    """Returns the module: that of a released wheel, or one that is compiled, or from the cache.

    Raises HexapodError in a wheel that was built for one machine, and FmuError without a cross
    compiler.
    """
    if in_source_tree():
        return build_library(_library(), BROWSER)
    for folder in plant_folders():
        path = folder / "browser" / f"{MODULE}.wasm"
        if path.is_file():
            return path.read_bytes()
    raise HexapodError(
        "no WebAssembly module in this installation",
        got="a wheel that was built for one machine",
        expected="a clone, or a wheel of `make wheels`",
        fix="install one of these",
    )


def _library() -> Library:
    """Returns the sources of the module by their paths in the repository.

    Public headers are at their path in the include folder.
    """
    paths = [_TREE / "cosim" / "master" / "src" / "macro_step.c"]
    paths += sorted((_TREE / "extensions" / "live" / "wasm").glob("*.c"))
    found: dict[str, Path] = {}
    for component in ("plant_fmu", "controller/fmu"):
        paths += (_TREE / component / "src").rglob("*.[ch]")
        paths.append(_TREE / component / "generated" / "defaults.c")
    for folder in ("plant_fmu", "controller/fmu", "cosim/master"):
        include = _TREE / folder / "include"
        found |= {path.relative_to(include).as_posix(): path for path in include.rglob("*.h")}
    found |= {path.relative_to(_TREE).as_posix(): path for path in paths}
    return Library(
        MODULE, dict(sorted(found.items())), flags=("-DHX_SHARED",), included=(CONTROLLER_ROBOT,)
    )
