"""MCAP files: all numbers of a recording read back with the same bits, other readers see ROS 2
messages, and robots' files without our columns are read by their topics.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command import QUICK, Call, assert_refused
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.writer import Writer

from hexapod_cosim.cosim.logs import messages as ros
from hexapod_cosim.cosim.logs.mcap_reader import read_mcap, read_topics
from hexapod_cosim.cosim.logs.mcap_writer import OURS, write_mcap
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.results.recordings import read_parquet
from hexapod_cosim.models import HexapodError, load_robot
from hexapod_cosim.models.records import JointNames

AWKWARD = [0.0, -0.0, 1.0 / 3.0, -1e-300, 5e-324, 1.7976931348623157e308, np.nan, np.inf, -np.inf]
UNIX = 1_700_000_000  # s


def decoded(path: Path) -> dict[str, list[Any]]:
    """Returns the messages of each topic, as the packages of MCAP decode them."""
    found: dict[str, list[Any]] = {}
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, _, message in reader.iter_decoded_messages():
            found.setdefault(channel.topic, []).append(message)
    return found


def test_every_number_reads_back_the_same_bits(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    bits = rng.integers(0, 2**64, (50, 2), dtype=np.uint64).view(np.float64)
    awkward = np.vstack([np.tile(AWKWARD, (2, 1)).T, np.where(np.isnan(bits), np.nan, bits)])
    time = 0.005 * np.arange(len(awkward))
    recording = Recording(("time", "a.b", "A_b"), np.column_stack([time, awkward]))
    write_mcap(recording, tmp_path / "x.mcap")
    again = read_mcap(tmp_path / "x.mcap")
    assert again.names == recording.names
    assert again.data.tobytes() == recording.data.tobytes()


def test_a_run_as_mcap_is_the_same_recording_as_parquet(recorded: Path) -> None:
    table = read_parquet(recorded / "results.parquet")
    log = read_mcap(recorded / "results.mcap")
    assert log.names == table.names
    assert log.data.tobytes() == table.data.tobytes()


def test_equal_recordings_make_equal_files(recorded: Path, tmp_path: Path) -> None:
    recording = read_mcap(recorded / "results.mcap")
    for name in ("a", "b"):
        write_mcap(recording, tmp_path / f"{name}.mcap", about={"control": "kinematic"})
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()


def test_other_readers_see_the_messages_of_ros_2(recorded: Path) -> None:
    recording = read_parquet(recorded / "results.parquet")
    topics = decoded(recorded / "results.mcap")
    feet = {f"/{leg}/foot_force" for leg in ("LF", "LM", "LR", "RF", "RM", "RR")}
    assert set(topics) == {
        "/joint_states", "/joint_commands", "/imu", "/tf", "/hexapod/recording", *feet
    }  # fmt: skip
    assert {len(messages) for messages in topics.values()} == {41}
    state = topics["/joint_states"][7]
    assert state.header.stamp.nanosec == 35_000_000
    assert state.name[:4] == [
        "LF_coxa_joint", "LF_femur_joint", "LF_tibia_joint", "LM_coxa_joint"
    ]  # fmt: skip
    assert state.position[1] == recording.column("LF.femur.angle")[7]
    assert state.effort[2] == recording.column("LF.tibia.torque")[7]
    command = topics["/joint_commands"][7]
    assert command.velocity[17] == recording.column("RR.tibia.speed_ref")[7]
    assert topics["/RM/foot_force"][7].wrench.force.z == recording.column("RM.foot.force[3]")[7]
    imu, pose = topics["/imu"][7], topics["/tf"][7].transforms[0]
    assert imu.linear_acceleration.z == recording.column("imu.specific_force[3]")[7]
    assert imu.orientation.w == recording.column("torso.quaternion[1]")[7]
    assert (pose.header.frame_id, pose.child_frame_id) == ("world", "torso")
    assert pose.transform.translation.x == recording.column("torso.position[1]")[7]


def test_the_file_says_what_was_run(recorded: Path) -> None:
    with (recorded / "results.mcap").open("rb") as file:
        (metadata,) = make_reader(file).iter_metadata()
    facts = json.loads((recorded / "run.json").read_text())
    assert metadata.metadata["control"] == "kinematic"
    assert json.loads(metadata.metadata["robot"]) == facts["robot"]


def test_reading_by_topics_yields_the_numbers_of_the_columns(recorded: Path) -> None:
    recording = read_mcap(recorded / "results.mcap")
    topics = read_topics(recorded / "results.mcap")
    shared = [name for name in topics.names if name in recording.names and name != "time"]
    assert len(shared) == 139  # 6 x 18 joint quantities, 18 of feet, 6 of the IMU, 7 of the pose
    assert np.array_equal(topics.columns(shared), recording.columns(shared))
    assert np.array_equal(
        topics.vector("imu.quaternion", 4), recording.vector("torso.quaternion", 4)
    )
    assert topics.time == pytest.approx(recording.time, abs=1e-12)


def test_transforms_and_joints_are_those_of_the_robots_owner(tmp_path: Path) -> None:
    half = np.sqrt(0.5)  # a quarter turn about z: the torso's x axis is the world's y axis
    names = ("time", *(f"torso.position[{k}]" for k in (1, 2, 3)))
    names += tuple(f"torso.quaternion[{k}]" for k in (1, 2, 3, 4))
    names += tuple(f"{leg}.{joint}.angle" for leg in ("LF", "LM", "LR", "RF", "RM", "RR")
                   for joint in ("coxa", "femur", "tibia"))  # fmt: skip
    data = np.array([[0.0, 1.0, 2.0, 3.0, half, 0.0, 0.0, half, *(0.1 * k for k in range(18))]])
    path, com = tmp_path / "x.mcap", (0.1, 0.0, 0.0)
    owners = tuple(f"motor {k}" for k in range(18))
    joints = JointNames(names=owners, reversed=("motor 1", "motor 17"))
    write_mcap(Recording(names, data), path, torso_com=com, joints=joints)
    state = decoded(path)["/joint_states"][0]
    assert tuple(state.name) == owners
    assert state.position[:3] == [0.0, -0.1, 0.2]
    place = decoded(path)["/tf"][0].transforms[0].transform.translation
    assert (place.x, place.y, place.z) == pytest.approx((1.0, 1.9, 3.0), abs=1e-15)
    athena = load_robot("athena")
    torso = replace(athena.torso, com=com)
    again = read_topics(path, robot=replace(athena, torso=torso, joints=joints))
    assert again.data[0, 1:19].tolist() == data[0, 8:].tolist()
    assert again.vector("torso.position")[0] == pytest.approx([1.0, 2.0, 3.0], abs=1e-15)


def robot_log(path: Path, commands: str = "/desired_joints") -> None:
    """Writes what a robot may record: joint states at 100 Hz, commands at 50 Hz a little earlier,
    joints in another order and spelling, Unix times, and a topic of a wheel that we lack.
    """
    with path.open("wb") as file, Writer(file) as writer:
        schema = writer.register_msgdef(ros.JOINT_STATE, ros.DEFINITIONS[ros.JOINT_STATE])
        labels = [label.removesuffix("_joint").lower() for label in reversed(OURS.names)]

        def write(topic: str, stamp: int, names: list[str], value: float) -> None:
            header = {
                "stamp": {"sec": UNIX + stamp // 10**9, "nanosec": stamp % 10**9},
                "frame_id": "",
            }
            message = {"header": header, "name": names, "position": [value] * len(names)}
            message |= {"velocity": [], "effort": []}
            writer.write_message(topic, schema, message, log_time=UNIX * 10**9 + stamp)

        for k in range(5):
            write(commands, 20_000_000 * k + 15_000_000, labels, 0.1 * k)
            write("/wheels", 20_000_000 * k, ["wheel"], 7.0)
        for k in range(10):
            write("/robot/joint_states", 10_000_000 * k, labels, float(k))


def test_a_robots_topics_are_joined_at_the_times_of_its_joint_states(tmp_path: Path) -> None:
    path = tmp_path / "robot.mcap"
    robot_log(path)
    log = read_mcap(path)
    # rows begin with the first command; a command holds until the next one
    assert log.time == pytest.approx([0.02, 0.03, 0.04, 0.05, 0.06, 0.07, 0.08, 0.09], abs=1e-15)
    assert log.column("LM.femur.angle").tolist() == [2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]
    assert log.column("RR.coxa.angle_ref") == pytest.approx(
        [0.0, 0.0, 0.1, 0.1, 0.2, 0.2, 0.3, 0.3], abs=1e-15
    )
    assert len(log.names) == 37


def test_a_file_without_the_robots_joints_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "wheels.mcap"
    with path.open("wb") as file, Writer(file) as writer:
        writer.register_msgdef(ros.JOINT_STATE, ros.DEFINITIONS[ros.JOINT_STATE])
    with pytest.raises(HexapodError, match="no joint states of this robot"):
        read_mcap(path)


@pytest.mark.parametrize("content", [b"", b"junk\n", b"time,a\n0,1\n", b"\x89MCAP0\r\n"])
def test_a_damaged_file_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "x.mcap").write_bytes(content)
    with pytest.raises(HexapodError, match="not an MCAP file of a robot"):
        read_mcap(tmp_path / "x.mcap")


def test_a_cut_file_is_refused(recorded: Path, tmp_path: Path) -> None:
    content = (recorded / "results.mcap").read_bytes()
    (tmp_path / "x.mcap").write_bytes(content[: len(content) // 2])
    said = "not an MCAP file of a robot: got 'a file that is no undamaged MCAP file'"
    with pytest.raises(HexapodError, match=said):
        read_mcap(tmp_path / "x.mcap")


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(HexapodError, match=r"no such recording: got '.*x\.mcap'; correct the path"):
        read_mcap(tmp_path / "x.mcap")


def test_without_the_extra_the_message_names_it_and_nothing_is_run(
    call: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ros, "PACKAGES", ("no_such_package",))
    folder = tmp_path / "out"
    outcome = call("simulate", "walk_flat", "--format", "mcap", "-o", folder, *QUICK)
    assert_refused(outcome, "MCAP files need", "outputs.formats", "[logs]")
    assert not folder.exists()


def test_a_run_that_begins_before_0_is_refused_before_it_is_run(call: Call, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    options = ("--format", "mcap", "-o", folder, "--set", "start=-1", *QUICK)
    assert_refused(call("simulate", "walk_flat", *options), "ROS 2 cannot express", "-1 s")
    assert not folder.exists()


@pytest.mark.usefixtures("undrawn")
def test_a_report_is_made_again_from_mcap_alone(call: Call, recorded: Path, tmp_path: Path) -> None:
    place = tmp_path / "out"
    assert call("simulate", "walk_flat", "--format", "mcap", "-o", place, *QUICK)[0] == 0
    assert sorted(path.name for path in place.iterdir()) == [
        "metrics.json", "results.mcap", "run.json", "scenario.toml"
    ]  # fmt: skip
    assert call("report", place)[0] == 0
    assert (place / "report.html").is_file()
