"""Writes documentation/index.html of an FMU, and draws a robot: for model.png and the icon of its
FMU.

Links are thick lines and the torso is a box, drawn from the farthest to the nearest. All
coordinates are in camera axes (x right, y up, z towards the eye).
"""

from __future__ import annotations

import io
import math
import posixpath
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from xml.etree import ElementTree

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from PIL import Image, ImageDraw

from hexapod_cosim.cosim.interface.records import Interface
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.kinematics import body_states, rotation_matrix
from hexapod_cosim.models.records import Robot
from hexapod_cosim.models.statics import settled

AZIMUTH, ELEVATION = math.radians(-52.0), math.radians(27.0)  # of the eye
# unit vector towards the light, world axes
LIGHT = np.array([0.35, 0.55, 1.0]) / np.linalg.norm([0.35, 0.55, 1.0])
AMBIENT = 0.38  # share of ambient light
SAMPLES = 4  # per pixel and direction
MARGIN = 1.08  # size of the picture relative to the robot
THICKNESS = (0.30, 0.24, 0.17)  # radius of coxa, femur, tibia relative to the coxa's length
COLOURS = {
    "torso": (62, 92, 128),
    "coxa": (70, 74, 82),
    "femur": (226, 132, 52),
    "tibia": (96, 102, 112),
}

Colour = tuple[int, ...]
CLEAR = (0, 0, 0, 0)
INTERFACES = {"CoSimulation": "co-simulation", "ModelExchange": "model exchange"}


def render_html(interface: Interface, description: str, *, picture: str, reference: bool) -> str:
    """Returns the page of one FMU.

    Args:
        interface: of the FMU.
        description: the FMU's modelDescription.xml.
        picture: path of the robot's picture in the archive.
        reference: whether the archive contains reference results.
    """
    root = ElementTree.fromstring(description.encode())
    environment = Environment(
        loader=PackageLoader("hexapod_cosim.cosim.export", "pages"),
        autoescape=True,
        undefined=StrictUndefined,
    )
    return environment.get_template("page.html.jinja").render(
        robot=interface.robot,
        picture=posixpath.relpath(picture, "documentation"),
        reference=reference,
        interface=interface,
        about=root.get("description"),
        fmi=root.get("fmiVersion"),
        token=root.get("guid", root.get("instantiationToken")),
        kinds=[name for tag, name in INTERFACES.items() if root.find(tag) is not None],
    )


@dataclass(frozen=True)
class Shape:
    """A polygon, or a line with round ends of a radius above 0 [m]."""

    points: Array  # (n, 3) m
    colour: Colour
    radius: float = 0.0


@lru_cache(maxsize=8)
def draw_robot(robot: Robot, *, width: int, height: int) -> bytes:
    """Draws the standing robot as a PNG with a transparent background.

    Width and height are in pixels. Raises RobotError when the robot cannot stand.
    """
    R_EW = _camera_axes()
    shapes = _robot_shapes(robot, *settled(robot), R_EW)
    corners = np.concatenate(
        [shape.points[:, :2] + reach for shape in shapes for reach in (-shape.radius, shape.radius)]
    )
    low, high = corners.min(axis=0), corners.max(axis=0)
    image = Image.new("RGBA", (SAMPLES * width, SAMPLES * height), CLEAR)
    scale = SAMPLES / (MARGIN * float(np.max((high - low) / (width, height))))  # pixels per metre
    origin = 0.5 * np.array(image.size) - scale * 0.5 * (low + high) * (1.0, -1.0)
    pen = ImageDraw.Draw(image)
    for shape in shapes:
        _draw(pen, shape, origin, scale)
    data = io.BytesIO()
    image.reduce(SAMPLES).save(data, "PNG", optimize=True)
    return data.getvalue()


