"""Six-legged robots drawn at random, as someone might build them, and the walk asked of each.

The rule was fixed before any of them was designed for. All draws are uniform unless said otherwise
and come from the seed (SEED, number), so that each robot is the same whatever others are drawn.

Size. Total mass 0.5 to 30 kg, logarithmically uniform. The length of a leg L (coxa, femur and
tibia) is that of the ATHENA-like robot for the same density, 0.32 m (mass/5.6 kg)^(1/3), times 0.75
to 1.35, logarithmically uniform. The three links share L as 6 : 10 : 16, each part times 0.8 to
1.2.

Hips. Front and rear hips are 0.8 to 1.3 L apart, left and right ones 0.4 to 0.8 L, each hip off its
place by up to 0.03 L in x, y and z, the middle ones further out by up to 0.15 L. Yaws are 40 to 70
degrees off straight ahead (front) and straight back (rear), 80 to 100 in the middle: no robot is
symmetric.

Stance. Femurs rise by 10 to 35 degrees, tibias fall by 70 to 90; the feet are put on one plane by
the femurs' angles.

Masses. The torso has 0.35 to 0.6 of the mass, coxa, femur and tibia of each leg share the rest as
19 : 20 : 11, each part times 0.8 to 1.2 and each leg times 0.95 to 1.05. A link's centre of mass
lies at 0.45 to 0.65 of its length, up to 0.05 of it aside; the torso's is off the middle by up to
0.25 of its length, 0.25 of its width and 0.1 L in height. It is drawn again until, over either
tripod and all the way that the body makes in its stance, the whole robot's centre of mass keeps a
quarter of the hips' height from the edge of the support: a body that is stopped at a quarter of
gravity does not tip.

Feet. A rubber sphere of 0.04 to 0.06 L and 3 to 8 MPa; friction 0.5 to 0.9.

Gait. Tripod, the gait with the fewest feet on the ground. Period 1 s sqrt(h/0.12 m), h the height
of the hips (before each is moved off its place), as Froude's number has it, times 0.8 to 1.25;
strides 0.45 to 0.75 h, steps 0.25 to 0.4 h. The walk goes at stride/period, straight ahead.

Servos. What static torque a joint has to bear at most while a tripod carries the whole robot at
rest, feet pressing down only, is borne for ever: torque_continuous is 1 to 1.5 times it, torque_max
3 to 5 times torque_continuous. kp lets the worst loaded leg of a tripod sag by 0.03 to 0.1 h under
its share of the weight. speed_max is 1.5 to 3 times the fastest joint of the planned walk. The
rotor's inertia is kp (10 to 20 ms)^2, kd damps it with a ratio of 0.6 to 1, dry friction is 0.005
to 0.05 of torque_max.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit
from numpy.typing import NDArray

from hexapod_cosim.controller import BodyCommand, Controller, LegSolver, Measurement, make_gait
from hexapod_cosim.cosim.scenario.reading import scenario_from_table
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.models import LEG_NAMES, Robot, load_robot
from hexapod_cosim.models.dynamics import masses
from hexapod_cosim.models.kinematics import body_states
from hexapod_cosim.models.robot import robot_from_table

Array = NDArray[np.float64]
Draw = np.random.Generator

SEED = 20240607
COUNT = 30
GRAVITY = 9.81  # m/s2
PERIOD = 0.005  # s    of the controller
CYCLES = 8.0  # 1    of a walk, the ramp to its speed included
TRIPODS = ((0, 2, 4), (1, 3, 5))  # the two tripods LF LR RM and LM RF RR
MARGIN = 0.25  # 1    of the hips' height, from the centre of mass to a tripod's edge


def draw_robot(number: int, folder: Path) -> tuple[Path, Robot]:
    """Draws the robot of this number, writes it to a file in the folder and loads it from there."""
    path = folder / f"random_{number}.toml"
    path.write_text(tomlkit.dumps(draw_table(number)), encoding="utf-8")
    return path, load_robot(path)


def walk_of(robot: Robot, path: Path, control: str) -> Scenario:
    """Returns the scenario that the robot must walk."""
    speed, duration = (
        robot.gait.stride / robot.gait.period,
        round(CYCLES * robot.gait.period / PERIOD) * PERIOD,
    )
    table = {
        "robot": str(path),
        "control": control,
        "duration": duration,
        "macro_step": PERIOD,
        "command": {"vx": speed},
    }
    return scenario_from_table(table, where=f"walk of {robot.name}")


def draw_table(number: int) -> dict[str, Any]:
    """Draws the tables of the robot's file."""
    draw = np.random.default_rng((SEED, number))
    mass = math.exp(draw.uniform(math.log(0.5), math.log(30.0)))
    length = (
        0.32 * (mass / 5.6) ** (1.0 / 3.0) * math.exp(draw.uniform(math.log(0.75), math.log(1.35)))
    )
    links, height = _links(draw, length)
    legs = _legs(draw, length, links)
    table = {
        "name": f"random_{number}",
        "gravity": [0.0, 0.0, -GRAVITY],
        "legs": legs,
        "torso": _torso(draw, length, mass, legs),
        "foot": {
            "radius": draw.uniform(0.04, 0.06) * length,
            "youngs_modulus": draw.uniform(3e6, 8e6),
            "poisson": 0.49,
        },
        "contact": {
            "law": "exact_restitution",
            "restitution": 0.5,
            "damping_factor": 1.5,
            "impact_speed_floor": 0.01,
        },
        "baumgarte": {"alpha": 50.0, "beta": 50.0},
        "terrain": {"kind": "flat"},
        "solver": {"method": "rosw3", "step": 0.0, "tolerance": 1e-4, "step_max": 5e-3},
        "gait": _gait(draw, height),
        "servo": {
            "mode": "position",
            "kp": 1.0,
            "kd": 1.0,
            "torque_max": 1.0,
            "speed_max": 1.0,
            "rotor_inertia": 1.0,
            "coulomb_friction": 0.0,
            "torque_continuous": 1.0,
        },
    }
    mu = draw.uniform(0.5, 0.9)
    table["friction"] = {"law": "tanh", "mu": mu, "mu_static": mu, "slope": 100.0}
    _load(draw, table, length, mass)
    robot = _read(table)
    table["servo"] = _servo(draw, robot, height)
    return table


