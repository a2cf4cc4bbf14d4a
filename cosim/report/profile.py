"""Computes where feet stood, and the height profile of the ground along the torso's path."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.results.ground import heights_at
from hexapod_cosim.cosim.results.window import View
from hexapod_cosim.models.ground.surface import Surface

Array = NDArray[np.float64]

SAMPLES = 600  # of the profile
ACROSS = 9  # places across the robot's width whose least and largest height are shown
BEYOND = 0.3  # m    of the profile before and after the torso's path
LEAST_STEP = 1e-4  # m    of the smoothed path from row to row that has a direction
MILLI = 1e3


@dataclass(frozen=True)
class Stance:
    """A foot on the ground from touch-down to lift-off."""

    leg: int
    begin: float  # s
    end: float  # s
    x: float  # m    contact point at touch-down, world
    y: float
    z: float
    depth: float  # m    of the contact point's lowest place below the surface before the contact


@dataclass(frozen=True)
class Profile:
    """The ground along the torso's path; `way` is the distance along the path [m]."""

    way: Array  # (samples,) m
    ground: Array  # (samples,) m    below the path
    low: Array  # (samples,) m    least and largest height across the robot's width
    high: Array
    torso_way: Array  # (rows,) m    of the torso in each row of the recording
    torso_height: Array  # (rows,) m    world
    stance_way: Array  # (stances,) m    of the contact points at touch-down


def find_stances(view: View, surface: Surface) -> list[Stance]:
    """Returns all stances of a run, by leg and time. Raises ColumnError without the columns."""
    recording = view.recording
    touching, place = recording.feet("contact") > 0.5, recording.foot_vectors("position")
    time, found = recording.time, list[Stance]()
    for leg in range(touching.shape[1]):
        on = touching[:, leg].astype(int)
        edges = np.flatnonzero(np.diff(on, prepend=0, append=0)).reshape(-1, 2)
        for begin, end in edges.tolist():
            x, y, z = place[begin, leg].tolist()
            lowest = float(place[begin:end, leg, 2].min())
            last = float(time[min(end, len(time) - 1)])
            found.append(Stance(leg, float(time[begin]), last, x, y, z, lowest))
    return _with_depths(found, view, surface)


def _with_depths(found: list[Stance], view: View, surface: Surface) -> list[Stance]:
    """Returns stances whose depth, the lowest height until now, is below the surface."""
    x, y = np.array([[one.x, one.y] for one in found]).reshape(-1, 2).T
    ground = heights_at(surface, view.parameters, x, y)
    return [
        Stance(one.leg, one.begin, one.end, one.x, one.y, one.z, float(height) - one.depth)
        for one, height in zip(found, ground, strict=True)
    ]


def make_profile(view: View, surface: Surface, stances: list[Stance]) -> Profile:
    """Returns the profile along the torso's path, averaged over a gait period.

    Raises ColumnError without the columns.
    """
    recording = view.recording
    path = _averaged(recording.time, recording.vector("torso.position")[:, :2], view.period)
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    torso_way = np.concatenate([[0.0], np.cumsum(steps)])
    ahead = _directions(path, recording.column("torso.yaw"))
    rows = np.searchsorted(recording.time, [one.begin for one in stances])
    rows = np.minimum(rows, len(path) - 1)
    arms = np.array([[one.x, one.y] for one in stances]).reshape(-1, 2) - path[rows]
    forward = np.einsum("ri,ri->r", arms, ahead[rows])
    aside = np.abs(ahead[rows, 0] * arms[:, 1] - ahead[rows, 1] * arms[:, 0])
    way = np.linspace(-BEYOND, torso_way[-1] + BEYOND, SAMPLES)
    ground = _band(view, surface, path, ahead, torso_way, way, float(aside.max(initial=0.0)))
    return Profile(
        way=way,
        ground=ground[ACROSS // 2],
        low=ground.min(axis=0),
        high=ground.max(axis=0),
        torso_way=torso_way,
        torso_height=recording.vector("torso.position")[:, 2],
        stance_way=torso_way[rows] + forward,
    )


def _averaged(time: Array, values: Array, period: float) -> Array:
    """Returns values (rows, n) averaged over half a period before and after each row."""
    step = (time[-1] - time[0]) / max(len(time) - 1, 1)
    half = min(round(0.5 * period / step) if step > 0.0 else 0, len(time) - 1)
    if half < 1:
        return values
    # continued by point reflection, so that ends stay where they are and keep their direction
    before = 2.0 * values[0] - values[half:0:-1]
    after = 2.0 * values[-1] - values[-2 : -half - 2 : -1]
    sums = np.cumsum(np.concatenate([0.0 * values[:1], before, values, after]), axis=0)
    return np.asarray((sums[2 * half + 1 :] - sums[: -2 * half - 1]) / (2 * half + 1))


def _directions(path: Array, yaw: Array) -> Array:
    """Returns unit vectors (rows, 2) along a path; where it stands still, along the torso's yaw."""
    steps = np.gradient(path, axis=0) if len(path) > 1 else np.zeros_like(path)
    size = np.linalg.norm(steps, axis=1)
    still = size < LEAST_STEP
    nose = np.column_stack([np.cos(yaw), np.sin(yaw)])
    return np.where(still[:, None], nose, steps / np.where(still, 1.0, size)[:, None])


def _band(
    view: View,
    surface: Surface,
    path: Array,
    ahead: Array,
    torso_way: Array,
    way: Array,
    half_width: float,
) -> Array:
    """Returns the ground's heights (ACROSS, samples) at ways along the path and beside it."""
    rows = np.minimum(np.searchsorted(torso_way, way), len(path) - 1)
    inside = np.clip(way, torso_way[0], torso_way[-1])
    along = np.column_stack([np.interp(inside, torso_way, each) for each in path.T])
    along = along + (way - inside)[:, None] * ahead[rows]
    left = np.column_stack([-ahead[rows, 1], ahead[rows, 0]])
    lines = [along + side * left for side in np.linspace(-half_width, half_width, ACROSS)]
    return np.array([heights_at(surface, view.parameters, *line.T) for line in lines])


def pack_profile(profile: Profile, stances: list[Stance]) -> dict[str, Any]:
    """Returns a profile for the viewer (panels/profile.ts): ways [mm] and heights [0.1 mm]."""
    lines = {
        name: np.round(1e4 * getattr(profile, name)).astype(int).tolist()
        for name in ("ground", "low", "high")
    }
    feet = zip(profile.stance_way, stances, strict=True)
    return lines | {
        "begin": float(profile.way[0]),
        "end": float(profile.way[-1]),
        "feet": [
            [stance.leg, round(stance.begin, 6), round(float(way), 4), round(stance.z, 5)]
            for way, stance in feet
        ],
    }
