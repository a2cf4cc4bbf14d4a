"""Walks on surfaces: the walk on a grid that is a plane, grids in FMUs, the energy balance."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from hexapod_cosim.cosim.export.plant_export import export_fmu
from hexapod_cosim.cosim.results.result import Result
from hexapod_cosim.cosim.run.single_run import simulate
from hexapod_cosim.cosim.run.walker import Walker
from hexapod_cosim.cosim.scenario.scenario import load_scenario
from hexapod_cosim.models import RobotError, load_robot
from hexapod_cosim.models.ground.catalogue import make_surface

RUBBLE = ("terrain.kind=rubble", "terrain.max_height=20 mm")
BALANCE = 1e-4  # of the motors' work


def walk(*overrides: str, fmu: Path | None = None) -> Result:
    settings = ["duration=4", "outputs.plots=false", *overrides]
    return simulate(load_scenario("walk_flat", overrides=settings), fmu=fmu)


def figures(result: Result) -> dict[str, float]:
    """Returns the metrics that have a value, but for the real-time factor."""
    found = {key: value for key, value in result.metrics.items() if not math.isnan(value)}
    del found["realtime_factor"]
    return found


def test_a_walk_on_a_grid_that_is_a_plane_is_the_walk_on_flat_ground(plant_build: Path) -> None:
    grid, flat = walk("terrain.kind=plane"), walk()
    columns = ["torso.position[1]", "torso.position[2]", "torso.position[3]"]
    ways = [result.outcome.recording.columns(columns) for result in (grid, flat)]
    assert ways[0] == pytest.approx(ways[1], abs=1e-9)


def test_a_packed_grid_a_given_fmu_and_the_compiled_loop_give_the_same_figures(
    plant_build: Path, tmp_path: Path
) -> None:
    surfaces = [make_surface("dune", {}), make_surface("rubble", {"max_height": 0.02})]
    fmu = export_fmu(load_robot("athena"), tmp_path / "two.fmu", terrains=surfaces)
    own, given = walk(*RUBBLE), walk(*RUBBLE, fmu=fmu)
    assert figures(own) == figures(given)
    with Walker() as walker:
        scenario = load_scenario("walk_flat", overrides=["duration=4", *RUBBLE])
        compiled = walker.simulate(scenario)
    assert figures(compiled) == pytest.approx(figures(own), rel=1e-6)


@pytest.mark.parametrize(
    ("name", "given", "what"),
    [
        ("random_uniform", {"horizontal_scale": 0.05, "difficulty": 1.0}, "valleys"),
        ("rubble", {"horizontal_scale": 0.01}, "blocks"),
    ],
)
def test_an_export_refuses_further_surfaces_that_do_not_suit_a_foot(
    tmp_path: Path, name: str, given: dict[str, float], what: str
) -> None:
    surfaces = [make_surface("dune", {}), make_surface(name, given)]
    with pytest.raises(RobotError, match=rf"terrain 2, {name}: {what} narrower than a foot"):
        export_fmu(load_robot("athena"), tmp_path / "two.fmu", terrains=surfaces)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("kind", ["rubble", "random_uniform", "wave", "stepping_stones"])
def test_the_energy_balance_holds_on_a_surface(plant_build: Path, kind: str) -> None:
    result = walk(f"terrain.kind={kind}", "terrain.difficulty=0")
    assert abs(result.metrics["energy_residual"]) < BALANCE


def test_a_robot_that_leaves_its_map_is_reported(plant_build: Path) -> None:
    result = walk("terrain.kind=plane", "terrain.size=0.2", "command.vx=0.08")
    assert any("left the map of the ground" in text for text in result.facts.warnings)
