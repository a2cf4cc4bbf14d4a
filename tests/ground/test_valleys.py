"""Valleys of smooth surfaces: the plant refuses those that are narrower than a foot, and its energy
books close in those that are little wider.
"""

from __future__ import annotations

import ctypes as ct
from dataclasses import replace

import numpy as np
import pytest
from grids import Ground, start_on_grid
from mirror import INVALID_MODEL
from plant import Plant, PlantError
from states import changed

from hexapod_cosim.models import RobotError, load_robot
from hexapod_cosim.models.ground.grid_file import grid_bytes
from hexapod_cosim.models.ground.surface import Surface
from hexapod_cosim.models.ground.valleys import tightest_valley
from hexapod_cosim.models.records import Terrain
from hexapod_cosim.models.validation.robot import check_settings


def rough(seed: int, shape: tuple[int, int]) -> Surface:
    """Returns random heights up to 60 mm at nodes 50 mm apart."""
    height = np.random.default_rng(seed).uniform(0.0, 0.06, shape)
    return Surface(kind="smooth", height=height, x0=0.3, y0=-0.2, cell=0.05)


@pytest.mark.parametrize("shape", [(2, 2), (4, 3), (5, 30), (40, 25)])
@pytest.mark.parametrize("knee", [0.01, 0.05])
def test_the_plant_refuses_narrow_valleys_with_the_words_of_robot_files(
    core: ct.CDLL, shape: tuple[int, int], knee: float
) -> None:
    robot = changed(load_robot("athena"), body={"contact": "on", "knee_radius": knee})
    surface = rough(sum(shape), shape)
    plant = Plant(core, robot)
    before = plant.save()
    if tightest_valley(surface, 1.05 * max(0.015, knee)) is None:
        start_on_grid(plant, Ground(core, grid_bytes(surface)), position=(0.0, 0.0, 9.0))
        return
    with pytest.raises(RobotError) as twin:
        check_settings(replace(robot, terrain=Terrain(kind="grid", surface=surface)))
    with pytest.raises(PlantError) as refused:
        start_on_grid(plant, Ground(core, grid_bytes(surface)), position=(0.0, 0.0, 9.0))
    assert refused.value.status == INVALID_MODEL
    assert plant.save() == before
    assert words(refused.value) == words(twin.value)
    assert "than a foot" in str(twin.value) or knee == 0.05


def words(error: Exception) -> list[str]:
    """Returns the words of a message from that of the valleys on, without quotes."""
    return str(error).partition("valleys narrower")[2].replace("'", "").split()
