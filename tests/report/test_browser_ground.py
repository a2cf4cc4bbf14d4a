"""The report of a walk on a surface in a real browser: mesh, dents, legend."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import FLAGS, Opened, find_chromium, launcher

from hexapod_cosim.cosim.report.writing import write_report
from hexapod_cosim.cosim.results.folder import StoredResult, stored_result
from hexapod_cosim.cosim.results.footprints import find_footprints
from hexapod_cosim.cosim.results.support import GRID
from hexapod_cosim.cosim.run.single_run import simulate
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.models import LEG_NAMES
from hexapod_cosim.models.ground.surface import Surface
from hexapod_cosim.models.ground.table import make_surface

SUNK = 0.012  # m    that feet stand in the drawn ground

pytestmark = pytest.mark.usefixtures("undrawn")


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with launcher() as launch:
        yield launch(*FLAGS)


@pytest.fixture(scope="module")
def walk(plant_build: Path) -> StoredResult:
    """Returns a walk on flat ground, which the tests draw on surfaces."""
    find_chromium()
    return stored_result(simulate(load_scenario("walk_flat", overrides=["duration=3"])))


def opened(
    walk: StoredResult,
    surface: Surface,
    folder: Path,
    browser: Any,
    *,
    sunk: float = 0.0,
    **how: Any,
) -> Opened:
    """Opens the report of the walk as if on a surface, its feet in footprints of depth `sunk`."""
    recording = walk.view.recording
    data = recording.data.copy()
    for leg in LEG_NAMES:
        data[:, recording.names.index(f"{leg}.foot.position[3]")] -= sunk
        contact = data[:, recording.names.index(f"{leg}.foot.contact")]
        data[:, recording.names.index(f"{leg}.foot.sinkage")] = sunk * contact
    parameters = {**walk.view.parameters, "terrain.kind": float(GRID)}
    view = replace(
        walk.view, recording=replace(recording, data=data), parameters=parameters, surface=surface
    )
    write_report({"kinematic": replace(walk, view=view)}, folder, warn=lambda _: None)
    return Opened(browser, folder / "report.html", address="#t=2.9", **how)


def test_blocks_have_tops_and_walls_between_different_heights(
    walk: StoredResult, tmp_path: Path, browser: Any
) -> None:
    heights = np.zeros((40, 60))
    heights[:, 30:] = -0.05
    surface = Surface(kind="blocks", height=heights, x0=-1.0, y0=-1.0, cell=0.05)
    page = opened(walk, surface, tmp_path, browser)
    assert page.errors == []
    assert page.value("window.hexapod.shown('kinematic').triangles") == 2 * (40 * 60 + 40)
    assert page.value("window.hexapod.shown('kinematic').dents") == 0  # on hard ground
    page.close()


def test_forty_thousand_blocks_of_different_height_open(
    walk: StoredResult, tmp_path: Path, browser: Any
) -> None:
    row, column = np.indices((200, 200))
    # neighbours always differ
    heights = np.asarray(-1e-3 * ((7 * row + 13 * column) % 97), dtype=np.float64)
    surface = Surface(kind="blocks", height=heights, x0=-5.0, y0=-5.0, cell=0.05)
    page = opened(walk, surface, tmp_path, browser)
    assert page.errors == []
    # tops, and walls between neighbours along both axes
    faces = 200 * 200 + 2 * 199 * 200
    assert page.value("window.hexapod.shown('kinematic').triangles") == 2 * faces
    page.close()


def test_feet_in_soil_leave_a_dent_at_each_touch_down(
    walk: StoredResult, tmp_path: Path, browser: Any
) -> None:
    surface = make_surface("sand", {})
    page = opened(walk, surface, tmp_path, browser, sunk=SUNK, color_scheme="dark")
    assert page.errors == []
    contact = walk.view.recording.feet("contact") > 0.5
    for row in (10, 250, len(contact) - 2):
        page.seek(float(walk.view.recording.time[row]) + 1e-3)
        begun = contact[0].sum() + (contact[1 : row + 1] & ~contact[:row]).sum()
        assert page.value("window.hexapod.shown('kinematic').dents") == begun
    assert "Dry sand (LLL)" in page.page.locator(".keys").inner_text()
    page.close()


def test_footprints_in_a_soft_plane_are_drawn_too(
    plant_build: Path, tmp_path: Path, browser: Any
) -> None:
    overrides = ["duration=2.5", "soil=dry_sand", "foot.pad_radius=0.025", "command.vx=0.06"]
    run = stored_result(simulate(load_scenario("walk_flat", overrides=overrides)))
    write_report({"kinematic": run}, tmp_path, warn=lambda _: None)
    page = Opened(browser, tmp_path / "report.html", address="#t=2.4")
    assert page.errors == []
    found = find_footprints(run.view.recording, run.view.parameters)
    assert len(found) >= 9
    assert min(one.depth for one in found) > 1e-3  # deep enough to be drawn
    assert {one.radius for one in found} == {0.025}
    page.seek(2.499)
    staying = [one for one in found if one.end > 2.499]
    assert page.value("window.hexapod.shown('kinematic').dents") == len(staying)
    page.close()
