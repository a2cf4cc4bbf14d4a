"""Makes docs/images/joint_angles.svg: the signs of the joint angles, from the robot's kinematics.

python docs/figure_joint_angles.py
"""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch
from numpy.typing import NDArray

from hexapod_cosim.controller.figure_style import PALETTE, SETTINGS, UNDATED
from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.kinematics import foot_positions

Array = NDArray[np.float64]

TURN = 0.45  # rad    of the joint that an arrow shows
COXA, FEMUR, TIBIA = range(3)
COLOURS = PALETTE[:3]
LEG = 1  # LM, whose plane is the paper's in the second drawing


def turned(angle: Array, joint: int) -> Array:
    """Returns joint angles (6, 3) with one joint of all legs turned in the positive direction."""
    moved = angle.copy()
    moved[:, joint] += TURN
    return moved


def arrow(axis: Axes, begin: Array, end: Array, colour: str, bend: float = 0.2) -> None:
    """Draws a curved arrow between two points (2,) [mm]."""
    axis.add_patch(
        FancyArrowPatch(
            (float(begin[0]), float(begin[1])),
            (float(end[0]), float(end[1])),
            arrowstyle="-|>",
            mutation_scale=11.0,
            connectionstyle=f"arc3,rad={bend}",
            color=colour,
            linewidth=1.6,
        )
    )


def draw_above(axis: Axes, robot: Robot, stance: Array) -> None:
    """Draws all legs from above, x up and y to the left, and where a positive coxa angle leads."""
    hips = 1e3 * np.array([leg.hip_position for leg in robot.legs])[:, :2]
    feet, moved = (
        1e3 * foot_positions(robot, angle)[:, :2] for angle in (stance, turned(stance, COXA))
    )
    ring = [0, 3, 4, 5, 2, 1, 0]  # LF RF RM RR LR LM LF
    axis.fill(-hips[ring, 1], hips[ring, 0], color="0.9")
    for k, leg in enumerate(robot.legs):
        here, foot, there = ((-point[k, 1], point[k, 0]) for point in (hips, feet, moved))
        axis.plot(*np.transpose([here, foot]), color="0.3", linewidth=2.5, marker="o", markersize=4)
        arrow(axis, np.array(foot), np.array(there), COLOURS[COXA])
        axis.annotate(leg.name, foot, xytext=(0, 9), textcoords="offset points", ha="center")
    axis.annotate("front", (0, 215), ha="center")
    arrow(axis, np.array([0.0, 150.0]), np.array([0.0, 205.0]), "0.4", 0.0)
    axis.set_title("from above: coxa + turns counter-clockwise")


def draw_side(axis: Axes, robot: Robot, stance: Array) -> None:
    """Draws a left leg from behind, outwards to the left: where femur and tibia + lead."""
    leg = robot.legs[LEG]
    points = [leg_points(robot, stance)]
    points += [leg_points(robot, turned(stance, joint)) for joint in (FEMUR, TIBIA)]
    axis.plot(*points[0].T, color="0.3", linewidth=2.5, marker="o", markersize=4)
    for joint, pose in zip((FEMUR, TIBIA), points[1:], strict=True):
        axis.plot(*pose.T, color=COLOURS[joint], linewidth=1.0, linestyle="--")
        arrow(axis, points[0][3], pose[3], COLOURS[joint], 0.15 if joint == FEMUR else -0.15)
    texts = ((FEMUR, "femur +: knee and foot rise"), (TIBIA, "tibia +: foot bends down and in"))
    for joint, text in texts:
        axis.plot([], [], color=COLOURS[joint], label=text)
    axis.axhline(points[0][3, 1] - 1e3 * robot.foot.radius, color="0.7", linewidth=1.0)
    for place, name in zip(points[0], ("hip", "femur", "tibia", "foot"), strict=True):
        axis.annotate(name, place, xytext=(4, 6), textcoords="offset points", color="0.3")
    axis.set_title(f"leg {leg.name} from behind, outwards to the left")
    axis.legend(loc="upper right", fontsize=7.0)


def leg_points(robot: Robot, angle: Array) -> Array:
    """Returns hip, femur joint, tibia joint and foot of LEG (4, 2) [mm]: -y and z."""
    leg = robot.legs[LEG]
    coxa, femur, _ = (link.length for link in leg.links)
    _, q, _ = angle[LEG]
    hip = np.array(leg.hip_position)
    knee = hip + np.array([0.0, coxa, 0.0])
    ankle = knee + np.array([0.0, femur * np.cos(q), femur * np.sin(q)])
    foot = foot_positions(robot, angle)[LEG]
    return np.array([[-1e3 * point[1], 1e3 * point[2]] for point in (hip, knee, ankle, foot)])


def main() -> None:
    """Writes the picture."""
    robot = load_robot("athena")
    stance = np.array(robot.stance)
    target = Path(__file__).parent / "images" / "joint_angles.svg"
    with matplotlib.rc_context(SETTINGS):
        figure = Figure(figsize=(7.2, 3.6))
        above, side = figure.subplots(1, 2)
        draw_above(above, robot, stance)
        draw_side(side, robot, stance)
        for axis in (above, side):
            axis.set_aspect("equal", adjustable="datalim")
            axis.set_axis_off()
        figure.savefig(target, metadata=UNDATED["svg"])
    print(f"wrote {target}: {target.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
