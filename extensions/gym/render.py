"""Draws a robot on its ground as an array of pixels, for Gymnasium's `render`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.export.picture import (
    LIGHT,
    WHITE,
    Shape,
    View,
    camera_axes,
    lit,
    robot_shapes,
    shadows,
)
from hexapod_cosim.cosim.interface.names import vector_names
from hexapod_cosim.cosim.master.sensors import MEASURED
from hexapod_cosim.extensions.gym.plants import GroundMaps
from hexapod_cosim.models import Robot
from hexapod_cosim.models.records import Array

WIDTH, HEIGHT = 480, 360  # pixels
PITCH = 0.0022  # m  in a pixel
SQUARE = 0.1  # m  of the pattern on the ground
LIGHT_SQUARE, DARK_SQUARE = (227, 238, 247), (198, 212, 223)
TILE = 0.05  # m  edge of the ground's polygons
REACH = 1.2  # m  from the middle to the farthest ground that a picture shows

Frame = NDArray[np.uint8]


def frame(robot: Robot, ground: GroundMaps, number: int, values: Mapping[str, float]) -> Frame:
    """Returns a picture (360, 480, 3) of a robot and the ground around it.

    number: of the ground in the maps, from 0; values: outputs of the plant by name. The robot's
    shadow is that on level ground at the height of the ground below its torso, and no ground hides
    the robot.
    """
    position, quaternion, angle = (
        np.array([values[name] for name in names])
        for names in (vector_names("torso.position"), MEASURED["quaternion"], MEASURED["angle"])
    )
    camera, view = camera_axes(), View(WIDTH, HEIGHT, PITCH, np.zeros(2))
    origin = np.array([*position[:2], float(ground.at(number, *position[:2]))])
    shapes = robot_shapes(robot, position - origin, quaternion, angle.reshape(6, 3), camera)
    picture = view.draw(_tiles(ground, number, origin, camera), background=WHITE)
    picture.alpha_composite(view.draw([*shadows(shapes, camera), *shapes]))
    return np.asarray(picture.convert("RGB"))


def _tiles(ground: GroundMaps, number: int, origin: Array, camera: Array) -> Iterator[Shape]:
    """Yields polygons of the ground around a place, the farthest first."""
    first = np.round((origin[:2] - REACH) / TILE).astype(int)
    count = round(2.0 * REACH / TILE)
    x, y = (TILE * (start + np.arange(count + 1)) for start in first)
    nodes = np.stack([*np.meshgrid(x, y), ground.at(number, *np.meshgrid(x, y))], axis=-1)
    seen = (nodes - origin) @ camera.T
    for row, column in sorted(np.ndindex(count, count), key=lambda at: float(seen[at][2])):
        ring = ([row, row, row + 1, row + 1], [column, column + 1, column + 1, column])
        corners = nodes[ring]
        normal = np.cross(corners[2] - corners[0], corners[3] - corners[1])
        steep = float(normal @ LIGHT) / float(np.linalg.norm(normal))
        dark = np.floor(corners[:, :2].mean(axis=0) / SQUARE).sum() % 2.0 == 1.0
        yield Shape(seen[ring], lit(DARK_SQUARE if dark else LIGHT_SQUARE, steep))
