"""Exports the FMUs of an environment: the plant with the environment's robot, ground and solver,
and the controller that actions are added to.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from hexapod_cosim.controller import DEFAULT_PERIOD, make_gait
from hexapod_cosim.cosim.export.plant_export import export_controller, export_fmu
from hexapod_cosim.cosim.interface.controller_interface import ControllerSetup
from hexapod_cosim.cosim.run.controller_setup import make_setup
from hexapod_cosim.extensions.gym.settings import EnvSettings
from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.ground.faces import surface_of
from hexapod_cosim.models.ground.surface import Surface
from hexapod_cosim.models.ground.table import merged_terrain
from hexapod_cosim.models.statics import settled
from hexapod_cosim.models.validation.bodies import check_settings


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
