"""Draws a robot: for model.png and the icon of its FMU, and for frames of a walk.

Links are capsules, the torso is a box; their intersections with rays parallel to the line of sight
are calculated in closed form. All coordinates are in camera axes (x right, y up, z towards the
eye), so that a pixel's ray is a line along z and the visible surface the one with the largest z.
"""

from __future__ import annotations

import io
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from hexapod_cosim.models.kinematics import body_states, rotation_matrix
from hexapod_cosim.models.records import Array, Robot
from hexapod_cosim.models.statics import settled

AZIMUTH, ELEVATION = math.radians(-52.0), math.radians(27.0)  # of the eye
# unit vector towards the light, world axes
LIGHT = np.array([0.35, 0.55, 1.0]) / np.linalg.norm([0.35, 0.55, 1.0])
AMBIENT, SHADOW = 0.38, 0.34  # share of ambient light; opacity of the deepest shadow
SAMPLES = 2  # per pixel and direction
PENUMBRA = 1.35  # radii at which a shadow has faded out
MARGIN = 1.08  # size of the picture relative to the robot
THICKNESS = (0.30, 0.24, 0.17)  # radius of coxa, femur, tibia relative to the coxa's length
COLOURS = {
    "torso": (62, 92, 128),
    "coxa": (70, 74, 82),
    "femur": (226, 132, 52),
    "tibia": (96, 102, 112),
}

Points = NDArray[np.float64]  # (3, height, width)
Extent = tuple[Array, Array]  # lower left and upper right corner of a shape


@dataclass(frozen=True)
class Capsule:
    """The points within a radius of the line from start to end [m]."""

    start: Array
    end: Array
    radius: float
    colour: tuple[int, int, int]

    def extent(self, radii: float = 1.0) -> Extent:
        """Returns the corners of the capsule with its radius multiplied by `radii`."""
        ends, reach = np.array([self.start[:2], self.end[:2]]), radii * self.radius
        return ends.min(axis=0) - reach, ends.max(axis=0) + reach

    def distance(self, point: Points) -> Array:
        """Returns the distance of points from the axis [m]."""
        share = (
            np.tensordot(self.end - self.start, point - _column(self.start), axes=1) / self._square
        )
        return np.asarray(np.linalg.norm(self._from_axis(point, share), axis=0))

    def meet(self, x: Array, y: Array) -> tuple[Array, Points]:
        """Returns the height z at which rays meet the surface (-inf where they miss it) and the
        surface's normals.
        """
        z = self._side(x, y)
        for centre in (self.start, self.end):
            z = np.fmax(z, _sphere(x, y, centre, self.radius))
        point = np.stack([x, y, np.where(np.isfinite(z), z, 0.0)])
        share = (
            np.tensordot(self.end - self.start, point - _column(self.start), axes=1) / self._square
        )
        return z, self._from_axis(point, share) / self.radius

    @property
    def _square(self) -> float:
        """The squared length of the axis [m^2]; 1 for a sphere."""
        return float(np.sum((self.end - self.start) ** 2)) or 1.0

    def _from_axis(self, point: Points, share: Array) -> Points:
        """Returns the vectors from the axis to points; share: position along the axis, 0 to 1."""
        return (
            point - _column(self.start) - _column(self.end - self.start) * np.clip(share, 0.0, 1.0)
        )

    def _side(self, x: Array, y: Array) -> Array:
        """Returns z on the cylinder: |p - a|^2 - (d.(p - a))^2 / d.d = r^2, quadratic in z."""
        axis = (self.end - self.start) / math.sqrt(self._square)
        flat = 1.0 - axis[2] ** 2
        if flat < 1e-9:  # seen from the end, where the spheres hide it
            return np.full_like(x, -np.inf)
        u, v = x - self.start[0], y - self.start[1]
        along = axis[0] * u + axis[1] * v
        root = along**2 * axis[2] ** 2 - flat * (u**2 + v**2 - along**2 - self.radius**2)
        z = (along * axis[2] + np.sqrt(np.fmax(root, 0.0))) / flat
        share = (along + axis[2] * z) / math.sqrt(self._square)
        return np.where((root > 0.0) & (share >= 0.0) & (share <= 1.0), z + self.start[2], -np.inf)


