"""The energy books of the plant close in valleys that are little wider than a foot."""

from __future__ import annotations

import ctypes as ct
from dataclasses import replace

import numpy as np
import pytest
from grids import Ground
from states import changed
from test_every_terrain import BOOKS, put
from test_grid_motion import march

from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.ground.catalogue import make_surface
from hexapod_cosim.models.ground.grid_file import grid_bytes
from hexapod_cosim.models.ground.surface import Surface
from hexapod_cosim.models.ground.valleys import tightest_valley
from hexapod_cosim.models.records import Terrain
from hexapod_cosim.models.validation.robot import check_settings

LIMIT, ABOVE = 0.01575, 0.0162  # m: least radius for a foot of 15 mm, and 3 % more


def waves() -> Surface:
    """Returns pits of 123 mm depth and 0.2 m length, with the radius 15.9 mm at their bottoms."""
    x = 0.01 * np.arange(-200, 201)
    wave = 0.0614 * np.cos(2.0 * np.pi / 0.2 * x)
    height = wave[:, None] + wave[None, :]
    return Surface(kind="smooth", height=height, x0=-2.0, y0=-2.0, cell=0.01)


def roughness() -> Surface:
    """Returns random heights within +-27 mm, 50 mm apart."""
    surface = make_surface("random_uniform", {"horizontal_scale": 0.05, "difficulty": 0.3})
    return replace(surface, height=0.6 * surface.height)


@pytest.mark.parametrize("law", ["tanh", "bristle"])
@pytest.mark.parametrize("surface", [waves(), roughness()], ids=["waves", "roughness"])
def test_the_energy_books_close_just_above_the_limit(
    core: ct.CDLL, surface: Surface, law: str
) -> None:
    assert tightest_valley(surface, LIMIT) is None
    assert tightest_valley(surface, ABOVE) is not None
    changes = {"law": law}
    robot: Robot = changed(load_robot("athena"), friction=changes)
    robot = replace(robot, terrain=Terrain(kind="grid", surface=surface))
    check_settings(robot)
    ground = Ground(core, grid_bytes(surface))
    plant = put(core, robot, ground)
    march(plant, 2.0)
    output = plant.output()
    gross = output.positive_work.sum() + output.negative_work.sum()
    assert output.energy.dissipated > 5.0
    assert abs(output.energy.residual) < BOOKS * gross
