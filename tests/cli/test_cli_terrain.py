"""`hexapod terrain`, `hexapod list terrains`, and refused settings of the ground."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from command import Call
from PIL import Image

from hexapod_cosim.models.ground.table import CATALOGUE, make_surface


def test_all_surfaces_are_listed_with_their_parameters(call: Call) -> None:
    code, out, _ = call("list", "terrains", "--json")
    rows = {row["name"]: row for row in json.loads(out)}
    assert code == 0
    assert list(rows) == ["flat", "slope", *CATALOGUE]
    assert "step_height 0.043 m, step_width 0.15 m" in rows["stairs"]["about"]
    assert rows["slope"]["about"] == "inclined plane: height 0 m, incline 0 rad, heading 0 rad"


@pytest.mark.parametrize("suffix", ["png", "svg"])
def test_a_surface_is_drawn(call: Call, tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"rubble.{suffix}"
    code, out, _ = call("terrain", "rubble", "-o", path, "--set", "max_height=50 mm", "--json")
    assert code == 0
    facts = json.loads(out)
    assert facts["written"] == [str(path)]
    assert facts["heights [m]"] == [0.0, 0.05]
    assert facts["sha256"] == make_surface("rubble", {"max_height": 0.05}).digest
    assert path.stat().st_size > 1000


def test_written_heights_give_the_surface_back(call: Call, tmp_path: Path) -> None:
    path = tmp_path / "heights.png"
    code, out, _ = call("terrain", "dune", "--heights", path, "--json")
    assert code == 0
    keys = json.loads(out)["heights"]
    height = keys.pop("height")
    assert np.asarray(Image.open(path)).dtype == np.uint16
    again, dune = make_surface("heightfield", keys), make_surface("dune", {})
    assert again.kind == "smooth"
    assert again.extent == pytest.approx(dune.extent)
    assert again.height + height == pytest.approx(dune.height, abs=0.51 * keys["vertical_scale"])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["stiars"], "unknown terrain: got 'stiars'"),
        (["flat", "--set", "step_height=0.1"], "unknown key"),
        (["flat", "--set", "incline=0.1"], "level ground with a slope"),
        (["stairs", "--set", "hight=1"], "unknown key"),
        (["stairs", "--set", "step_height"], "not a setting"),
        (["stairs", "-o", "stairs.bmp"], "ends in .png or .svg"),
        (["stairs", "--heights", "stairs.svg"], "ends in .png"),
        (["heightfield"], "missing key"),
    ],
)
def test_a_wrong_call_is_refused(
    call: Call, tmp_path: Path, arguments: list[str], message: str
) -> None:
    code, _, err = call("terrain", *arguments)
    assert code == 1
    assert message in " ".join(err.split())


def test_a_plane_is_shown_with_its_place_and_slope(call: Call, tmp_path: Path) -> None:
    picture, heights = tmp_path / "slope.png", tmp_path / "heights.png"
    given = ("--set", "incline=0.3", "--set", "heading=90 deg", "-o", picture)
    code, out, _ = call("terrain", "slope", *given, "--heights", heights, "--json")
    facts = json.loads(out)
    assert code == 0
    assert facts["kind"] == "plane without edges"
    assert [facts[key] for key in ("height [m]", "incline [rad]")] == [0.0, 0.3]
    assert facts["heading [rad]"] == pytest.approx(1.5707963267948966)
    again = make_surface(
        "heightfield", {k: v for k, v in facts["heights"].items() if k != "height"}
    )
    rise = 1e3 * (again.height[-1, 0] - again.height[0, 0])
    assert rise == pytest.approx(1237.345, abs=0.05)  # mm over 4 m: 4 tan(0.3)
    assert picture.stat().st_size > 1000
    code, out, _ = call("terrain", "flat")
    assert (code, out) == (0, "name: flat\nkind: plane without edges\nheight [m]: 0.0\n")


def test_a_plane_is_not_packed_as_a_surface(call: Call, tmp_path: Path) -> None:
    code, _, err = call("export", "--terrain", "flat", "-o", tmp_path / "a.fmu")
    assert code == 1
    assert "every FMU has planes, which terrain.kind = flat chooses" in " ".join(err.split())


def test_a_controllers_fmu_has_no_ground(call: Call, tmp_path: Path) -> None:
    path = tmp_path / "controller.fmu"
    code, _, err = call("export", "--controller", "kinematic", "--terrain", "stairs", "-o", path)
    assert code == 1
    assert "options that do nothing" in err
    assert not path.exists()
