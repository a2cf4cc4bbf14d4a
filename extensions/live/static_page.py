"""Writes a page in which the default robot walks without a server: one HTML file.

It is that of `hexapod live`, with plant, controller and their loop as WebAssembly (wasm/robot.c).
"""

from __future__ import annotations

import base64
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from hexapod_cosim.controller import PATTERNS, make_gait
from hexapod_cosim.cosim.common.components import CONTROLLER
from hexapod_cosim.cosim.common.files import write_text
from hexapod_cosim.cosim.common.plant_files import in_source_tree, plant_folders
from hexapod_cosim.cosim.export.cross_build import Library, Target, build_library
from hexapod_cosim.cosim.interface.plant import enumerations_of, load_interface
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.cosim.scenario.records import CONTROLS
from hexapod_cosim.extensions.live import settings as live
from hexapod_cosim.extensions.live.page import describe_world, render_page
from hexapod_cosim.models import HexapodError, Robot, load_robot

_TREE = Path(__file__).resolve().parents[2]
# a module for browsers; all of them have vectors since 2021 or 2023 (Safari)
FEATURES = "generic+simd128+bulk_memory+nontrapping_fptoint"
LINKED = ("-Wl,--export-dynamic", "-Wl,--strip-all", "-Wl,-z,stack-size=1048576")
BROWSER = Target("wasm32-wasi", ".wasm", LINKED, FEATURES, ("-mexec-model=reactor",))


def write_static_page(path: Path) -> Path:
    """Writes the page and returns its path.

    Raises HexapodError without the viewer or the module, and when the path cannot be written.
    """
    scenario = load_scenario("walk_flat")
    choices = live.Choices(scenario, live.control_texts(scenario), {})
    module = base64.b64encode(robot_module()).decode("ascii")
    write_text(path, render_page(choices, _setup(choices), module=module))
    return path


def _setup(choices: live.Choices) -> dict[str, Any]:
    """Returns what the page reads (viewer/local.ts)."""
    robot, types = load_robot(choices.scenario.robot), enumerations_of(CONTROLLER)
    known = [v for v in load_interface(robot).variables if v.causality == "parameter"]
    start = {one.name: float(one.start) for one in known if one.start is not None}
    return {
        "world": describe_world(robot, start, choices.scenario.macro_step),
        "first": vars(replace(choices.first(), ground=live.FLAT)),
        "grounds": [],
        "numbers": {name: types["Control"].number(name) for name in CONTROLS},
        "walks": {name: _walk(robot, name, types["GaitPattern"].number(name)) for name in PATTERNS},
    }


def _walk(robot: Robot, name: str, pattern: int) -> dict[str, Any]:
    """Returns a gait in the order of hx_page_gait (wasm/robot.c), and the changes from it."""
    gait = make_gait(robot, name)
    plans = {other: live.plan_change(robot, gait, make_gait(robot, other)) for other in PATTERNS}
    return {
        "gait": [pattern, gait.period, gait.duty, gait.step_height, gait.touchdown_speed],
        "limits": vars(live.find_limits(robot, gait)),
        "changes": {other: asdict(plan) for other, plan in plans.items()},
    }


def robot_module() -> bytes:
    """Returns the module: that of a released wheel, or one that is compiled, or from the cache.

    Raises HexapodError in a wheel for one machine, and FmuError without a cross compiler.
    """
    if in_source_tree():
        return build_library(Library("robot", _sources(), flags=("-DHX_SHARED",)), BROWSER)
    path = plant_folders()[0] / "browser" / "robot.wasm"
    if path.is_file():
        return path.read_bytes()
    raise HexapodError("no WebAssembly module", got="a wheel for one machine", fix="use a clone")


def _sources() -> dict[str, Path]:
    """Returns the module's sources by their paths where they are compiled."""
    found = {
        "robot.c": _TREE / "extensions/live/wasm/robot.c",
        "plant_defaults.c": _TREE / "plant_fmu/generated/defaults.c",
        "controller_defaults.h": _TREE / "controller/fmu/generated/defaults.c",
    }
    for name in ("plant_fmu", "controller/fmu", "cosim/master"):
        include, source = _TREE / name / "include", _TREE / name / "src"
        found |= {path.relative_to(include).as_posix(): path for path in include.rglob("*.h")}
        found |= {path.relative_to(_TREE).as_posix(): path for path in source.rglob("*.[ch]")}
    return dict(sorted(found.items()))
