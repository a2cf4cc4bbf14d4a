"""`hexapod terrain`, `hexapod list terrains`, and refused settings of the ground."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from command import Call

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


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["stiars"], "unknown surface: got 'stiars'"),
        (["flat"], "a plane is no surface"),
        (["stairs", "--set", "hight=1"], "unknown key"),
        (["stairs", "--set", "step_height"], "not a setting"),
        (["stairs", "-o", "stairs.bmp"], "ends in .png or .svg"),
        (["heightfield"], "missing key"),
    ],
)
def test_a_wrong_call_is_refused(
    call: Call, tmp_path: Path, arguments: list[str], message: str
) -> None:
    code, _, err = call("terrain", *arguments)
    assert code == 1
    assert message in " ".join(err.split())


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