@dataclass(frozen=True)
class Box:
    """A box: centre [m], axes as columns, half of its edges [m]."""

    centre: Array
    axes: Array
    half: Array
    colour: tuple[int, int, int]

    def extent(self) -> Extent:
        """Returns the corners of the box."""
        reach = np.abs(self.axes[:2]) @ self.half
        return self.centre[:2] - reach, self.centre[:2] + reach

    def meet(self, x: Array, y: Array) -> tuple[Array, Points]:
        """Returns z where a ray from the eye enters the last of three slabs, as Capsule.meet."""
        offset = np.stack([x - self.centre[0], y - self.centre[1]])
        across = np.tensordot(self.axes.T[:, :2], offset, axes=1)  # (3, height, width)
        slope = np.where(np.abs(self.axes[2]) < 1e-12, 1e-12, self.axes[2])
        first = (np.sign(slope) * self.half)[:, None, None] - across
        last = -(np.sign(slope) * self.half)[:, None, None] - across
        enter, leave = first / slope[:, None, None], last / slope[:, None, None]
        face = np.argmin(enter, axis=0)
        z = np.min(enter, axis=0)
        normal = np.moveaxis((self.axes * np.sign(slope)).T[face], -1, 0)
        return np.where(z > np.max(leave, axis=0), z + self.centre[2], -np.inf), normal


Shape = Box | Capsule


def _column(vector: Array) -> Points:
    """Reshapes a vector (3,) to (3, 1, 1)."""
    return vector[:, None, None]


def _sphere(x: Array, y: Array, centre: Array, radius: float) -> Array:
    """Returns the height z at which rays meet a sphere; -inf where they miss it."""
    square = radius**2 - (x - centre[0]) ** 2 - (y - centre[1]) ** 2
    return np.where(square > 0.0, centre[2] + np.sqrt(np.fmax(square, 0.0)), -np.inf)


@lru_cache(maxsize=8)
def draw_robot(robot: Robot, *, width: int, height: int) -> bytes:
    """Draws the standing robot as a PNG with a transparent background.

    Width and height are in pixels. Raises RobotError when the robot cannot stand.
    """
    camera = camera_axes()
    capsules, box = robot_shapes(robot, *settled(robot), camera)
    x, y = _grid(capsules, box, width * SAMPLES, height * SAMPLES)
    colour = np.zeros((*x.shape, 4))
    colour[..., 3] = SHADOW * shadow_depth(capsules, box, camera, x, y)
    draw_shapes([box, *capsules], camera, x, y, colour, np.full_like(x, -np.inf))
    colour[..., :3] *= colour[..., 3:]
    mean = colour.reshape(height, SAMPLES, width, SAMPLES, 4).mean(axis=(1, 3))
    mean[..., :3] /= np.fmax(mean[..., 3:], 1e-9)
    data = io.BytesIO()
    Image.fromarray(np.round(255.0 * mean).astype(np.uint8), "RGBA").save(
        data, "PNG", optimize=True
    )
    return data.getvalue()


def camera_axes() -> Array:
    """Returns the camera axes (rows) in world axes."""
    toward = np.array(
        [
            math.cos(ELEVATION) * math.cos(AZIMUTH),
            math.cos(ELEVATION) * math.sin(AZIMUTH),
            math.sin(ELEVATION),
        ]
    )
    right = np.array([-math.sin(AZIMUTH), math.cos(AZIMUTH), 0.0])
    return np.array([right, np.cross(toward, right), toward])


