"""Tests the ground of scenarios: keys, units, overrides, grid files in FMUs, heights in results."""

from __future__ import annotations

import tomllib
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomlkit
from PIL import Image

from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.results.support import body_height
from hexapod_cosim.cosim.results.warnings import off_map_warnings, overlap_warnings
from hexapod_cosim.cosim.run.plant import provide_grid
from hexapod_cosim.cosim.scenario.reading import load_scenario, scenario_from_table, scenario_robot
from hexapod_cosim.models import LEG_NAMES, ScenarioError
from hexapod_cosim.models.ground.grid_file import grid_bytes
from hexapod_cosim.models.ground.surface import Surface
from hexapod_cosim.models.ground.table import make_surface

GRID = {"terrain.kind": 3.0}


def surface_of(*overrides: str, scenario: str = "stand") -> Surface:
    """Returns the surface of a bundled scenario with settings."""
    found = scenario_robot(load_scenario(scenario, overrides=list(overrides))).terrain.surface
    assert found is not None
    return found


def test_settings_choose_a_surface_and_its_parameters() -> None:
    surface = surface_of("terrain.kind=stairs", "terrain.step_height=30 mm", "terrain.num_steps=2")
    assert surface == make_surface("stairs", {"step_height": 0.03, "num_steps": 2})
    assert surface.recipe == {"kind": "stairs", "step_height": 0.03, "num_steps": 2.0}


def test_patches_are_tables_of_a_scenario() -> None:
    table = tomllib.loads(
        "[terrain]\nkind = 'plane'\n[[terrain.patch]]\nx = '50 cm'\ny = 0\nsize = ['1 m', 0.5]\n"
        "mu = 0.2\n[[terrain.patch]]\nx = 0.5\ny = 0\nsize = 0.3\nsoil = 'clay'\n"
    )
    scenario = scenario_from_table(table, where="test")
    surface = scenario_robot(scenario).terrain.surface
    assert surface is not None
    assert [surface.material_at(x, 0.0) for x in (0.0, 0.2, 0.5, 1.2)] == [1, 1, 2, 0]
    again = scenario_from_table(tomllib.loads(tomlkit.dumps(scenario.to_table())), where="again")
    assert scenario_robot(again) == scenario_robot(scenario)


def test_a_height_map_lies_beside_its_scenario(tmp_path: Path) -> None:
    levels = np.array([[0, 20, 0], [0, 0, 10]], np.uint16)
    Image.fromarray(levels).save(tmp_path / "map.png")
    text = """[terrain]\nkind = "heightfield"\nfile = "map.png"
    horizontal_scale = 0.5\nvertical_scale = 0.001"""
    (tmp_path / "walk.toml").write_text(text, encoding="utf-8")
    surface = scenario_robot(load_scenario(tmp_path / "walk.toml")).terrain.surface
    assert surface is not None
    assert surface.kind == "smooth"
    assert surface.height[::-1] == pytest.approx(0.001 * levels)


REFUSED = [
    (["terrain.kind=stiars"], "did you mean 'stairs'", "--set terrain.kind"),
    (["terrain.kind=stairs", "terrain.amplitude=0.1"], "unknown key", "--set terrain.amplitude"),
    (["terrain.step_higth=0.1"], "did you mean 'step_height'", "--set terrain.step_higth"),
    (["terrain.step_height=0.1"], "unknown key", "stand.toml: terrain"),
    (
        ["terrain.kind=stairs", "terrain.step_height=3 deg"],
        "m or mm or cm",
        "--set terrain.step_height",
    ),
    (
        ["terrain.kind=stairs", "terrain.patch=[{x=9, y=0, size=1, mu=0.1}]"],
        "leaves the map",
        "stand.toml: terrain.patch[0]",
    ),
    (
        ["terrain.kind=plane", "terrain.patch=[{x=0, y=0, size=1, soil='mood'}]"],
        "soil",
        "--set terrain.patch[0].soil",
    ),
    (
        [
            *("terrain.kind=heightfield", "terrain.file=nowhere.png"),
            *("terrain.horizontal_scale=0.1", "terrain.vertical_scale=0.001"),
        ],
        "cannot read",
        "stand.toml: nowhere.png",
    ),
]