def _draw(pen: ImageDraw.ImageDraw, shape: Shape, origin: Array, scale: float) -> None:
    """Draws a shape at a scale [pixels per metre] with its origin at a pixel."""
    places = origin + scale * shape.points[:, :2] * (1.0, -1.0)
    points = [(float(x), float(y)) for x, y in places]
    radius = scale * shape.radius
    if radius == 0.0:
        pen.polygon(points, fill=shape.colour)
        return
    pen.line(points, fill=shape.colour, width=round(2.0 * radius))
    for x, y in points:
        pen.ellipse((x - radius, y - radius, x + radius, y + radius), fill=shape.colour)


def _camera_axes() -> Array:
    """Returns R_EW (3, 3), whose rows are the axes of the camera E in world axes."""
    toward = np.array(
        [
            math.cos(ELEVATION) * math.cos(AZIMUTH),
            math.cos(ELEVATION) * math.sin(AZIMUTH),
            math.sin(ELEVATION),
        ]
    )
    right = np.array([-math.sin(AZIMUTH), math.cos(AZIMUTH), 0.0])
    return np.array([right, np.cross(toward, right), toward])


def _robot_shapes(
    robot: Robot, position: Array, quaternion: Array, angle: Array, R_EW: Array
) -> list[Shape]:
    """Returns links and the torso's visible faces, the farthest first.

    position: (3,) of the torso's centre of mass [m]; quaternion: (4,) torso to world; angle: (6, 3)
    of the joints [rad].
    """
    bodies = body_states(
        robot, position, quaternion, np.zeros(3), np.zeros(3), angle, np.zeros_like(angle)
    )
    R_WT = rotation_matrix(bodies[0, 3:7])
    middle_W = position - R_WT @ np.array(robot.torso.com)
    parts = [(float((R_EW @ middle_W)[2]), _faces(robot, middle_W, R_WT, R_EW))]
    for number, body in enumerate(bodies[1:]):
        shape = _link(robot, number // 3, number % 3, body, R_EW)
        parts.append((float(shape.points[:, 2].mean()), [shape]))
    return [shape for _, shapes in sorted(parts, key=lambda part: part[0]) for shape in shapes]


def _link(robot: Robot, leg: int, joint: int, body: Array, R_EW: Array) -> Shape:
    """Returns the line from a link's joint to its tip."""
    link, R_WL = robot.legs[leg].links[joint], rotation_matrix(body[3:7])
    com_L, tip_L = np.array(link.com), np.array(link.tip)
    start_W, along_W = body[:3] - R_WL @ com_L, R_WL @ tip_L
    slope = float(along_W @ LIGHT) / (float(np.linalg.norm(along_W)) or 1.0)
    colour = _lit(COLOURS[("coxa", "femur", "tibia")[joint]], math.sqrt(max(1.0 - slope**2, 0.0)))
    radius = THICKNESS[joint] * robot.legs[leg].links[0].length
    return Shape(np.array([start_W, start_W + along_W]) @ R_EW.T, colour, radius)


def _faces(robot: Robot, middle: Array, R_WT: Array, R_EW: Array) -> list[Shape]:
    """Returns the faces of the torso that the eye sees."""
    found, half = [], 0.5 * R_WT * np.array(robot.torso.size)  # half of the edges as columns
    for axis in range(3):
        side = 1.0 if R_EW[2] @ R_WT[:, axis] > 0.0 else -1.0
        first, second = half[:, axis - 2], half[:, axis - 1]
        corners = [-first - second, first - second, first + second, second - first]
        points = middle + side * half[:, axis] + np.array(corners)
        colour = _lit(COLOURS["torso"], side * float(R_WT[:, axis] @ LIGHT))
        found.append(Shape(points @ R_EW.T, colour))
    return found


def _lit(colour: Sequence[float], cosine: float) -> Colour:
    """Returns the colour of a surface from the cosine of its angle to the light."""
    brightness = AMBIENT + (1.0 - AMBIENT) * max(cosine, 0.0)
    return tuple(round(brightness * one) for one in colour)