def robot_shapes(
    robot: Robot, position: Array, quaternion: Array, angle: Array, camera: Array
) -> tuple[list[Capsule], Box]:
    """Returns links and torso in camera axes.

    position: (3,) of the torso's centre of mass [m]; quaternion: (4,) torso to world; angle: (6, 3)
    of the joints [rad].
    """
    bodies = body_states(
        robot, position, quaternion, np.zeros(3), np.zeros(3), angle, np.zeros_like(angle)
    )
    capsules = []
    for body, (leg, joint) in zip(
        bodies[1:], ((leg, joint) for leg in range(6) for joint in range(3)), strict=True
    ):
        link, turn = robot.legs[leg].links[joint], rotation_matrix(body[3:7])
        start = body[:3] - turn @ np.array(link.com)
        radius = THICKNESS[joint] * robot.legs[leg].links[0].length
        colour = COLOURS[("coxa", "femur", "tibia")[joint]]
        capsules.append(
            Capsule(camera @ start, camera @ (start + turn @ np.array(link.tip)), radius, colour)
        )
    turn = rotation_matrix(bodies[0, 3:7])
    middle = position - turn @ np.array(robot.torso.com)
    return capsules, Box(
        camera @ middle, camera @ turn, 0.5 * np.array(robot.torso.size), COLOURS["torso"]
    )


def _grid(capsules: Sequence[Capsule], box: Box, width: int, height: int) -> tuple[Array, Array]:
    """Returns camera coordinates of samples around the whole robot; row 0 is at the top."""
    shapes: list[Shape] = [box, *capsules]
    extents = np.array([shape.extent() for shape in shapes])
    low, high = extents[:, 0].min(axis=0), extents[:, 1].max(axis=0)
    pitch = MARGIN * max((high[0] - low[0]) / width, (high[1] - low[1]) / height)
    middle = 0.5 * (low + high)
    x = middle[0] + pitch * (np.arange(width) + 0.5 - 0.5 * width)
    y = middle[1] - pitch * (np.arange(height) + 0.5 - 0.5 * height)
    return np.meshgrid(x, y)


def draw_shapes(
    shapes: Iterable[Shape], camera: Array, x: Array, y: Array, colour: Array, nearest: Array
) -> None:
    """Draws shapes over a picture, where they are nearer to the eye than what it shows.

    colour: (height, width, 4) from 0 to 1; nearest: (height, width) z of what is shown.
    """
    for shape in shapes:
        part = _window(shape.extent(), x, y)
        z, normal = shape.meet(x[part], y[part])
        light = lit(np.tensordot(camera @ LIGHT, normal, axes=1))
        seen = z > nearest[part]
        nearest[part][seen] = z[seen]
        colour[part][seen] = np.append(
            light[seen, None] * np.array(shape.colour) / 255.0,
            np.ones((int(seen.sum()), 1)),
            axis=1,
        )


def lit(cosine: Array) -> Array:
    """Returns the brightness of a surface from the cosine of its angle to the light."""
    brightness: Array = AMBIENT + (1.0 - AMBIENT) * np.fmax(cosine, 0.0)
    return brightness


def _window(extent: Extent, x: Array, y: Array) -> tuple[slice, slice]:
    """Returns the rows and columns of samples within an extent."""
    (left, bottom), (right, top) = extent
    rows = np.searchsorted(-y[:, 0], [-top, -bottom])
    columns = np.searchsorted(x[0], [left, right])
    return slice(int(rows[0]), int(rows[1])), slice(int(columns[0]), int(columns[1]))


def shadow_depth(capsules: Iterable[Capsule], box: Box, camera: Array, x: Array, y: Array) -> Array:
    """Returns the depth of the shadow on the plane z = 0 at each sample, from 0 to 1."""
    up, lamp = camera[:, 2], camera @ LIGHT
    spine = box.axes[:, 0] * (box.half[0] - box.half[1])
    body = Capsule(box.centre - spine, box.centre + spine, float(box.half[1]), box.colour)
    depth = np.zeros_like(x)
    for shape in (*capsules, body):
        start, end = (
            point - lamp * float(up @ point) / float(up @ lamp)
            for point in (shape.start, shape.end)
        )
        cast = Capsule(start, end, shape.radius, shape.colour)
        part = _window(cast.extent(PENUMBRA), x, y)
        ground = np.stack([x[part], y[part], -(up[0] * x[part] + up[1] * y[part]) / up[2]])
        edge = (PENUMBRA - cast.distance(ground) / shape.radius) / (2.0 * (PENUMBRA - 1.0))
        depth[part] = np.fmax(depth[part], np.clip(edge, 0.0, 1.0))
    return depth
