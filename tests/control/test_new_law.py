"""`hexapod controller new`: the files it writes, and that its controller and an example walk."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from command import Call, assert_refused

import hexapod_cosim
from hexapod_cosim.cosim.control.new_law import class_name, module_name, write_law

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "controllers" / "cpg.py"


@pytest.mark.parametrize(
    ("name", "stem", "kind"), [("my_walk", "my_walk", "MyWalk"), ("MyWalk", "my_walk", "MyWalk")]
)
def test_a_name_gives_a_module_and_a_class(name: str, stem: str, kind: str) -> None:
    assert (module_name(name), class_name(name)) == (stem, kind)


def test_it_writes_a_controller_its_test_and_a_line(call: Call, tmp_path: Path) -> None:
    (tmp_path / "README.md").write_text("# Mine", encoding="utf-8")
    code, out, err = call("controller", "new", "my_walk", "-o", tmp_path)
    assert (code, err) == (0, "")
    assert f"hexapod simulate walk_flat --control {tmp_path / 'my_walk.py'}:MyWalk" in out
    assert (tmp_path / "README.md").read_text().startswith("# Mine\n- `my_walk.py`: ")
    test = (tmp_path / "test_my_walk.py").read_text()
    compile(test, "test_my_walk.py", "exec")
    assert "@" not in test
    assert "class MyWalk:" in (tmp_path / "my_walk.py").read_text()


def test_it_overwrites_nothing(call: Call, tmp_path: Path) -> None:
    (tmp_path / "test_walk.py").write_text("mine")
    assert_refused(call("controller", "new", "walk", "-o", tmp_path), "the file is there already")
    assert [path.name for path in tmp_path.iterdir()] == ["test_walk.py"]
    assert_refused(call("controller", "new", "my-walk", "-o", tmp_path), "not a name")


def test_the_controller_walks_and_turns_and_slips_less_than_kinematic_control(
    tmp_path: Path, plant_build: Path
) -> None:
    law = f"{write_law('my_walk', tmp_path)[0]}:MyWalk"
    settings = {"duration": 4, "robot": "athena"}
    ahead = hexapod_cosim.simulate("walk_flat", law, settings=settings)
    assert ahead.facts.walk.upright
    # 0.08 m/s for 4 s, less the ramp of one second
    assert ahead.recording.vector("torso.position")[-1, 0] == pytest.approx(0.28, rel=0.05)
    ours = hexapod_cosim.simulate("walk_flat", "kinematic", settings=settings)
    assert ahead.metrics["slip_per_metre"] < 0.6 * ours.metrics["slip_per_metre"]
    turning = {**settings, "command.yaw_rate": 0.2, "robot": "phantomx_mk4"}
    turned = hexapod_cosim.simulate("walk_flat", law, settings=turning)
    assert turned.recording.column("torso.yaw")[-1] == pytest.approx(0.7, rel=0.05)


def test_the_pattern_generator_walks_forward_and_turns(plant_build: Path) -> None:
    settings = {"duration": 4, "robot": "phantomx_mk4", "command.yaw_rate": 0.2}
    turning = hexapod_cosim.simulate("walk_flat", f"{EXAMPLE}:Cpg", settings=settings)
    assert turning.facts.walk.upright
    # 4 s less the ramp of one second; the feet slip sideways on their arcs
    assert turning.recording.column("torso.yaw")[-1] == pytest.approx(0.7, rel=0.35)
    torso = turning.recording.vector("torso.position")
    assert np.linalg.norm(np.diff(torso[:, :2], axis=0), axis=1).sum() > 0.2  # m    of its arc
