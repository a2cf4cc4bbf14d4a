"""Motion on every ground: the C plant takes the steps of the dense twin, through touch-downs, over
edges, in soil and on the torso's corners.

Both choose the same steps, so the counts of the solver agree, and the motion to rounding. On smooth
surfaces the plant ends Newton's method a step earlier, with normals that are right to 1e-7, and the
motion agrees to that.
"""

from __future__ import annotations

import ctypes as ct
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from grids import Ground, start_on_grid
from plant import Plant
from states import changed
from test_laws_soil import footprints

from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.dynamics import Command
from hexapod_cosim.models.ground.grid_file import grid_bytes
from hexapod_cosim.models.ground.patches import material_row
from hexapod_cosim.models.ground.surface import Surface, Terrain
from hexapod_cosim.models.ground.table import make_surface
from hexapod_cosim.models.integrator import integrate
from hexapod_cosim.models.kinematics import body_states, foot_centres
from hexapod_cosim.models.soil.presets import soil_preset
from hexapod_cosim.models.statics import standing
from hexapod_cosim.models.step import State, start_state

MACRO = 0.005  # s
PLACES = 1e-13  # m, 1: some hundreds of roundings, which impacts enlarge
SPEEDS = 1e-10  # m/s, rad/s: the same, over the time of an impact
SMOOTH = 1e6  # times as far on smooth surfaces: 1e-7 m
ATHENA = load_robot("athena")
FEET = changed(ATHENA, body={"contact": "off"})
STILL = np.zeros(3)

Commands = Callable[[float], Command]


class Pair:
    """The plant and the twin from the same bodies on."""

    def __init__(self, core: ct.CDLL, robot: Robot, body: Array) -> None:
        self.robot, self.state = robot, start_state(robot, body)
        self.plant = Plant(core, changed(robot, terrain={"kind": "flat"}))
        if robot.terrain.surface is not None:
            self.ground = Ground(core, grid_bytes(robot.terrain.surface))
            start_on_grid(self.plant, self.ground, position=(0.0, 0.0, 0.5))
        self.plant.bodies = body

    def move(self, until: float, commands: Commands) -> State:
        """Steps both to a time [s]."""
        for k in range(round(self.plant.time / MACRO), round(until / MACRO)):
            command = commands(k * MACRO)
            self.plant.step((k + 1) * MACRO, command)
            self.state = integrate(self.robot, command, self.state, (k + 1) * MACRO)
        return self.state

    def assert_same(self, *, scale: float = 1.0) -> None:
        """Asserts that motion, contacts, soil and counts of the solver agree."""
        state, output, bodies = self.state, self.plant.output(), self.plant.bodies
        assert np.abs(bodies[:, :7] - state.body[:, :7]).max() < PLACES * scale
        assert np.abs(bodies[:, 7:] - state.body[:, 7:]).max() < SPEEDS * scale
        assert np.abs(output.foot.bristle - state.bristle).max() < PLACES * scale
        assert np.abs(output.foot.sinkage - state.contacts.plastic).max() < PLACES * scale
        counts = (state.evaluations, state.steps, state.rejected, state.touchdowns)
        assert counts == tuple(int(x) for x in vars(output.solver).values())
        assert output.footprints == len(state.contacts.footprints)


def stood(robot: Robot, *, height: float = 0.0, velocity: Any = STILL) -> Array:
    """Returns the robot in its pose of rest, raised by a height [m], with a velocity [m/s]."""
    pose = standing(robot)
    place = np.add(pose.position, (0.0, 0.0, height))
    return body_states(
        robot, place, pose.quaternion, np.asarray(velocity), STILL, pose.angle, np.zeros((6, 3))
    )


def marching(t: float) -> Command:
    """Returns the stance with legs that swing by turns, four times a second."""
    angle, group = np.array(ATHENA.stance), np.arange(6) % 2
    phase = 2.0 * np.pi * 4.0 * t + np.pi * group
    angle[:, 0] += 0.2 * np.cos(phase) * np.where(np.arange(6) < 3, 1.0, -1.0)
    angle[:, 1] += 0.3 * np.maximum(np.sin(phase), 0.0)
    return Command(angle_ref=angle)


