"""Grids in an FMU's resources: chosen by terrain.grid, refused by name, restored with a state."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from fmi_plant import ATHENA, OK, Plant
from grids import grid_bytes

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


def on_grid(plant: Plant, grid: float) -> int:
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
        assert on_grid(plant, grid) == ERROR
        assert re.search(message, plant.last_message)
        assert plant.set_reals({"terrain.grid": 2.0}) == OK
        assert plant.call("fmi2ExitInitializationMode") == OK


def test_a_restored_state_brings_its_grid(plant_library: Path, resources: Path) -> None:
    with Plant(plant_library, resources=resources.as_uri()) as plant:
        assert on_grid(plant, 2.0) == OK
        before, saved = plant.real("LF.foot.penetration"), plant.save()
        assert plant.call("fmi2Reset") == OK
        assert on_grid(plant, 1.0) == OK
        assert plant.real("LF.foot.penetration") != before
        assert plant.call("fmi2SetFMUstate", saved) == OK
        assert plant.real("LF.foot.penetration") == before
        plant.free(saved)
