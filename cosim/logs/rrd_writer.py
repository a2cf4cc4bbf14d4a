"""Writes a recording as an RRD file, which the viewer Rerun opens.

The file has a curve for each column and, where the recording has the torso's pose and the joints'
angles, the robot in 3D: a tree of frames from the world to the feet with a box, lines and spheres,
and the forces of the ground on the feet as arrows. Curves have all digits; 3D geometry has single
precision. Times are those of the rows, on the timeline "time". Rerun adds the time of writing and a
random identifier, so that equal recordings make different files.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.common.files import atomic_path
from hexapod_cosim.cosim.common.installation import require_packages
from hexapod_cosim.cosim.interface.names import joint_names, vector_names
from hexapod_cosim.cosim.logs.places import torso_places
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.models import JOINT_NAMES, LEG_NAMES, Robot
from hexapod_cosim.models.kinematics import unit_axis

Array = NDArray[np.float64]
EXTRA, PACKAGE = "rerun", "rerun"
CURVES, WORLD = "curves", "world"  # the roots of the curves and of the 3D geometry
TIMELINE = "time"
ARROW = 0.002  # m/N    length of an arrow for a force
LINE = 0.003  # m    radius of the lines of links


def require_rerun(where: str | Path) -> None:
    """Raises HexapodError, which names the extra, unless RRD files can be written."""
    require_packages([PACKAGE], "RRD", extra=EXTRA, where=where)


@dataclass(frozen=True)
class Frame:
    """A frame of the robot's tree, as its parent sees it."""

    path: str  # from the world on
    place: tuple[float, float, float]  # of its origin in the parent frame [m]
    axis: tuple[float, float, float]  # of its rotation, in the parent frame
    angle: float | str  # about the axis [rad]: fixed, or the column of a joint
    tip: tuple[float, float, float] | None = None  # end of the link in the frame [m]


def frames(robot: Robot) -> list[Frame]:
    """Returns the frames of all links below the torso's, parents first."""
    found = []
    for leg in robot.legs:
        path, place = f"{WORLD}/torso/{leg.name}", leg.hip_position
        found.append(Frame(path, place, (0.0, 0.0, 1.0), leg.hip_yaw))
        place = (0.0, 0.0, 0.0)
        for name, link in zip(JOINT_NAMES, leg.links, strict=True):
            path = f"{path}/{name}"
            x, y, z = unit_axis(link.axis).tolist()
            found.append(Frame(path, place, (x, y, z), f"{leg.name}.{name}.angle", link.tip))
            place = link.tip
    return found


def rotations(frame: Frame, angles: Array) -> Array:
    """Returns the quaternions [x y z w] (rows, 4) of a frame at angles (rows,) [rad]."""
    half = 0.5 * angles[:, None]
    return np.hstack([np.sin(half) * np.array(frame.axis), np.cos(half)])


def write_rrd(
    recording: Recording,
    path: Path,
    *,
    robot: Robot | None = None,
    about: Mapping[str, str] | None = None,
    torso_com: Sequence[float] = (0.0, 0.0, 0.0),
) -> None:
    """Writes curves and geometry. A failed write leaves no partial file.

    Args:
        recording: rows of a run.
        path: the file to write.
        robot: its lengths are drawn; None: curves alone.
        about: texts for the properties of the recording.
        torso_com: centre of mass in the torso's frame [m].

    Raises HexapodError without the extra `rerun`.
    """
    require_rerun(path)
    import rerun as rr  # noqa: PLC0415  an extra

    with atomic_path(path) as temporary:
        stream = rr.RecordingStream("hexapod-cosim")
        stream.save(temporary)
        if robot is not None:
            stream.send_recording_name(robot.name)
        if about:
            stream.send_property("hexapod", rr.AnyValues(**about))
        times = [rr.TimeColumn(TIMELINE, duration=recording.time)]
        for entity, values in curves(recording):
            stream.send_columns(entity, times, rr.Scalars.columns(scalars=values))
        if robot is not None and {*POSE, *joint_names("angle")} <= set(recording.names):
            places = torso_places(recording, np.asarray(torso_com, float))
            _write_robot(rr, stream, times, recording, places, robot)
            _write_forces(rr, stream, times, recording)
        stream.flush()
        stream.disconnect()


POSE = (*vector_names("torso.position"), *vector_names("torso.quaternion", 4))


def curves(recording: Recording) -> Iterator[tuple[str, Array]]:
    """Yields the entity and the values (rows,) of each column but the time."""
    for name in recording.names:
        if name != TIMELINE:
            yield f"{CURVES}/{entity_of(name)}", np.ascontiguousarray(recording.column(name))


def entity_of(name: str) -> str:
    """Returns the entity of a column: LF/foot/force/1 of LF.foot.force[1]."""
    for old, new in ((".", "/"), ("[", "/"), ("]", ""), ("(", "_"), (")", "")):
        name = name.replace(old, new)
    return name


def _write_robot(
    rr: Any,
    stream: Any,
    times: Sequence[Any],
    recording: Recording,
    places: Array,
    robot: Robot,
) -> None:
    """Writes the frames of torso and links, and a box, lines and spheres in them.

    places: of the origin of the torso's frame in the world (rows, 3) [m].
    """
    stream.log(WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    torso = f"{WORLD}/torso"
    turns = recording.vector("torso.quaternion", 4)[:, [1, 2, 3, 0]]  # w last
    moved = rr.Transform3D.columns(translation=places, quaternion=turns)
    stream.send_columns(torso, times, moved)
    stream.log(f"{torso}/box", rr.Boxes3D(sizes=[robot.torso.size]), static=True)
    rows = len(recording.time)
    for frame in frames(robot):
        if isinstance(frame.angle, str):
            angles = recording.column(frame.angle)
            fixed = np.tile(frame.place, (rows, 1))
            moved = rr.Transform3D.columns(translation=fixed, quaternion=rotations(frame, angles))
            stream.send_columns(frame.path, times, moved)
        else:
            (turn,) = rotations(frame, np.array([frame.angle]))
            hip = rr.Transform3D(translation=frame.place, quaternion=turn)
            stream.log(frame.path, hip, static=True)
        if frame.tip is not None:
            line = rr.LineStrips3D([[(0.0, 0.0, 0.0), frame.tip]], radii=LINE)
            stream.log(f"{frame.path}/line", line, static=True)
        if frame.path.endswith(JOINT_NAMES[-1]):
            foot = rr.Points3D([frame.tip], radii=robot.foot.radius)
            stream.log(f"{frame.path}/foot", foot, static=True)


def _write_forces(rr: Any, stream: Any, times: Sequence[Any], recording: Recording) -> None:
    """Writes the forces of the ground on the feet, in world axes at the feet's centres."""
    have = set(recording.names)
    for leg in LEG_NAMES:
        force, place = f"{leg}.foot.force", f"{leg}.foot.position"
        if {*vector_names(force), *vector_names(place)} <= have:
            arrows = rr.Arrows3D.columns(
                vectors=ARROW * recording.vector(force), origins=recording.vector(place)
            )
            stream.send_columns(f"{WORLD}/force/{leg}", times, arrows)