def on(surface: Surface, robot: Robot = FEET) -> Robot:
    return replace(robot, terrain=Terrain(kind="grid", surface=surface))


def test_a_walk_on_a_rough_smooth_surface_is_the_twins(core: ct.CDLL) -> None:
    given = {"platform_size": 0.0, "seed": 3, "max_height": 0.02}
    robot = on(make_surface("random_uniform", given), changed(FEET, friction={"law": "bristle"}))
    pair = Pair(core, robot, stood(robot, height=2e-4, velocity=(0.1, 0.0, -0.3)))
    state = pair.move(0.04, marching)
    pair.assert_same(scale=SMOOTH)
    assert state.touchdowns >= 2


def stairs(edge: float) -> Surface:
    """Returns blocks of 0.1 m: 20 mm down at x = edge, and a kerb of 10 mm along x in the way."""
    height = np.zeros((40, 40))
    height[:, 20:] = -0.02
    height[18:20] += 0.01
    return Surface(kind="blocks", height=height, x0=edge - 2.0, y0=-1.97, cell=0.1)


def test_feet_that_slide_over_edges_of_stairs_move_as_the_twins(core: ct.CDLL) -> None:
    """Two feet pass the nose of a step under a push of 60 N, fall and land on the lower step."""
    robot = changed(FEET, friction={"law": "bristle"})
    nose = float(foot_centres(robot, stood(robot))[0, 0]) + 0.008
    robot = on(stairs(nose), robot)
    body = stood(robot, height=-1e-4, velocity=(0.6, 0.0, 0.0))
    pair = Pair(core, robot, body)

    def shoved(_: float) -> Command:
        return Command(angle_ref=robot.stance, push_force=np.array([60.0, 5.0, 0.0]))

    state = pair.move(0.02, shoved)
    pair.assert_same()
    edges = np.flatnonzero(~np.isnan(state.contacts.damping))
    assert any(6 <= k < 12 for k in edges)  # on the nose, from the lower cell
    pair.move(0.08, shoved)
    pair.assert_same()
    assert pair.state.touchdowns >= 2


