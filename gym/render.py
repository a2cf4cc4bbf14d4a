"""Draws a robot on its ground as an array of pixels, for Gymnasium's `render`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.export.picture import (
    LIGHT,
    SHADOW,
    camera_axes,
    draw_shapes,
    lit,
    robot_shapes,
    shadow_depth,
)
from hexapod_cosim.cosim.interface.names import vector_names
from hexapod_cosim.cosim.master.signals import MEASURED
from hexapod_cosim.gym.scan import SPACING, GroundMaps
from hexapod_cosim.models import Robot
from hexapod_cosim.models.records import Array

WIDTH, HEIGHT = 480, 360  # pixels
PITCH = 0.0022  # m  in a pixel
SQUARE = 0.1  # m  of the pattern on the ground
LIGHT_SQUARE, DARK_SQUARE = np.array([0.80, 0.84, 0.87]), np.array([0.70, 0.75, 0.79])
REACH = 1.2  # m  from the middle to the farthest ground that a picture shows
MARCH = 32  # samples of a ray between the highest and the lowest height of the ground
FLAT = 1e-9  # m  a smaller difference of heights is a plane

Frame = NDArray[np.uint8]


@dataclass(frozen=True)
class _View:
    """The samples of a picture in camera axes whose origin is the ground below the torso."""

    camera: Array  # (3, 3) axes as rows, world axes
    origin: Array  # (3,) m  in the world
    x: Array  # (height, width) m  in camera axes
    y: Array

    def world(self, z: Array) -> Array:
        """Returns the world points (3, height, width) at distances z along the rays [m]."""
        point = np.tensordot(self.camera.T, np.stack([self.x, self.y, z]), axes=1)
        return np.asarray(point + self.origin[:, None, None])

    def at_height(self, height: float) -> Array:
        """Returns the z at which the rays are at a height in the world [m]."""
        up = self.camera[:, 2]
        across = up[0] * self.x + up[1] * self.y
        return np.asarray((height - self.origin[2] - across) / up[2])


def frame(robot: Robot, ground: GroundMaps, number: int, values: Mapping[str, float]) -> Frame:
    """Returns a picture (360, 480, 3) of a robot and the ground around it.

    number: of the ground in the maps, from 0; values: outputs of the plant by name. The robot's
    shadow is that on level ground at the height of the ground below its torso.
    """
    position, quaternion, angle = (
        np.array([values[name] for name in names])
        for names in (vector_names("torso.position"), MEASURED["quaternion"], MEASURED["angle"])
    )
    camera = camera_axes()
    below = ground.at(number, position[0], position[1])
    origin = np.array([position[0], position[1], float(below)])
    x = PITCH * (np.arange(WIDTH) + 0.5 - 0.5 * WIDTH)
    y = -PITCH * (np.arange(HEIGHT) + 0.5 - 0.5 * HEIGHT)
    view = _View(camera, origin, *np.meshgrid(x, y))
    capsules, box = robot_shapes(robot, position - origin, quaternion, angle.reshape(6, 3), camera)
    nearest = _meet(view, ground, number)
    colour = np.ones((HEIGHT, WIDTH, 4))
    shade = 1.0 - SHADOW * shadow_depth(capsules, box, camera, view.x, view.y)
    colour[..., :3] = shade[..., None] * _paint(view.world(nearest), ground, number)
    draw_shapes([box, *capsules], camera, view.x, view.y, colour, nearest)
    return np.round(255.0 * np.clip(colour[..., :3], 0.0, 1.0)).astype(np.uint8)


def _meet(view: _View, ground: GroundMaps, number: int) -> Array:
    """Returns the z at which rays from the eye meet the ground [m]."""
    low, high = ground.range_around(number, view.origin, REACH)
    last = view.at_height(low)
    if high - low < FLAT:
        return last
    first = view.at_height(high)
    met = last.copy()
    x, y, _ = view.world(last)
    back_x, back_y, _ = view.world(first) - view.world(last)
    for share in np.linspace(0.0, 1.0, MARCH):  # from the lowest to the highest point of a ray
        height = low + share * (high - low)
        inside = ground.at(number, x + share * back_x, y + share * back_y) >= height
        met[inside] = (last + share * (first - last))[inside]
    return met


def _paint(point: Array, ground: GroundMaps, number: int) -> Array:
    """Returns the colours (height, width, 3) of the ground at its points."""
    dark = (np.floor(point[0] / SQUARE) + np.floor(point[1] / SQUARE)) % 2.0 == 1.0
    base = np.where(dark[..., None], DARK_SQUARE, LIGHT_SQUARE)
    step = SPACING
    slope_x = ground.at(number, point[0] + step, point[1]) - ground.at(
        number, point[0] - step, point[1]
    )
    slope_y = ground.at(number, point[0], point[1] + step) - ground.at(
        number, point[0], point[1] - step
    )
    normal = np.stack([-slope_x, -slope_y, np.full_like(slope_x, 2.0 * step)])
    cosine = np.tensordot(LIGHT, normal / np.linalg.norm(normal, axis=0), axes=1)
    level = lit(np.array(LIGHT[2]))
    return np.asarray((lit(cosine) / level)[..., None] * base)
