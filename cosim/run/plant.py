"""Opens and prepares the plant FMU of a run."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from hexapod_cosim.cosim.common.components import PLANT
from hexapod_cosim.cosim.common.temporary import TemporaryFolder
from hexapod_cosim.cosim.interface.plant import plant_roots
from hexapod_cosim.cosim.interface.start_values import parameter_values
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.results.ground import is_on_surface, surface_of_grid
from hexapod_cosim.cosim.run.plan import RunPlan
from hexapod_cosim.cosim.run.preparation import PlantFmus
from hexapod_cosim.cosim.scenario.reading import scenario_robot
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.cosim.scenario.variation import (
    initial_values,
)
from hexapod_cosim.models import LEG_NAMES, FmuError, Robot
from hexapod_cosim.models.ground.faces import surface_of
from hexapod_cosim.models.ground.grid_file import grid_bytes
from hexapod_cosim.models.ground.surface import Surface

# parameters with these prefixes describe the robot; all others are settings
BODY_PARAMETERS = ("torso.", "foot.", *(f"{leg}." for leg in LEG_NAMES))
GRID = "terrain.grid"  # parameter: number of the grid file in the FMU's resources
SAME = 1e-9  # relative, of a parameter that was printed and read again


@contextmanager
def open_plant(
    scenario: Scenario, path: Path | None = None, *, robot: Robot | None = None
) -> Iterator[Fmu]:
    """Opens the FMU of a scenario and sets the scenario's laws and settings.

    The FMU is exported to a temporary folder, or the one at `path`, which must hold the same robot.

    robot: the scenario's robot in the stance of its walk; by default in its own stance.
    """
    with TemporaryFolder("export") as folder:
        fmus = PlantFmus(folder, given=path)
        with Fmu(fmus.fmu(scenario.robot)) as plant:
            apply_settings(plant, scenario_robot(scenario) if robot is None else robot)
            yield plant


def apply_settings(plant: Fmu, robot: Robot) -> None:
    """Sets the laws and settings of an FMU to those of the robot.

    Raises FmuError when the FMU holds another robot.
    """
    plant.set_parameters(different_settings(plant, robot))


def different_settings(plant: Fmu, robot: Robot) -> dict[str, float]:
    """Returns the robot's laws and settings that differ from those of an FMU.

    Raises FmuError when the FMU holds another robot.
    """
    wanted = parameter_values(PLANT, plant_roots(robot)) | _grid_of(plant, robot)
    present = plant.parameters()
    changes = {
        name: value
        for name, value in wanted.items()
        if name in present and not math.isclose(present[name], value, rel_tol=SAME, abs_tol=SAME**2)
    }
    for name, value in changes.items():
        if name.startswith(BODY_PARAMETERS):
            fix = (
                "export one of this robot with `hexapod export --robot`, "
                "or name the FMU's robot in the scenario"
            )
            expected = f"{value:g}, as robot {robot.name!r} has"
            raise FmuError(
                f"the FMU holds another robot: {name}",
                got=present[name],
                expected=expected,
                fix=fix,
                where=str(plant.path),
            )
    return changes


def _grid_of(plant: Fmu, robot: Robot) -> dict[str, float]:
    """Returns the parameter that chooses the robot's surface, whose grid file the FMU gets."""
    surface = surface_of(robot.terrain)
    if surface is None:
        return {}
    return {GRID: float(plant.provide_grid(grid_bytes(surface)))}


def run_surface(plant: Fmu, robot: Robot, parameters: Mapping[str, float]) -> Surface | None:
    """Returns the surface that a plant with these parameters read from its resources.

    It has the recipe of the robot's surface if both are equal.
    """
    if not is_on_surface(parameters):
        return None
    own, content = surface_of(robot.terrain), plant.grid(round(parameters[GRID]))
    if own is not None and content == grid_bytes(own):
        return own
    return surface_of_grid(content, {})


def initialise_plant(plant: Fmu, plan: RunPlan) -> dict[str, float]:
    """Initialises a plant with the scenario's parameters and the drawn initial values.

    Returns all parameters as they then hold.
    """
    scenario = plan.scenario
    plant.set_parameters(scenario.parameters)
    if plan.drawn is not None:
        plant.set_parameters(initial_values(plan.robot, plant.parameters(), plan.drawn))
    plant.initialise(scenario.start, scenario.start + scenario.duration)
    return plant.parameters()
