"""Exports, opens and prepares the plant FMUs of runs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path

from hexapod_cosim.cosim.common.components import PLANT
from hexapod_cosim.cosim.common.plant_files import binary, fmi2_platform
from hexapod_cosim.cosim.common.temporary import TemporaryFolder
from hexapod_cosim.cosim.export.plant import export_fmu
from hexapod_cosim.cosim.interface.plant import parameter_values, plant_roots
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.results.ground import is_on_surface, surface_of_grid
from hexapod_cosim.cosim.run.plan import RunPlan
from hexapod_cosim.cosim.scenario.reading import scenario_robot
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.cosim.scenario.variation import initial_values
from hexapod_cosim.models import LEG_NAMES, FmuError, Robot, load_robot
from hexapod_cosim.models.ground.faces import surface_of
from hexapod_cosim.models.ground.grid_file import grid_bytes
from hexapod_cosim.models.ground.surface import Surface

# parameters with these prefixes describe the robot; all others are settings
BODY_PARAMETERS = ("torso.", "foot.", *(f"{leg}." for leg in LEG_NAMES))
GRID = "terrain.grid"  # parameter: number of the grid file in the FMU's resources
MAX_FMUS = 8  # of 1 MB that a process keeps; the least recently used one goes first
SAME = 1e-9  # relative, of a parameter that was printed and read again


@lru_cache(maxsize=MAX_FMUS)
def _content(robot: Robot, _binary: Path, _changed: int) -> bytes:
    """Returns the plant FMU of a robot with a binary, which was changed at that time [ns].

    It holds what a run reads, without documentation, pictures and sources.
    """
    with TemporaryFolder("export") as folder:
        return export_fmu(robot, folder / f"{robot.name}.fmu", bare=True).read_bytes()


class PlantFmus:
    """Plant FMUs, exported when they are first asked for and kept for later runs.

    A process packs each of them once. They are kept by the robot file's content: a run sets the
    laws and settings of its scenario itself.

    Args:
        folder: where FMUs are exported to.
        given: the FMU of all runs; by default one is exported for each robot.
    """

    def __init__(self, folder: Path, given: Path | None = None) -> None:
        self._folder, self._given = folder, given
        self._exported: dict[str, Path] = {}

    def fmu(self, robot: str) -> Path:
        """Returns the plant FMU of a robot, given by its name or file. Raises HexapodError."""
        if self._given is not None:
            return self._given
        own = load_robot(robot)
        if own.hash not in self._exported:
            path = self._folder / str(len(self._exported)) / f"{own.name}.fmu"
            packed = binary(fmi2_platform(), PLANT)
            content = _content(own, packed, packed.stat().st_mtime_ns)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
            self._exported[own.hash] = path
        return self._exported[own.hash]


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
    return {GRID: float(provide_grid(plant, grid_bytes(surface)))}


def provide_grid(plant: Fmu, content: bytes) -> int:
    """Puts a grid file into the unpacked resources of an instance, unless one of equal content is
    there, and returns its number, which is a value of terrain.grid.
    """
    folder = plant.resources / "terrain"
    files = {int(path.stem): path for path in folder.glob("*.terrain") if path.stem.isdecimal()}
    for number, path in files.items():
        if path.read_bytes() == content:
            return number
    number = 1 + max(files, default=0)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{number}.terrain").write_bytes(content)
    return number


def run_surface(plant: Fmu, robot: Robot, parameters: Mapping[str, float]) -> Surface | None:
    """Returns the surface that a plant with these parameters read from its resources.

    It has the recipe of the robot's surface if both are equal.
    """
    if not is_on_surface(parameters):
        return None
    path = plant.resources / "terrain" / f"{round(parameters[GRID])}.terrain"
    own, content = surface_of(robot.terrain), path.read_bytes() if path.is_file() else None
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