@pytest.mark.parametrize(("overrides", "message", "place"), REFUSED)
def test_a_wrong_ground_is_refused_with_its_key(
    overrides: list[str], message: str, place: str
) -> None:
    with pytest.raises(ScenarioError, match=message) as caught:
        scenario_robot(load_scenario("stand", overrides=overrides))
    assert caught.value.where == place


def test_an_opened_fmu_gets_each_grid_once(athena_fmu: Path) -> None:
    stairs, wave = (grid_bytes(make_surface(name, {})) for name in ("stairs", "wave"))
    with Fmu(athena_fmu) as plant:
        assert [provide_grid(plant, content) for content in (stairs, wave, stairs)] == [1, 2, 1]
    with zipfile.ZipFile(athena_fmu) as archive:  # the file itself stays as it is
        assert not [name for name in archive.namelist() if name.endswith(".terrain")]


def recording(rows: int, **columns: Any) -> Recording:
    """Returns a recording with the columns that heights above the ground need."""
    names = ["time", *(f"torso.position[{k}]" for k in (1, 2, 3))]
    names += [f"{leg}.foot.contact" for leg in LEG_NAMES]
    names += [f"{leg}.foot.position[{k}]" for leg in LEG_NAMES for k in (1, 2, 3)]
    data = np.zeros((rows, len(names)))
    for name, values in columns.items():
        data[:, names.index(name.replace("__", "."))] = values
    data[:, 0] = 0.1 * np.arange(rows)
    return Recording(tuple(names), data)


def test_the_height_on_a_surface_is_above_the_feet_in_contact() -> None:
    part = recording(4, LF__foot__contact=[0, 1, 1, 0], RF__foot__contact=[0, 0, 1, 0])
    part.data[:, part.names.index("torso.position[3]")] = 0.2
    part.data[:, part.names.index("LF.foot.position[3]")] = [0.5, 0.04, 0.04, 0.3]
    part.data[:, part.names.index("RF.foot.position[3]")] = [0.5, 0.30, 0.08, 0.3]
    height = body_height(part, GRID | {"terrain.height": 0.01})
    assert height == pytest.approx([0.19, 0.16, 0.14, 0.14])


def test_a_robot_that_leaves_the_map_is_reported_with_time_and_place() -> None:
    surface = make_surface("stairs", {})
    part = recording(4)
    assert off_map_warnings(part, surface) == []
    part.data[:, part.names.index("torso.position[1]")] = [0.0, 1.5, 2.5, 3.5]
    (warning,) = off_map_warnings(part, surface)
    assert "left the map of the ground at 0.200 s, at x = 2.5 m, y = 0 m" in warning
    assert off_map_warnings(part, None) == []


def test_overlapping_legs_are_reported_once_and_only_on_request() -> None:
    names = ("time", *(f"{leg}.clearance" for leg in LEG_NAMES))
    rows = np.full((4, 7), 0.02)
    rows[:, 0] = [0.0, 0.5, 1.0, 1.5]
    rows[2, 1:3], rows[3, 1:3] = -0.001, -0.0032
    run = Recording(names, rows)
    assert overlap_warnings(run, {"body.self_contact": 1.0}) == []
    assert overlap_warnings(run.rows(slice(0, 2)), {"body.self_contact": 2.0}) == []
    (warning,) = overlap_warnings(run, {"body.self_contact": 2.0})
    assert warning.startswith("legs overlapped from 1.000 s on, for 50.0% of the time: leg LF and ")
    assert "its neighbour by 3.2 mm at 1.500 s" in warning
