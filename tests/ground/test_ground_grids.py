"""Walks on surfaces: the walk on a grid that is a plane, grids in FMUs, the energy balance."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from hexapod_cosim.cosim.export.plant import export_fmu
from hexapod_cosim.cosim.results.result import Result
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
