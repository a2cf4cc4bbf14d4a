"""Computes the height profile of the ground along the torso's path."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.results.ground import heights_at
from hexapod_cosim.cosim.results.window import View
from hexapod_cosim.models.ground.surface import Surface

Array = NDArray[np.float64]

SAMPLES = 600  # of the profile
ACROSS = 9  # places across the robot's width whose least and largest height are shown
BEYOND = 0.3  # m    of the profile before and after the torso's path
LEAST_STEP = 1e-4  # m    of the smoothed path from row to row that has a direction


@dataclass(frozen=True)
class Profile:
    """The ground along the torso's path; `way` is the distance along the path [m]."""

    way: Array  # (samples,) m
    ground: Array  # (samples,) m    below the path
    low: Array  # (samples,) m    least and largest height across the robot's width
    high: Array
    contact_way: Array  # (touch-downs,) m    of the contact points
    contact_height: Array  # (touch-downs,) m    world


def _touch_downs(recording: Recording) -> tuple[NDArray[np.intp], Array]:
    """Returns rows (n,) and contact points (n, 3) [m] of all touch-downs, leg by leg."""
    on = recording.feet("contact") > 0.5
    legs, rows = np.nonzero(np.diff(on.astype(int), axis=0, prepend=0).T > 0)
    return rows, recording.foot_vectors("position")[rows, legs]


def make_profile(view: View, surface: Surface) -> Profile:
    """Returns the profile along the torso's path, averaged over a gait period.

    Raises ColumnError without the columns.
    """
    recording = view.recording
    path = _averaged(recording.time, recording.vector("torso.position")[:, :2], view.period)
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    torso_way = np.concatenate([[0.0], np.cumsum(steps)])
    ahead = _directions(path, recording.column("torso.yaw"))
    rows, contacts = _touch_downs(recording)
    arms = contacts[:, :2] - path[rows]
    forward = np.einsum("ri,ri->r", arms, ahead[rows])
    aside = np.abs(ahead[rows, 0] * arms[:, 1] - ahead[rows, 1] * arms[:, 0])
    way = np.linspace(-BEYOND, torso_way[-1] + BEYOND, SAMPLES)
    ground = _band(view, surface, path, ahead, torso_way, way, float(aside.max(initial=0.0)))
    return Profile(
        way=way,
        ground=ground[ACROSS // 2],
        low=ground.min(axis=0),
        high=ground.max(axis=0),
        contact_way=torso_way[rows] + forward,
        contact_height=contacts[:, 2],
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
