"""RRD files for the viewer Rerun: the tree of frames ends at the feet, each column is a curve, and
without the package the extra is named.
"""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from command import QUICK, Call, assert_refused

from hexapod_cosim.cosim.logs import rrd_writer
from hexapod_cosim.cosim.logs.rrd_writer import curves, frames, rotations, write_rrd
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.models import LEG_NAMES, HexapodError, load_robot
from hexapod_cosim.models.kinematics import foot_positions, rotation_matrix
from hexapod_cosim.models.records import Array

NAMES = ("time", "LF.coxa.angle", "LF.foot.force[1]", "der(torso.position[1])")


def test_the_tree_of_frames_ends_at_the_feet() -> None:
    robot, rng = load_robot("athena"), np.random.default_rng(1)
    angles = robot.stance + rng.normal(0.0, 0.5, (6, 3))
    values = {
        f"{leg}.{joint}.angle": angles[k, j]
        for k, leg in enumerate(LEG_NAMES)
        for j, joint in enumerate(("coxa", "femur", "tibia"))
    }
    places: dict[str, Array] = {"world/torso": np.zeros(3)}
    turns: dict[str, Array] = {"world/torso": np.eye(3)}
    feet = []
    for frame in frames(robot):
        parent = frame.path.rpartition("/")[0]
        angle = values[frame.angle] if isinstance(frame.angle, str) else frame.angle
        (quaternion,) = rotations(frame, np.array([angle]))
        places[frame.path] = places[parent] + turns[parent] @ np.array(frame.place)
        turns[frame.path] = turns[parent] @ rotation_matrix(quaternion[[3, 0, 1, 2]])
        if frame.path.endswith("tibia"):
            feet.append(places[frame.path] + turns[frame.path] @ np.array(frame.tip))
    assert np.array(feet) == pytest.approx(foot_positions(robot, angles), abs=1e-14)


def test_each_column_is_a_curve() -> None:
    recording = Recording(NAMES, np.arange(8.0).reshape(2, 4))
    found = {entity: values.tolist() for entity, values in curves(recording)}
    assert found == {
        "curves/LF/coxa/angle": [1.0, 5.0],
        "curves/LF/foot/force/1": [2.0, 6.0],
        "curves/der_torso/position/1": [3.0, 7.0],
    }


def test_without_the_package_the_extra_is_named_before_the_run(
    call: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rrd_writer, "PACKAGE", "no_such_package")
    place = tmp_path / "out"
    assert_refused(
        call("simulate", "walk_flat", "-o", place, "--format", "rrd", *QUICK),
        "no no_such_package", "rerun-sdk", ".[rerun]",
    )  # fmt: skip
    assert not place.exists()


def need_rerun() -> None:
    """Skips a test without the package; fails it where HEXAPOD_RERUN is "required"."""
    if os.environ.get("HEXAPOD_RERUN") != "required":
        pytest.importorskip("rerun", reason="no rerun-sdk (170 MB); run make test-rerun")


def read_back(path: Path) -> dict[str, dict[str, Array]]:
    """Returns the columns of all entities of an RRD file that change with time, read by Rerun."""
    reader = importlib.import_module("rerun.chunk").RrdReader(path)
    found: dict[str, dict[str, Array]] = {}
    for chunk in reader.stream().to_chunks():
        if "time" in chunk.timeline_names:
            batch = chunk.to_record_batch().to_pydict()
            del batch["rerun.controls.RowId"]
            times = [time.total_seconds() for time in batch.pop("time")]
            columns = {name: np.squeeze(np.array(values)) for name, values in batch.items()}
            found[chunk.entity_path] = {"time": np.array(times), **columns}
    return found


def test_rerun_reads_back_curves_frames_and_forces(tmp_path: Path) -> None:
    """Curves to the last bit; frames and forces, at 2 mm for each newton, in single precision."""
    need_rerun()
    robot, rng, rows = load_robot("athena"), np.random.default_rng(2), 5
    names = [*(f"torso.position[{k}]" for k in (1, 2, 3))]
    names += [f"torso.quaternion[{k}]" for k in (1, 2, 3, 4)]
    names += [f"{leg}.{joint}.angle" for leg in LEG_NAMES for joint in ("coxa", "femur", "tibia")]
    names += [f"RM.foot.{what}[{k}]" for what in ("force", "position") for k in (1, 2, 3)]
    values = dict(zip(names, rng.normal(size=(len(names), rows)), strict=True))
    for k, column in enumerate((0.6, 0.0, 0.8, 0.0)):  # about the y axis
        values[f"torso.quaternion[{k + 1}]"] = np.full(rows, column)
    time = 0.005 * np.arange(rows)
    data = np.column_stack([time, *values.values()])
    write_rrd(Recording(("time", *names), data), tmp_path / "x.rrd", robot=robot)
    found = read_back(tmp_path / "x.rrd")

    curve = found["/curves/LF/tibia/angle"]
    assert curve["time"] == pytest.approx(time, abs=1e-9)
    assert np.array_equal(curve["Scalars:scalars"], values["LF.tibia.angle"])
    torso = found["/world/torso"]
    assert torso["Transform3D:quaternion"] == pytest.approx(
        np.tile([0.0, 0.8, 0.0, 0.6], (rows, 1)), abs=1e-6
    )
    # athena's centre of mass is the origin of its torso's frame
    position = np.column_stack([values[f"torso.position[{k}]"] for k in (1, 2, 3)])
    assert torso["Transform3D:translation"] == pytest.approx(position, abs=1e-6)
    half = 0.5 * values["LF.coxa.angle"]
    coxa = found["/world/torso/LF/coxa"]["Transform3D:quaternion"]
    assert coxa[:, 2:] == pytest.approx(np.column_stack([np.sin(half), np.cos(half)]), abs=1e-6)
    force = found["/world/force/RM"]
    pushed = np.column_stack([values[f"RM.foot.force[{k}]"] for k in (1, 2, 3)])
    assert force["Arrows3D:vectors"] == pytest.approx(0.002 * pushed, abs=1e-8)
    places = np.column_stack([values[f"RM.foot.position[{k}]"] for k in (1, 2, 3)])
    assert force["Arrows3D:origins"] == pytest.approx(places, abs=1e-6)


def test_a_run_as_rrd_is_valid_and_has_robot_and_curves(call: Call, tmp_path: Path) -> None:
    need_rerun()
    place = tmp_path / "out"
    code, _, _ = call("simulate", "walk_flat", "-o", place, "--format", "rrd", *QUICK)
    assert code == 0
    file = place / "results.rrd"
    for words in (["verify"], ["print"]):
        done = subprocess.run(
            [sys.executable, "-m", "rerun", "rrd", *words, str(file)],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
    for entity in ("world/torso/LF/coxa/femur/tibia", "world/force/RR", "curves/RM/tibia/torque"):
        assert f"/{entity}" in done.stdout, entity


def test_a_failed_write_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    need_rerun()

    def broken(_recording: Recording) -> None:
        raise OSError("no space left")

    monkeypatch.setattr(rrd_writer, "curves", broken)
    with pytest.raises(HexapodError, match="no space"):
        write_rrd(Recording(NAMES, np.zeros((2, 4))), tmp_path / "x.rrd")
    assert list(tmp_path.iterdir()) == []
