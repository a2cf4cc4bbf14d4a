"""Chooses the columns and rows of a recording that go into a report, in units for readers.

A column is left out if the recording lacks a variable that it is made of. Columns are packed into
short texts: 16-bit steps, differences, deflate, base64. A column of range D is reproduced within
D/131070, plus the rounding of the reader's 32-bit floats. That is a hundredth of a pixel of a plot
1000 pixels high, and 40 um of a torso that walked 5 m. Errors do not accumulate: differences are
taken of the steps, exactly modulo 2^16.
"""

from __future__ import annotations

import base64
import zlib
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.master.recorder import ColumnError
from hexapod_cosim.cosim.results.metrics import foot_errors
from hexapod_cosim.cosim.results.support import body_height
from hexapod_cosim.cosim.results.window import (
    View,
    bearing_load,
    robot_weight,
    running_integral,
    slip_under_load,
)
from hexapod_cosim.models import JOINT_NAMES, LEG_NAMES
from hexapod_cosim.models.arrays import Array

Columns = dict[str, Array]

STEPS = 65535  # of 16 bits
TICK = 1e-6  # s    resolution of times, stored in 32 bits: 71 minutes from first to last row
MOST_ROWS = 20_000  # of a run: all rows of 100 s at 5 ms; more rows would open slowly


