"""Tests walks on surfaces and grids: a grid that is a plane, grids in an FMU's resources, and the
bundled scenarios of uneven ground.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from fmi_plant import ATHENA, OK, Plant
from grids import grid_bytes

from hexapod_cosim.cosim.export.plant import export_fmu
from hexapod_cosim.cosim.results.facts import Result
from hexapod_cosim.cosim.run.runner import Runner
from hexapod_cosim.cosim.run.single_run import simulate
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.models import load_robot
from hexapod_cosim.models.ground.table import make_surface

RUBBLE = ("terrain.kind=rubble", "terrain.max_height=20 mm")


def walk(*overrides: str, fmu: Path | None = None) -> Result:
    settings = ["duration=4", "outputs.plots=false", *overrides]
    return simulate(load_scenario("walk_flat", overrides=settings), fmu=fmu)


def figures(result: Result) -> dict[str, float]:
    """Returns the metrics that have a value, but for the real-time factor."""
    found = {key: value for key, value in result.metrics.items() if not math.isnan(value)}
    del found["realtime_factor"]
    return found


def test_a_packed_grid_a_given_fmu_and_the_compiled_loop_give_the_same_figures(
    plant_build: Path, tmp_path: Path
) -> None:
    surfaces = [make_surface("dune", {}), make_surface("rubble", {"max_height": 0.02})]
    fmu = export_fmu(load_robot("athena"), tmp_path / "two.fmu", terrains=surfaces)
    own, given = walk(*RUBBLE), walk(*RUBBLE, fmu=fmu)
    assert figures(own) == figures(given)
    with Runner() as runner:
        scenario = load_scenario("walk_flat", overrides=["duration=4", *RUBBLE])
        compiled = runner.simulate(scenario)
    assert figures(compiled) == pytest.approx(figures(own), rel=1e-6)


# Grids in an FMU's resources: chosen by terrain.grid, refused by name, restored with a state.

ERROR = 3
GRID = 3  # terrain.kind


@pytest.fixture
def resources(tmp_path: Path) -> Path:
    """Returns a resources folder with three grids: level at 0 and at -50 mm, and a damaged one."""
    folder = tmp_path / "resources of an FMU" / "terrain"
    folder.mkdir(parents=True)
    for number, height in ((1, 0.0), (2, -0.05)):
        file = grid_bytes(np.full((41, 41), height), cell=0.1, origin=(-2.0, -2.0))
        (folder / f"{number}.terrain").write_bytes(file)
    (folder / "3.terrain").write_bytes(b"hxGrid01 and nothing more")
    return folder.parent


def chosen_grid(plant: Plant, grid: float) -> int:
    """Chooses a grid and initialises the plant; returns the status of initialisation."""
    assert plant.call("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0) == OK
    assert plant.call("fmi2EnterInitializationMode") == OK
    kind = ATHENA.references(["terrain.kind"])
    assert plant.set_references("fmi2SetInteger", kind, [GRID]) == OK
    assert plant.set_reals({"terrain.grid": grid}) == OK
    return plant.call("fmi2ExitInitializationMode")


@pytest.mark.parametrize(
    ("grid", "message"),
    [
        (9.0, r"terrain.grid: got 9, expected the number of a grid .*9\.terrain.* missing"),
        (3.0, r"terrain.grid: got 3, .*at least the 128 bytes of a grid file's head"),
        (1.5, r"terrain.grid: got 1.5, .*whole number"),
    ],
)
def test_a_grid_that_is_not_there_is_refused_by_name(
    plant_library: Path, resources: Path, grid: float, message: str
) -> None:
    with Plant(plant_library, resources=resources.as_uri()) as plant:
        assert chosen_grid(plant, grid) == ERROR
        assert re.search(message, plant.last_message)
        assert plant.set_reals({"terrain.grid": 2.0}) == OK
        assert plant.call("fmi2ExitInitializationMode") == OK


def test_a_restored_state_brings_its_grid(plant_library: Path, resources: Path) -> None:
    with Plant(plant_library, resources=resources.as_uri()) as plant:
        assert chosen_grid(plant, 2.0) == OK
        before, saved = plant.real("LF.foot.penetration"), plant.save()
        assert plant.call("fmi2Reset") == OK
        assert chosen_grid(plant, 1.0) == OK
        assert plant.real("LF.foot.penetration") != before
        assert plant.call("fmi2SetFMUstate", saved) == OK
        assert plant.real("LF.foot.penetration") == before
        plant.free(saved)


# Walks on the bundled scenarios of uneven ground, with both controls.

CONTROLS = ("kinematic", "compliant")  # the paper's control does not climb the stairs
ENERGY = 1e-4  # of the motors' work
SHARE = 0.7  # of the commanded way that the robot has to walk
# scenario -> way [m] of the measured cycles that the command asks for
WAYS = {"stairs": 0.78, "rubble": 0.6, "stones": 0.6, "dune": 1.08, "ramp": 1.38}


@pytest.fixture(scope="module")
def runner(plant_build: Path) -> Iterator[Runner]:
    with Runner() as made:
        yield made


@pytest.mark.parametrize("name", WAYS)
@pytest.mark.parametrize("control", CONTROLS)
def test_both_controls_walk_it_upright(runner: Runner, name: str, control: str) -> None:
    result = runner.simulate(load_scenario(name, overrides=[f"control={control}"]))
    walk = result.facts.walk
    assert result.completed
    assert walk.upright
    assert walk.distance > SHARE * WAYS[name]
    assert result.metrics["energy_residual"] < ENERGY


@pytest.mark.usefixtures("plant_build")
def test_feet_that_find_no_ground_neither_end_the_run_nor_its_metrics() -> None:
    """The robot steps into gaps deeper than its legs reach, and falls or hangs between them."""
    settings = [
        "control=compliant",
        "terrain.kind=gaps",
        "terrain.gap_size=0.3",
        "terrain.depth=1",
        "command.vx=0.1",
        "duration=12",
    ]
    result = simulate(load_scenario("walk_flat", overrides=settings))
    assert result.completed
    fell = any("the robot fell at" in text for text in result.facts.warnings)
    assert result.facts.walk.upright == (not fell)
    for name in ("peak_force", "slip_per_metre", "roll_rms", "energy_residual"):
        assert math.isfinite(result.metrics[name])
    assert result.surface is not None
    assert result.surface.recipe["kind"] == "gaps"
