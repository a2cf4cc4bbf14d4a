"""Tests height maps from files: round trips, orientation, scales, refusals."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from hexapod_cosim.models import RobotError, load_robot
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.ground.surface import Surface
from hexapod_cosim.models.ground.table import make_surface
from hexapod_cosim.models.ground.valleys import tightest_valley

ATHENA = Path(__file__).resolve().parents[2] / "models" / "athena.toml"
SCALES = {"horizontal_scale": 0.1, "vertical_scale": 0.001}
HEIGHTS = np.array([[0, 10, 20], [30, 40, 50]])  # rows from the south on


def png(path: Path, levels: Any = HEIGHTS) -> Path:
    """Writes levels whose first row is the southern one."""
    Image.fromarray(np.asarray(levels)[::-1].astype(np.uint16)).save(path)
    return path


def npy(path: Path, content: Any = HEIGHTS) -> Path:
    np.save(path, np.asarray(content))
    return path


def grey(path: Path, levels: Any = HEIGHTS) -> Path:
    """Writes a picture with 8 bits per pixel."""
    Image.fromarray(np.asarray(levels)[::-1].astype(np.uint8)).save(path)
    return path


def read(path: Path, **given: Any) -> Surface:
    return make_surface("heightfield", {"file": str(path), **given})


@pytest.mark.parametrize(
    ("write", "name", "given"),
    [(png, "map.png", SCALES), (npy, "map.npy", SCALES), (grey, "map.png", SCALES)],
)
def test_all_formats_give_the_same_map(
    write: Callable[[Path], Path], name: str, given: dict[str, float], tmp_path: Path
) -> None:
    surface = read(write(tmp_path / name), **given)
    assert surface.kind == "smooth"
    assert surface.height == pytest.approx(0.001 * HEIGHTS, abs=1e-15)
    assert surface.extent == pytest.approx((-0.1, 0.1, -0.05, 0.05))
    assert surface.cell == 0.1


def test_an_array_of_floats_is_in_metres(tmp_path: Path) -> None:
    surface = read(npy(tmp_path / "map.npy", 0.001 * HEIGHTS), horizontal_scale=0.1)
    assert surface.height == pytest.approx(0.001 * HEIGHTS)


def test_a_map_may_be_moved_and_have_a_platform(tmp_path: Path) -> None:
    heights = np.random.default_rng(1).uniform(0.0, 0.1, (41, 41))
    path = npy(tmp_path / "map.npy", heights)
    surface = read(path, horizontal_scale=0.1, x=1.0, y=-0.5)
    assert surface.extent == pytest.approx((-1.0, 3.0, -2.5, 1.5))
    assert surface.height.tolist() == heights.tolist()
    level = read(path, horizontal_scale=0.1, platform_size=1.0).height
    inside = heights[15:26, 15:26].mean()
    assert level[15:26, 15:26] == pytest.approx(np.full((11, 11), inside))
    assert level[:10].tolist() == heights[:10].tolist()


def test_a_steep_map_becomes_blocks(tmp_path: Path) -> None:
    path = npy(tmp_path / "map.npy", [[0.0, 0.0, 0.1, 0.1]] * 3)
    assert read(path, horizontal_scale=0.1).kind == "smooth"
    assert read(path, horizontal_scale=0.1, slope_threshold=1.01).kind == "smooth"
    surface = read(path, horizontal_scale=0.1, slope_threshold=0.75)
    assert surface.kind == "blocks"
    assert surface.extent == pytest.approx((-0.2, 0.2, -0.15, 0.15))


def test_smooth_mends_valleys_and_keeps_planes(tmp_path: Path) -> None:
    """The narrow valleys of random heights get at least the radius; heights stay in their range."""
    heights = np.random.default_rng(2).uniform(0.0, 0.01, (31, 31))
    path = npy(tmp_path / "map.npy", heights)
    narrow = tightest_valley(read(path, horizontal_scale=0.01), 0.02)
    assert narrow is not None
    assert narrow.radius < 0.005
    mended = read(path, horizontal_scale=0.01, smooth=0.02)
    assert tightest_valley(mended, 0.02) is None
    assert mended.height[5:-5, 5:-5].min() > 0.0
    assert mended.height[5:-5, 5:-5].max() < 0.01
    plane = 0.3 * np.arange(31)[:, None] - 0.2 * np.arange(31)
    path = npy(tmp_path / "plane.npy", 0.01 * plane)
    assert read(path, horizontal_scale=0.01, smooth=0.02).height == pytest.approx(0.01 * plane)


def test_a_changed_file_is_read_again(tmp_path: Path) -> None:
    path = npy(tmp_path / "map.npy", 0.001 * HEIGHTS)
    first = read(path, horizontal_scale=0.1)
    npy(path, np.vstack([0.001 * HEIGHTS, 0.001 * HEIGHTS]))
    assert read(path, horizontal_scale=0.1).rows == 2 * first.rows


def test_the_path_is_relative_to_the_robot_file(tmp_path: Path) -> None:
    npy(tmp_path / "map.npy", np.full((5, 5), 0.01))
    text = ATHENA.read_text(encoding="utf-8").replace(
        'kind = "flat"', 'kind = "heightfield"\nfile = "map.npy"\nhorizontal_scale = 0.5'
    )
    (tmp_path / "robot.toml").write_text(text, encoding="utf-8")
    surface = load_robot(tmp_path / "robot.toml").terrain.surface
    assert surface is not None
    assert surface.height.tolist() == np.full((5, 5), 0.01).tolist()


def image(mode: str) -> Callable[[Path], Path]:
    def write(path: Path) -> Path:
        Image.new(mode, (4, 4)).save(path)
        return path

    return write


def text(content: bytes) -> Callable[[Path], Path]:
    def write(path: Path) -> Path:
        path.write_bytes(content)
        return path

    return write


def array(content: Any) -> Callable[[Path], Path]:
    return lambda path: npy(path, content)


NAN = [[0.0, np.nan], [0.0, 0.0]]
REFUSED: list[tuple[str, Callable[[Path], Path], dict[str, float], str]] = [
    ("map.png", image("RGB"), SCALES, "8 or 16 bits of grey"),
    ("map.png", text(b"no picture"), SCALES, "another kind"),
    ("map.png", png, {}, "horizontal_scale"),
    ("map.png", png, {"horizontal_scale": 0.1}, "without vertical_scale"),
    ("map.png", png, {**SCALES, "vertical_scale": -1.0}, "vertical_scale.*got -1.0"),
    ("map.png", png, {**SCALES, "horizontal_scale": 99.0, "x": 1e5}, "place of the height map"),
    ("map.png", png, {**SCALES, "vertical_scale": 50.0}, "enormous heights.*correct vertical"),
    ("map.npy", array(NAN), {"horizontal_scale": 0.1}, r"got 'nan at \[0, 1\]'"),
    ("map.npy", array([[0.0, 1.0]]), {"horizontal_scale": 0.1}, "at least 2 rows"),
    ("map.npy", array([["a"]]), SCALES, "real numbers"),
    ("map.npy", text(b""), SCALES, "not a height map"),
    ("map.tif", text(b""), SCALES, "ends in .png, .npy"),
]


@pytest.mark.parametrize(("name", "write", "given", "message"), REFUSED)
def test_a_wrong_map_is_refused_with_its_name(
    name: str, write: Callable[[Path], Path], given: dict[str, float], message: str, tmp_path: Path
) -> None:
    with pytest.raises(RobotError, match=message):
        read(write(tmp_path / name), **given)


BAD_SURFACES: list[tuple[dict[str, Any], str]] = [
    ({"kind": "rough"}, "unknown kind of surface"),
    ({"height": np.zeros((1, 5))}, "at least 2 rows"),
    ({"height": np.full((2, 2), np.inf)}, "no number"),
    ({"height": np.full((2, 2), 1e6)}, "enormous"),
    ({"cell": 0.0}, "horizontal_scale"),
    ({"x0": np.nan}, "place"),
    ({"name": "n" * 64}, "63 bytes"),
    ({"material": np.zeros((2, 2), dtype=np.uint8)}, "only one"),
    ({"material": np.ones((2, 2), dtype=np.uint8), "materials": np.zeros((0, 16))}, "up to 1"),
    ({"material": np.ones((2, 3), dtype=np.uint8), "materials": np.zeros((1, 16))}, "materials"),
]


@pytest.mark.parametrize(("change", "message"), BAD_SURFACES)
def test_data_of_no_surface_are_refused(change: dict[str, Any], message: str) -> None:
    good: dict[str, Any] = {"kind": "smooth", "height": zeros(), "x0": 0.0, "y0": 0.0, "cell": 0.1}
    assert Surface(**good).rows == 2
    with pytest.raises(RobotError, match=message):
        Surface(**good | change)


def zeros() -> Array:
    return np.zeros((2, 2))