def test_feet_between_walls_and_floors_move_as_the_twins(core: ct.CDLL) -> None:
    given = {"platform_size": 0.0, "seed": 3, "max_height": 0.02, "stone_size": 0.06}
    robot = on(make_surface("rubble", given))
    body = stood(robot, height=5e-4, velocity=(0.3, 0.5, -0.4))
    pair = Pair(core, robot, body)
    touched = set()
    for k in range(1, 9):
        state = pair.move(k * MACRO, marching)
        touched |= set(np.flatnonzero(~np.isnan(state.contacts.damping)) // 6)
    pair.assert_same()
    assert {0, 1, 2} <= touched  # tops, walls along x and along y


@pytest.mark.parametrize(("soil", "pad"), [("dry_sand", 0.025), ("granular", 0.0)])
def test_a_walk_in_soil_is_the_twins(core: ct.CDLL, soil: str, pad: float) -> None:
    robot = changed(replace(FEET, soil=soil_preset(soil).soil), foot={"pad_radius": pad})
    pair = Pair(core, robot, stood(robot, height=1e-3, velocity=(0.1, 0.0, -0.3)))
    state = pair.move(0.06, marching)
    pair.assert_same()
    assert state.contacts.plastic.max() > 0.005
    assert state.touchdowns >= 3


def test_a_robot_that_hops_into_its_footprints_moves_as_the_twin(core: ct.CDLL) -> None:
    """It is pulled out of dry sand, which leaves six footprints, and comes down into them."""
    robot = replace(FEET, soil=soil_preset("dry_sand").soil)
    robot = changed(robot, foot={"pad_radius": 0.025})
    pair = Pair(core, robot, stood(robot, height=1e-4, velocity=(0.0, 0.0, -0.3)))
    weight = robot.weight

    def pulled(t: float) -> Command:
        up = 4.0 * weight if 0.03 <= t < 0.06 else 0.0
        return Command(angle_ref=robot.stance, push_force=np.array([0.0, 0.0, up]))

    state = pair.move(0.25, pulled)
    pair.assert_same()
    assert len(state.contacts.footprints) == 6
    assert np.abs(footprints(pair.plant) - state.contacts.footprints).max() < PLACES
    assert np.all(~np.isnan(state.damping))
    assert state.contacts.plastic.min() > state.contacts.footprints[:, 2].min() - PLACES


def test_patches_of_other_material_are_the_twins(core: ct.CDLL) -> None:
    """Feet come down on ice, on rubber, on dry sand and on the ground of the robot file."""
    ice, rubber = {"mu": 0.05, "stiffness": 3e7}, {"mu": 0.6, "mu_static": 0.9}
    table = np.array([material_row(patch) for patch in (ice, rubber, {"soil": "dry_sand"})])
    material = np.zeros((41, 41), dtype=np.uint8)
    material[20:, 22:], material[20:, :19], material[:20, 22:] = 1, 2, 3
    level = np.zeros((41, 41))
    surface = Surface(
        kind="smooth", height=level, x0=-2.0, y0=-2.0, cell=0.1, material=material, materials=table
    )
    robot = on(surface, changed(FEET, friction={"law": "tanh"}, foot={"pad_radius": 0.025}))
    pair = Pair(core, robot, stood(robot, height=1e-3, velocity=(0.2, 0.1, -0.3)))
    state = pair.move(0.03, lambda _: Command(angle_ref=robot.stance))
    pair.assert_same()
    held = [state.contacts.states[leg] for leg in range(6)]
    assert [h.soil.law for h in held] == ["none", "none", "none", "bekker", "none", "none"]
    assert held[0].friction.mu == 0.05
    assert held[2].friction.mu_static == 0.9
    assert state.touchdowns >= 6


def test_a_robot_that_lands_on_its_back_moves_as_the_twin(core: ct.CDLL) -> None:
    friction = {"law": "bristle", "mu_static": 0.8}
    robot = changed(ATHENA, body={"contact": "on"}, friction=friction)
    folded = np.tile([0.0, -0.3, 0.2], (6, 1))
    turn = np.array([0.05, 1.0, 0.02, 0.03])
    velocity = np.array([0.2, 0.0, -0.8])
    start = (np.array([0.0, 0.0, 0.042]), turn / np.linalg.norm(turn), velocity, STILL)
    body = body_states(robot, *start, folded, np.zeros((6, 3)))
    pair = Pair(core, robot, body)
    state = pair.move(0.025, lambda _: Command(angle_ref=folded))
    pair.assert_same()
    assert state.touchdowns >= 2
    assert np.all(np.isnan(state.damping))


def test_a_robot_that_falls_on_knees_and_shanks_over_rubble_moves_as_the_twin(
    core: ct.CDLL,
) -> None:
    given = {"platform_size": 0.0, "seed": 5, "max_height": 0.02, "stone_size": 0.2}
    robot = on(make_surface("rubble", given), changed(ATHENA, body={"contact": "on"}))
    kneeling = np.tile([0.0, -0.5, -0.75], (6, 1))
    start = (np.array([0.01, 0.02, 0.12]), np.eye(4)[0], np.array([0.1, 0.0, -0.8]), STILL)
    pair = Pair(core, robot, body_states(robot, *start, kneeling, np.zeros((6, 3))))
    touched = set()
    for k in range(1, 13):
        state = pair.move(k * MACRO, lambda _: Command(angle_ref=kneeling))
        touched |= set(np.flatnonzero(~np.isnan(state.contacts.damping)))
    pair.assert_same()
    assert any(k >= 32 for k in touched)  # 24 of feet, 8 of the torso, then knees and shanks
