"""Makes what an environment runs on: its robot on each ground, the FMUs of the plant and of the
controller that actions are added to, and samples of the grounds for the observation of heights.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.controller import DEFAULT_PERIOD, make_gait
from hexapod_cosim.cosim.export.plant import export_controller, export_fmu
from hexapod_cosim.cosim.interface.controller import ControllerSetup
from hexapod_cosim.cosim.run.plan import make_setup
from hexapod_cosim.extensions.gym.settings import EnvSettings, symmetric
from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.ground.faces import ground_height, surface_heights, surface_of
from hexapod_cosim.models.ground.surface import Surface
from hexapod_cosim.models.ground.table import merged_terrain
from hexapod_cosim.models.records import Array, Terrain
from hexapod_cosim.models.statics import settled
from hexapod_cosim.models.validation.bodies import check_settings

SPACING = 0.02  # m  of the samples
MARGIN = 0.5  # m  beyond the places that a robot can scan after an episode at its largest speed
LARGEST = 20.0  # m  from the origin to an edge of the map


def grounds(settings: EnvSettings) -> tuple[Robot, ...]:
    """Returns the robot on each of the environment's grounds. Raises HexapodError."""
    own = load_robot(settings.robot)
    foot = replace(own.foot, pad_radius=settings.pad_radius or own.foot.pad_radius)
    solver = replace(
        own.solver,
        method=settings.solver,
        tolerance=settings.tolerance,
        step_max=settings.step_max,
    )
    found = []
    for seed in range(1, settings.terrain_seeds + 1):
        given = dict(settings.terrain) | ({"seed": seed} if settings.terrain_seeds > 1 else {})
        terrain = merged_terrain(own.terrain, given, "terrain")
        robot = replace(own, foot=foot, solver=solver, terrain=terrain)
        check_settings(robot, where="environment")
        found.append(robot)
    return tuple(found)


def surfaces(robots: Sequence[Robot]) -> list[Surface]:
    """Returns the different surfaces of robots, in the order of their numbers in the FMU."""
    given = [surface_of(robot.terrain) for robot in robots]
    return list(dict.fromkeys(one for one in given if one is not None))


def start_height(robots: Sequence[Robot]) -> float:
    """Returns the height [m] of the torso at which no foot is deep in any of the grounds."""
    return max(float(settled(robot)[0][2]) for robot in robots)


def export_plant(robots: Sequence[Robot], folder: Path) -> Path:
    """Exports the plant's FMU with all grounds. Raises HexapodError."""
    return export_fmu(robots[0], folder / "plant.fmu", terrains=surfaces(robots))


def controller_setup(settings: EnvSettings, robot: Robot) -> ControllerSetup:
    """Returns the set-up of the controller that actions are added to.

    Raises HexapodError when no gains can be designed.
    """
    if settings.base == "kinematic":
        return ControllerSetup(robot=robot, gait=make_gait(robot), period=DEFAULT_PERIOD)
    return make_setup(load_robot(settings.robot), control=settings.base, period=DEFAULT_PERIOD)


def export_base(settings: EnvSettings, robot: Robot, folder: Path) -> Path:
    """Exports the FMU of the controller that actions are added to. Raises HexapodError."""
    return export_controller(controller_setup(settings, robot), folder / "controller.fmu")


@dataclass(frozen=True)
class GroundMaps:
    """Heights of grounds on a square grid."""

    height: NDArray[np.float32]  # (grounds, rows, columns) m  rows along y, columns along x
    first: float  # m  x and y of the first node
    clearance: float  # m  height of the torso over level ground in the stance


def ground_maps(settings: EnvSettings, robots: Sequence[Robot]) -> GroundMaps:
    """Returns the heights of the grounds, in the order of their numbers in the plant's FMU.

    robots: the robot on each of the grounds. The maps reach as far as it can walk in an episode.
    """
    level = settled(replace(robots[0], terrain=Terrain(kind="flat")))[0]
    speed = max(map(abs, (*settings.command_vx, *settings.command_vy)))
    scanned = math.hypot(settings.scan_length, settings.scan_width)
    reach = min(settings.duration * speed + scanned + MARGIN, LARGEST)
    nodes = np.array(symmetric(2.0 * reach, SPACING))
    base = robots[0].terrain
    found = surfaces(robots)
    heights = [base.height + surface_heights(surface, nodes, nodes) for surface in found]
    height = np.array(heights or [plane_heights(base, nodes)], dtype=np.float32)
    return GroundMaps(height, float(nodes[0]), float(level[2]))


def plane_heights(terrain: Terrain, nodes: Array) -> Array:
    """Returns the heights (y, x) [m] of a plane at all pairs of nodes along x and y [m]."""
    origin = ground_height(terrain, 0.0, 0.0)
    rise_x, rise_y = ground_height(terrain, 1.0, 0.0), ground_height(terrain, 0.0, 1.0)
    return np.add.outer((rise_y - origin) * nodes, (rise_x - origin) * nodes) + origin