def _read(table: Mapping[str, Any]) -> Robot:
    return robot_from_table(table, where=str(table["name"]))


def _links(draw: Draw, length: float) -> tuple[dict[str, float], float]:
    """Draws lengths [m] and directions [rad] of a leg's links; returns the hips' height over the
    feet [m] too.
    """
    parts = np.array([6.0, 10.0, 16.0]) * draw.uniform(0.8, 1.2, 3)
    coxa, femur, tibia = (length * parts / parts.sum()).tolist()
    rise, fall = np.radians(draw.uniform([10.0, 70.0], [35.0, 90.0])).tolist()
    links = {"coxa": coxa, "femur": femur, "tibia": tibia, "rise": rise, "fall": fall}
    return links, tibia * math.sin(fall) - femur * math.sin(rise)


def _legs(draw: Draw, length: float, links: Mapping[str, float]) -> dict[str, Any]:
    """Draws the legs without their masses."""
    along, across, middle = (
        draw.uniform([0.8, 0.4, 0.0], [1.3, 0.8, 0.15]) * length / [2.0, 2.0, 1.0]
    )
    legs = {}
    for k, name in enumerate(LEG_NAMES):
        side, row = 1.0 if k < 3 else -1.0, k % 3
        yaw = math.radians(
            (draw.uniform(40.0, 70.0), draw.uniform(80.0, 100.0), 180.0 - draw.uniform(40.0, 70.0))[
                row
            ]
        )
        x, y, z = draw.uniform(-0.03, 0.03, 3) * length + [
            along * (1 - row),
            side * (across + (middle if row == 1 else 0.0)),
            0.0,
        ]
        # all feet on one plane: where the hip is higher, the femur rises less
        rise = math.asin(math.sin(links["rise"]) - z / links["femur"])
        legs[name] = {
            "hip_position": [float(x), float(y), float(z)],
            "hip_yaw": side * yaw,
        } | _joints(links, rise)
    return legs


def _joints(links: Mapping[str, float], rise: float) -> dict[str, Any]:
    """Draws a leg's joints."""
    axes, least, most = (
        ([0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [0.0, 1.0, 0.0]),
        (-1.0, -1.8, -0.8),
        (1.0, 1.8, 2.8),
    )
    stance = 0.0, rise, rise + links["fall"]
    return {
        joint: {
            "length": links[joint],
            "axis": axes[k],
            "angle_min": least[k],
            "angle_max": most[k],
            "stance": stance[k],
        }
        for k, joint in enumerate(("coxa", "femur", "tibia"))
    }


def _gait(draw: Draw, height: float) -> dict[str, Any]:
    period, stride, step = draw.uniform([0.8, 0.45, 0.25], [1.25, 0.75, 0.4])
    return {
        "name": "tripod",
        "period": float(period * math.sqrt(height / 0.12)),
        "duty": 0.5,
        "stride": float(stride * height),
        "step_height": float(step * height),
    }


def _torso(draw: Draw, length: float, mass: float, legs: Mapping[str, Any]) -> dict[str, Any]:
    """Makes a box between the hips."""
    hips = np.array([leg["hip_position"] for leg in legs.values()])
    size = [*(hips.max(axis=0) - hips.min(axis=0))[:2].tolist(), 0.25 * length]
    return {"mass": draw.uniform(0.35, 0.6) * mass, "size": size, "com": [0.0, 0.0, 0.0]}


def _load(draw: Draw, table: dict[str, Any], length: float, mass: float) -> None:
    """Draws masses, centres of mass and inertias of the links, and the torso's centre of mass."""
    left = (mass - table["torso"]["mass"]) / 6.0
    parts = np.array([19.0, 20.0, 11.0]) * draw.uniform(0.8, 1.2, 3)
    for leg in table["legs"].values():
        share = draw.uniform(0.95, 1.05)
        for part, joint in zip(parts / parts.sum(), ("coxa", "femur", "tibia"), strict=True):
            link, own = leg[joint], float(left * share * part)
            along, aside = draw.uniform(0.45, 0.65), draw.uniform(-0.05, 0.05, 2)
            extent = link["length"]
            link["mass"], link["com"] = own, [along * extent, *(aside * extent).tolist()]
            across = own * (0.3 * extent) ** 2
            link["inertia"] = [own * (0.1 * extent) ** 2, across, across, 0.0, 0.0, 0.0]
    while True:
        x, y, z = draw.uniform(-1.0, 1.0, 3) * [
            0.25 * table["torso"]["size"][0],
            0.25 * table["torso"]["size"][1],
            0.1 * length,
        ]
        table["torso"]["com"] = [float(x), float(y), float(z)]
        robot = _read(table)
        if tripod_margin(robot) >= MARGIN * hip_height(robot):
            return


def hip_height(robot: Robot) -> float:
    """Returns the mean height of the hips above the feet's centres in the stance [m]."""
    legs = LegSolver(robot)
    return float((legs.hip[2] - legs.forward(robot.stance)[:, 2]).mean())


def centre_of_mass(robot: Robot) -> Array:
    """Returns the centre of mass of the robot in its stance, torso frame, shape (2,) [m]."""
    level, still = np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3)
    body = body_states(robot, still, level, still, still, robot.stance, np.zeros((6, 3)))
    return np.asarray(
        (masses(robot) @ body[:, :2]) / robot.total_mass + np.array(robot.torso.com)[:2]
    )