def choose(view: View, *, most_rows: int = MOST_ROWS) -> tuple[Array, Columns, int]:
    """Returns the times (rows,) [s] and the columns (rows,) of a report, and which share of the
    recording's rows they are: every one, or every second, third ... of a longer recording.
    """
    time = view.recording.time
    every = max(-(-len(time) // most_rows), 1)
    columns = _gather(view, (*REPLAYED, *DRAWN))
    return time[::every], {name: values[::every] for name, values in columns.items()}, every


Maker = Callable[[View], Iterator[tuple[str, Array]]]


def _gather(view: View, makers: tuple[Maker, ...]) -> Columns:
    """Returns the columns of all makers whose variables were recorded."""
    columns: Columns = {}
    for make in makers:
        try:
            columns |= dict(make(view))
        except ColumnError:
            continue
    return columns


def _pose(view: View) -> Iterator[tuple[str, Array]]:
    """Yields torso position [m], attitude and joint angles [rad], for the viewer's kinematics."""
    yield from _split(("torso.x", "torso.y", "torso.z"), view.recording.vector("torso.position"))
    yield from _split(
        ("torso.qw", "torso.qx", "torso.qy", "torso.qz"),
        view.recording.vector("torso.quaternion", 4),
    )
    names = [f"{leg}.{joint}.angle" for leg in LEG_NAMES for joint in JOINT_NAMES]
    yield from _split(names, view.recording.joints("angle").reshape(-1, len(names)))


def _forces(view: View) -> Iterator[tuple[str, Array]]:
    """Yields the forces on the feet in body weights, world axes."""
    force = view.recording.foot_vectors("force") / robot_weight(view.parameters)
    yield from _split(
        [f"{leg}.force.{axis}" for leg in LEG_NAMES for axis in "xyz"],
        force.reshape(len(force), -1),
    )


def _contacts(view: View) -> Iterator[tuple[str, Array]]:
    """Yields the contact flags of the feet."""
    yield from _split([f"{leg}.contact" for leg in LEG_NAMES], view.recording.feet("contact"))


def _slipped(view: View) -> Iterator[tuple[str, Array]]:
    """Yields how far each foot has slipped under load since the start [m], world x and y."""
    time = view.recording.time
    loaded = bearing_load(view.recording, view.parameters)
    velocity = np.where(loaded[:, :, None], view.recording.foot_vectors("velocity"), 0.0)[:, :, :2]
    way = running_integral(time, velocity.reshape(len(time), -1))
    yield from _split([f"{leg}.slipped.{axis}" for leg in LEG_NAMES for axis in "xy"], way)


def _normal_forces(view: View) -> Iterator[tuple[str, Array]]:
    """Yields the normal forces of the feet in body weights."""
    yield from _split(
        [f"{leg}.load" for leg in LEG_NAMES],
        view.recording.feet("normal_force") / robot_weight(view.parameters),
    )


def _slip(view: View) -> Iterator[tuple[str, Array]]:
    """Yields the slip speed of loaded feet [mm/s] and the total slip of all feet [mm]."""
    speed = 1e3 * slip_under_load(view.recording, view.parameters)
    yield from _split([f"{leg}.slip" for leg in LEG_NAMES], speed)
    yield "slip.way", running_integral(view.recording.time, speed.sum(axis=1))


def _feet(view: View) -> Iterator[tuple[str, Array]]:
    """Yields the distance of each foot's centre from its planned position [mm], torso frame.

    Yields nothing when the controller does not report its plan.
    """
    errors = foot_errors(view.recording, view.parameters)
    if len(errors):
        yield from _split(
            [f"{leg}.off" for leg in LEG_NAMES], 1e3 * np.linalg.norm(errors, axis=-1)
        )


def _height(view: View) -> Iterator[tuple[str, Array]]:
    """Yields the height of the torso above the ground [mm]."""
    yield "height", 1e3 * body_height(view.recording, view.parameters)


def _attitude(view: View) -> Iterator[tuple[str, Array]]:
    """Yields roll, pitch and yaw [deg]."""
    for name in ("roll", "pitch", "yaw"):
        yield name, np.degrees(np.unwrap(view.recording.column(f"torso.{name}")))


def _torques(view: View) -> Iterator[tuple[str, Array]]:
    """Yields the largest absolute torque [N m] of the six legs, by joint."""
    yield from _split(
        [f"{joint}.torque" for joint in JOINT_NAMES],
        np.abs(view.recording.joints("torque")).max(axis=1),
    )


REPLAYED: tuple[Maker, ...] = (_pose, _forces, _contacts, _slipped)
DRAWN: tuple[Maker, ...] = (_normal_forces, _slip, _feet, _height, _attitude, _torques)


def _split(names: list[str] | tuple[str, ...], table: Array) -> Iterator[tuple[str, Array]]:
    return zip(names, table.T, strict=True)


def pack(time: Array, columns: Mapping[str, Array]) -> dict[str, Any]:
    """Packs times (rows,) [s] and columns (rows,) for the viewer (recording.ts).

    Returns the number of rows, start and tick of the time [s], names, scales and offsets of the
    columns, and the data: first the ticks since the start (their low, then their high 16 bits),
    then each column in order. Columns with a value that is not finite are left out.
    """
    tick = max(TICK, (time[-1] - time[0]) / 2**31) if len(time) else TICK
    ticks = np.round((time - time[:1]) / tick).astype(np.uint32)
    kept = {name: values for name, values in columns.items() if np.isfinite(values).all()}
    scales = {name: _scale(values) for name, values in kept.items()}
    rows = [(ticks & 0xFFFF).astype(np.uint16), (ticks >> 16).astype(np.uint16)]
    rows += [_steps(values, *scales[name]) for name, values in kept.items()]
    return {
        "rows": len(time),
        "start": float(time[0]) if len(time) else 0.0,
        "tick": float(tick),
        "columns": [[name, *scales[name]] for name in kept],
        "data": _deflated(np.array(rows)),
    }


def _scale(values: Array) -> tuple[float, float]:
    """Returns the size of a step and the value of step 0; all steps of a constant are 0."""
    low, high = (float(np.min(values)), float(np.max(values))) if len(values) else (0.0, 0.0)
    return (high - low) / STEPS, low


def _steps(values: Array, scale: float, offset: float) -> NDArray[np.uint16]:
    return np.round((values - offset) / (scale or 1.0)).astype(np.uint16)


def _deflated(rows: NDArray[np.uint16]) -> str:
    """Deflates the differences along each row, all low bytes before all high bytes.

    High bytes are mostly equal, so they take little space.
    """
    differences = np.diff(rows, axis=1, prepend=np.zeros((len(rows), 1), np.uint16)).astype("<u2")
    planes = differences.reshape(-1).view(np.uint8).reshape(-1, 2).T
    return base64.b64encode(zlib.compress(np.ascontiguousarray(planes).tobytes(), 9)).decode(
        "ascii"
    )
