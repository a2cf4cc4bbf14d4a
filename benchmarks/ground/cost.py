"""Measures what a walk costs on uneven and on soft ground, over the same walk on the plane.

The robot gets the same commands on all grounds. The walks alternate, so that the noise of the
machine affects all of them, and the least processor time of each counts.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from plant import inputs

from benchmarks.ground.waves import Job, OurEngine, Setting, on_terrain
from benchmarks.series import OURS
from benchmarks.toolchain import Tools
from benchmarks.walks import STEP, Walk, commands
from hexapod_cosim.controller import BodyCommand, make_gait
from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.soil.presets import soil_preset

PLANE, FIELD, BLOCKS, SOIL = "plane", "height field", "blocks", "soil"
SMALL = {"platform_size": 0.3}  # the walks leave the platform soon
GROUNDS: dict[tuple[str, str], Mapping[str, Any]] = {
    (FIELD, "plane as a grid"): {"kind": "plane"},
    (FIELD, "wave"): {"kind": "wave", "platform_size": 0.0},
    (FIELD, "random_uniform"): {"kind": "random_uniform", "platform_size": 0.0},
    (FIELD, "dune"): {"kind": "dune", **SMALL},
    (BLOCKS, "stairs"): {"kind": "stairs", "step_height": 0.02, **SMALL},
    (BLOCKS, "rubble"): {"kind": "rubble", "max_height": 0.02, "stone_size": 0.15, **SMALL},
    (BLOCKS, "stepping_stones"): {
        "kind": "stepping_stones",
        "stone_distance": 0.04,
        "depth": 0.03,
        **SMALL,
    },
    (BLOCKS, "discrete_obstacles"): {"kind": "discrete_obstacles", "max_height": 0.02, **SMALL},
    (SOIL, "sand, a grid"): {"kind": "sand", "soil": "dry_sand"},
}
SOIL_PLANE = "plane of dry_sand"
PAD_RADIUS = 0.025  # m    of feet on soil
SPEED = 0.08  # m/s
STEPS = 1600  # macro-steps of a walk
ROUNDS, QUICK_ROUNDS = 15, 3


def ground_costs(tools: Tools, *, quick: bool) -> list[dict[str, Any]]:
    """Returns a record for each ground: kind, evaluations, least time of a walk [s]."""
    engine, jobs = OurEngine(tools), _jobs()
    least = dict.fromkeys(jobs, float("inf"))
    evaluations = dict.fromkeys(jobs, 0.0)
    for _ in range(QUICK_ROUNDS if quick else ROUNDS):
        for place, job in jobs.items():
            seconds, evaluations[place] = walked(engine, job)
            least[place] = min(least[place], seconds)
    return [
        {"ground": kind, "terrain": name, "evaluations": evaluations[kind, name], "seconds": taken}
        for (kind, name), taken in least.items()
    ]


def walked(engine: OurEngine, job: Job) -> tuple[float, float]:
    """Returns processor time [s] and evaluations of one walk at the solver's defaults."""
    solver = job.robot.solver
    setting = Setting(engine=OURS, method=solver.method, value=solver.tolerance, adaptive=True)
    plant, _ground = engine.plant(job, setting)
    records = [inputs(command) for command in job.commands]
    begin = time.thread_time()
    for k, record in enumerate(records):
        engine.core.hx_plant_step(plant.handle, record, (k + 1) * STEP)
    seconds = time.thread_time() - begin
    return seconds, float(plant.output().solver.evaluations)


def _jobs() -> dict[tuple[str, str], Job]:
    """Returns the walks by kind and name of their ground."""
    robot = load_robot("athena")
    walk = Walk(
        name="cost", robot=robot, gait=make_gait(robot, "tripod"), command=BodyCommand(vx=SPEED)
    )
    given = list(commands(walk, steps=STEPS))
    padded = replace(robot, foot=replace(robot.foot, pad_radius=PAD_RADIUS))
    found = {(PLANE, PLANE): Job(name=PLANE, robot=robot, commands=given)}
    for (kind, name), table in GROUNDS.items():
        owner = padded if kind == SOIL else robot
        found[kind, name] = Job(name=name, robot=on_terrain(owner, table), commands=given)
    found[SOIL, SOIL_PLANE] = Job(name=SOIL_PLANE, robot=_on_soil(padded), commands=given)
    return found


def _on_soil(robot: Robot) -> Robot:
    """Returns the robot on a plane of soil."""
    return replace(robot, soil=soil_preset("dry_sand").soil)