def tripod_margin(robot: Robot) -> float:
    """Returns the least distance [m] of the centre of mass from the edges of either tripod while
    the body moves over it.
    """
    feet, centre = LegSolver(robot).forward(robot.stance)[:, :2], centre_of_mass(robot)
    way = 0.5 * robot.gait.stride * robot.gait.duty
    places = [centre + np.array([shift, 0.0]) for shift in (-way, way)]
    return min(_inside(feet[list(tripod)], place) for tripod in TRIPODS for place in places)


def _inside(corners: Array, point: Array) -> float:
    """Returns the distance [m] of a point from the nearest edge of a triangle, negative outside."""
    edges, arms = np.roll(corners, -1, axis=0) - corners, point - corners
    turned = edges[:, 0] * arms[:, 1] - edges[:, 1] * arms[:, 0]
    area = edges[0, 0] * edges[1, 1] - edges[0, 1] * edges[1, 0]
    return float((turned * np.sign(area) / np.linalg.norm(edges, axis=1)).min())


def tripod_forces(robot: Robot) -> Array:
    """Returns vertical forces [N] on the feet of either tripod that carry the robot at rest, shape
    (2, 6).
    """
    feet, centre = LegSolver(robot).forward(robot.stance)[:, :2], centre_of_mass(robot)
    forces = np.zeros((2, 6))
    for row, tripod in zip(forces, TRIPODS, strict=True):
        balance = np.vstack([np.ones(3), feet[list(tripod)].T])
        row[list(tripod)] = np.linalg.solve(balance, robot.weight * np.array([1.0, *centre]))
    return forces


def _servo(draw: Draw, robot: Robot, height: float) -> dict[str, Any]:
    """Draws servos that can carry the robot and follow its walk."""
    vertical, forces = LegSolver(robot).jacobian(robot.stance)[:, 2], tripod_forces(robot)
    static = float(np.abs(forces[:, :, None] * vertical).max())
    sag = float((forces * (vertical**2).sum(axis=1)).max())  # m    of the worst leg, times kp
    continuous = draw.uniform(1.0, 1.5) * static
    stall, kp = draw.uniform(3.0, 5.0) * continuous, sag / (draw.uniform(0.03, 0.1) * height)
    speed, rotor_time, ratio = (
        draw.uniform(1.5, 3.0) * fastest_joint(robot),
        draw.uniform(0.010, 0.020),
        draw.uniform(0.6, 1.0),
    )
    return {
        "mode": "position",
        "kp": kp,
        "kd": 2.0 * ratio * rotor_time * kp,
        "torque_max": stall,
        "speed_max": speed,
        "rotor_inertia": kp * rotor_time**2,
        "coulomb_friction": draw.uniform(0.005, 0.05) * stall,
        "torque_continuous": continuous,
    }


def fastest_joint(robot: Robot) -> float:
    """Returns the largest joint speed [rad/s] of the planned walk at full speed."""
    quick = replace(robot, servo=replace(robot.servo, speed_max=1e3))
    controller, measurement = Controller(quick, period=PERIOD, gait=make_gait(quick)), Measurement()
    command, steps = (
        BodyCommand(vx=robot.gait.stride / robot.gait.period),
        round(3.0 * robot.gait.period / PERIOD),
    )
    speeds = [
        np.abs(controller.step(k * PERIOD, command, measurement).speed_ref).max()
        for k in range(steps)
    ]
    return float(max(speeds))
