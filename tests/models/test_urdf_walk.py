"""Tests a URDF's robot in the FMU and under the controller, and the commands that write and read
robots for other tools.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

import fmpy
import pytest
import tomlkit
from command import Call
from disguised_urdf import disguised, stances
from foreign_urdf import SIDE, spider_table, spider_urdf

from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.results.folder import RESULTS
from hexapod_cosim.cosim.results.recordings import read_recording
from hexapod_cosim.models import LEG_NAMES, RobotError, list_robots, load_robot

# m; the robots differ in the last bits of some inertias, which contacts amplify over seconds
SAME_WALK = 1e-9
SAME_COURSE = 0.1  # m; the length of the walk is the commanded one less the ramps


@pytest.fixture
def files(tmp_path: Path) -> Path:
    """Returns a folder with spider.urdf, a side file, and the same robot as a robot file."""
    (tmp_path / "spider.urdf").write_text(spider_urdf(), encoding="utf-8")
    table = spider_table()
    table["gait"] |= {"stride": 0.07, "step_height": 0.03}
    (tmp_path / "ours.toml").write_text(tomlkit.dumps(table), encoding="utf-8")
    (tmp_path / "side.toml").write_text(
        f"{SIDE}\n[gait]\nperiod = 1.0\nstride = 0.07\nstep_height = 0.03\n", encoding="utf-8"
    )
    return tmp_path


def walked(call: Call, robot: Path, folder: Path, duration: float) -> Recording:
    settings = [f"robot={robot}", f"duration={duration}", "outputs.plots=false"]
    code, _, err = call(
        "simulate",
        "walk_flat",
        "-o",
        folder,
        *(word for text in settings for word in ("--set", text)),
    )
    assert code == 0, err
    return read_recording(folder, RESULTS)


def test_a_bare_urdf_stands_in_any_tool_and_walks(call: Call, files: Path) -> None:
    path = files / "spider.fmu"
    code, out, err = call("export", "--robot", files / "spider.urdf", "-o", path)
    assert (code, err) == (0, "")
    assert "so assumed: contact, friction" in out
    assert "counted against the URDF's axes: j_c6" in out
    robot = load_robot(files / "spider.urdf")
    names = [f"{leg}.foot.normal_force" for leg in LEG_NAMES]
    result = fmpy.simulate_fmu(str(path), output=names, stop_time=1.0)
    assert sum(result[name][-1] for name in names) == pytest.approx(
        robot.weight, rel=1e-3
    )  # after the last oscillation
    course = walked(call, files / "spider.urdf", files / "walk", 2.0).column("torso.position[1]")
    assert course[-1] > SAME_COURSE


@pytest.mark.parametrize("name", list_robots())
def test_the_fmu_of_a_robot_and_of_its_urdf_are_the_same(
    call: Call, tmp_path: Path, name: str
) -> None:
    call("export", "--urdf", "--robot", name, "-o", tmp_path / "robot.urdf")
    hashes = []
    for robot in (name, tmp_path / "robot.urdf"):
        code, out, _ = call("export", "--robot", robot, "-o", tmp_path / "robot.fmu", "--json")
        assert code == 0
        hashes.append(json.loads(out)["hash"])
    assert hashes[0] == hashes[1] == load_robot(name).hash


@pytest.mark.parametrize("form", [("--urdf", "urdf", "<robot"), ("--mjcf", "xml", "<mujoco")])
def test_a_robot_is_written_by_option_or_by_suffix(
    call: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, form: tuple[str, str, str]
) -> None:
    monkeypatch.chdir(tmp_path)
    option, suffix, start = form
    assert call("export", option, "--robot", "athena")[:2] == (0, f"wrote ./athena.{suffix}\n")
    code, out, _ = call("export", "-o", tmp_path / "deep" / f"robot.{suffix}", "--json")
    assert code == 0
    assert json.loads(out)[option.removeprefix("--")] == str(tmp_path / "deep" / f"robot.{suffix}")
    assert (tmp_path / "deep" / f"robot.{suffix}").read_text() == (
        tmp_path / f"athena.{suffix}"
    ).read_text()
    assert start in (tmp_path / f"athena.{suffix}").read_text()


def test_forward_may_be_another_axis_of_the_urdf(tmp_path: Path) -> None:
    """A robot drawn with y forward, and declared so, equals the robot drawn with x forward."""
    robot = load_robot("athena")
    text = disguised(robot, 3, stances(robot))
    (tmp_path / "x.urdf").write_text(text, encoding="utf-8")
    # the root has no mass and is turned by -90 degrees against the trunk: the trunk's x is the
    # root's y
    turned = (
        '<link name="root"/><joint name="turn" type="fixed"><parent link="root"/>'
        '<child link="trunk"/><origin rpy="0 0 1.5708"/></joint>'
    )
    (tmp_path / "y.urdf").write_text(
        text.replace("</robot>", f"{turned}</robot>"), encoding="utf-8"
    )
    (tmp_path / "y.toml").write_text('[urdf]\nfile = "y.urdf"\nforward = "y"\n', encoding="utf-8")
    first, second = load_robot(tmp_path / "x.urdf"), load_robot(tmp_path / "y.toml")
    for a, b in zip(first.legs, second.legs, strict=True):
        assert a.hip_position == pytest.approx(b.hip_position, abs=1e-12)
        assert a.hip_yaw == pytest.approx(b.hip_yaw, abs=1e-12)
    assert first.torso.inertia == pytest.approx(second.torso.inertia, abs=1e-12)
    assert first.torso.size == pytest.approx(second.torso.size, abs=1e-12)


def test_a_side_file_stands_above_the_urdf(tmp_path: Path) -> None:
    (tmp_path / "spider.urdf").write_text(
        spider_urdf().replace('damping="0"', 'damping="0.1"'), encoding="utf-8"
    )
    head = 'name = "mine"\n[urdf]\nfile = "spider.urdf"\n[servo]\ntorque_max = 9.0\nkd = 0.5\n'
    masses = "[torso]\nmass = 3.0\n[legs.RM.tibia]\nmass = 0.2\n[links.tibia]\nmass = 0.12\n"
    (tmp_path / "mine.toml").write_text(head + masses, encoding="utf-8")
    robot = load_robot(tmp_path / "mine.toml")
    assert (robot.name, robot.servo.torque_max, robot.servo.kd, robot.servo.kp) == (
        "mine",
        9.0,
        0.5,
        60.0,
    )
    assert robot.torso.mass == 3.0
    assert [leg.links[2].mass for leg in robot.legs] == [0.12, 0.12, 0.12, 0.12, 0.2, 0.12]
    assert robot.source["URDF, damping"] == (
        "0.0333333 N m s/rad of the joints, without effect beside the given servo.kd"
    )


def test_viscous_damping_of_joints_adds_to_kd(tmp_path: Path) -> None:
    """Six of 18 joints have 0.3 N m s/rad, and 0.02 s x 5.5 N m/0.15 rad is assumed without it."""
    text = spider_urdf().replace('damping="0"', 'damping="0.3"')
    (tmp_path / "spider.urdf").write_text(text, encoding="utf-8")
    robot = load_robot(tmp_path / "spider.urdf")
    assert robot.servo.kd == pytest.approx(0.8333333333333334, rel=1e-14)
    assert robot.source["URDF, damping"] == "0.1 N m s/rad of the joints, added to servo.kd"


def test_what_a_urdf_has_wrong_or_lacks_a_side_file_may_give(tmp_path: Path) -> None:
    """As in published URDFs, a quarter turn is 1.5704, an inertia has other units, and feet are
    meshes only.
    """
    text = (
        spider_urdf()
        .replace('rpy="1.5708 0 0"', 'rpy="1.5704 0 0"')
        .replace('ixx="5e-5"', 'ixx="0.1"')
    )
    text = re.sub(
        "<joint name=.toe_joint.*?</joint>|<link name=.toe_.*?</link>", "", text, flags=re.DOTALL
    )
    (tmp_path / "spider.urdf").write_text(text, encoding="utf-8")
    path = tmp_path / "mine.toml"
    path.write_text('[urdf]\nfile = "spider.urdf"\n', encoding="utf-8")
    with pytest.raises(
        RobotError, match=r"link 'tibia_3'.* without a foot.* under \[links\.tibia\]"
    ):
        load_robot(path)
    path.write_text(f"{path.read_text()}[links.tibia]\nlength = 0.15\n", encoding="utf-8")
    with pytest.raises(RobotError, match=r"joint j_f3\).* no possible body"):
        load_robot(path)
    path.write_text(
        f"{path.read_text()}[links.femur]\ninertia = [5e-5, 1.7e-4, 1.8e-4, 0, 0, 0]\n",
        encoding="utf-8",
    )
    robot = load_robot(path)
    assert [link.axis for link in robot.legs[0].links] == [
        (0.0, 0.0, 1.0),
        (0.0, -1.0, 0.0),
        (0.0, 1.0, 0.0),
    ]
    assert robot.legs[0].links[2].tip == (0.15, 0.0, 0.0)
    assert "foot.radius" in robot.source["URDF, assumed"]


def test_the_side_file_of_the_documentation_works(tmp_path: Path) -> None:
    text = (Path(__file__).parents[2] / "docs" / "howto" / "urdf.md").read_text(encoding="utf-8")
    side = re.findall(r"```toml\n(.*?)```", text, flags=re.DOTALL)[0]
    (tmp_path / "my.urdf").write_text(spider_urdf(), encoding="utf-8")
    (tmp_path / "mine.toml").write_text(
        side.replace('forward = "y"', 'forward = "x"'), encoding="utf-8"
    )
    robot = load_robot(tmp_path / "mine.toml")
    assert (robot.name, robot.servo.kp, robot.legs[0].links[0].inertia[0]) == ("mine", 25.0, 2.2e-5)
