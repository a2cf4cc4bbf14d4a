"""Finds the footprints that a run left in soil, and feet that sink too deep, by the outputs.

The plant keeps a footprint where a foot lost contact with it last, with its plastic depth and the
radius of the foot. Its outputs give the depth under each foot, which stays until the foot has left
the footprint, so a recording gives place and time to a row and the depth exactly.

A foot that is not lifted above the surface takes its footprint along: the plant has the later place
alone, so the one at the earlier place ends when the foot stands on the soil again.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.interface.names import foot_names
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.models import LEG_NAMES
from hexapod_cosim.models.records import Foot
from hexapod_cosim.models.soil.law import soil_radius

Array = NDArray[np.float64]

LEAST = 1e-6  # m    of depth; the plant keeps no shallower footprints


@dataclass(frozen=True)
class Footprint:
    """A footprint in soil, or one that a foot stands in at the end of the run."""

    leg: int
    begin: float  # s    first row in contact
    end: float  # s    from when on the foot has it at another place; inf: it stays
    x: float  # m    of the foot's last contact in it, world
    y: float
    depth: float  # m    plastic, under the undisturbed surface
    radius: float  # m    of the foot or its pad


def find_footprints(recording: Recording, parameters: Mapping[str, float]) -> list[Footprint]:
    """Returns the footprints of a run in order of time. Raises ColumnError without the columns."""
    depth, in_contact = recording.feet("sinkage"), recording.feet("contact") > 0.5
    place = recording.foot_vectors("position")
    radius = parameters.get("foot.pad_radius", 0.0) or parameters["foot.radius"]
    found = []
    for leg in range(depth.shape[1]):
        for first, last in _spans(depth[:, leg] >= LEAST):
            # none: the foot is above an older footprint
            contacts = [
                (first + begin, first + end) for begin, end in _spans(in_contact[first:last, leg])
            ]
            begins = [float(recording.time[begin]) for begin, _ in contacts]
            for k, (begin, end) in enumerate(contacts):
                x, y = place[end - 1, leg, :2].tolist()
                deepest = float(depth[begin:end, leg].max())
                until = begins[k + 1] if k + 1 < len(begins) else math.inf
                found.append(Footprint(leg, begins[k], until, x, y, deepest, radius))
    return sorted(found, key=lambda one: one.begin)


def sinkage_warnings(recording: Recording, parameters: Mapping[str, float]) -> list[str]:
    """Warns of a foot that sinks into soil deeper than the radius of its sphere or pad.

    The laws of soil count the foot alone; deeper than that the leg above it is in the soil, too.
    """
    names = foot_names("sinkage")
    if not len(recording.time) or not set(names) <= set(recording.names):
        return []
    depth, pad = recording.columns(names), parameters.get("foot.pad_radius", 0.0)
    foot = Foot(radius=parameters["foot.radius"], pad_radius=pad, youngs_modulus=1.0, poisson=0.0)
    radius = soil_radius(foot)
    if not depth.max() > radius:
        return []
    row, leg = np.unravel_index(int(np.argmax(depth)), depth.shape)
    kind, deepest = "pad" if pad else "sphere", float(depth[row, leg])
    return [
        f"foot {LEG_NAMES[leg]} sinks too deep: got {1e3 * deepest:.3g} mm at "
        f"{recording.time[row]:.3f} s, expected at most the radius of its {kind}, "
        f"{1e3 * radius:.3g} mm; the soil's law counts the foot alone and not the leg above it, so "
        "depth and slip are not reliable; give the feet larger pads (foot.pad_radius), or walk on "
        "firmer soil"
    ]


def _spans(flag: NDArray[np.bool_]) -> list[list[int]]:
    """Returns the first row of each period in which a flag is on, and the row after its last."""
    edges = np.flatnonzero(np.diff(flag.astype(int), prepend=0, append=0))
    return edges.reshape(-1, 2).tolist()
