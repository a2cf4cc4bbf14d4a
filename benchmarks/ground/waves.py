"""Measures the height field beside MuJoCo's: walks, foot forces against the step, a hard landing.

The walks of the family lead over waves of the ground. Robot, start and commands are the same in
both engines. MuJoCo has its own contact and its height field consists of triangles, so each
engine's error is the distance from its own converged path. Both libraries are called from Python
once per macro-step, and their times contain these calls.
"""

from __future__ import annotations

import ctypes as ct
import json
import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from grids import Ground, on_grid
from mirror import BODIES, BODY_STATE
from numpy.typing import NDArray
from plant import Plant, inputs, pointer

from benchmarks import BUILD
from benchmarks.measure import REPEATED_TIME, REPEATS, DriverError, call, distance
from benchmarks.series import OURS
from benchmarks.toolchain import Tools
from benchmarks.walks import STEP, Walk, commands, family
from hexapod_cosim.models import LEG_NAMES, METHODS, Robot, load_robot
from hexapod_cosim.models.dynamics import Command
from hexapod_cosim.models.ground.grid_file import grid_bytes
from hexapod_cosim.models.ground.table import read_terrain
from hexapod_cosim.models.kinematics import rotation_matrix
from hexapod_cosim.models.mjcf import robot_to_mjcf
from hexapod_cosim.models.statics import settled

Array = NDArray[np.float64]

# the feet stand on the waves from the start: 0.5 m long along x and y, 30 mm from trough to crest
WAVES = {
    "kind": "wave",
    "amplitude": 0.015,
    "num_waves": 8,
    "horizontal_scale": 0.025,
    "platform_size": 0.0,
}
LEVEL = {"kind": "plane", "size": 4.0, "horizontal_scale": 0.05}
MUJOCO = "mujoco"
FOLDER = BUILD / "ground"
EVERY = 3  # of the family; odd, so that both robots are included
MOST_REPEATS = 3  # of MuJoCo's walks
FORCE_STEPS = (1e-3, 5e-4, 2.5e-4)  # s
SMALL_FOOT, IMPACT_SPEED, FALL = 0.02, 3.0, 0.25  # m, m/s, s of the landing


@dataclass(frozen=True, kw_only=True)
class Setting:
    """A method of an engine at a step [s], or at a tolerance."""

    engine: str
    method: str
    value: float
    adaptive: bool = False
    quick: bool = False


CONVERGED = {
    OURS: Setting(engine=OURS, method="dp54", value=1e-9, adaptive=True),
    MUJOCO: Setting(engine=MUJOCO, method="RK4", value=3.125e-5),
}


def settings(*, quick: bool) -> list[Setting]:
    """Returns the measured settings, from coarse to fine by method."""
    tolerances = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5)
    found = [
        Setting(engine=OURS, method=method, value=value, adaptive=True, quick=value in (1e-2, 1e-4))
        for method in ("rosw3", "ros2")
        for value in tolerances
    ]
    found += [Setting(engine=OURS, method="rosw3", value=step, quick=True) for step in FORCE_STEPS]
    steps = (*FORCE_STEPS, 1.25e-4, 6.25e-5)
    found += [
        Setting(engine=MUJOCO, method=method, value=step, quick=step in FORCE_STEPS)
        for method in ("implicitfast", "RK4")
        for step in steps
    ]
    return [one for one in found if one.quick or not quick]


@dataclass(frozen=True, kw_only=True)
class Motion:
    """What an engine returns; `seconds` are the loop's, median over repeats."""

    seconds: float
    path: Array  # (n + 1, 3) m, torso
    speed: Array  # (n + 1,) m/s, torso, up
    force: Array  # (n, 6) N, normal forces of the feet at the macro-steps
    peak: Array  # (6,) N


@dataclass(frozen=True, kw_only=True)
class Job:
    """A robot on its ground, its start, and commands that are constant for a macro-step each."""

    name: str
    robot: Robot
    commands: Sequence[Command]
    height: float = 0.0  # m    of the torso above its pose of rest
    speed: float = 0.0  # m/s  of the start, downwards

    @cached_property
    def start(self) -> dict[str, Array]:
        """Position [m], quaternion, velocity [m/s] and joint angles [rad] of the start."""
        position, quaternion, angle = settled(self.robot)
        return {
            "position": position + np.array([0.0, 0.0, self.height]),
            "quaternion": quaternion,
            "velocity": np.array([0.0, 0.0, -self.speed]),
            "angle": angle,
        }


def on_terrain(robot: Robot, table: Mapping[str, Any]) -> Robot:
    """Returns the robot on the surface of a table [terrain]."""
    return replace(robot, terrain=read_terrain(table, "benchmark"))


def on_waves(walk: Walk) -> Job:
    """Returns a walk of the family over the waves."""
    robot = on_terrain(walk.robot, WAVES)
    return Job(name=walk.name, robot=robot, commands=list(commands(walk)))


def landing(*, field: bool) -> Job:
    """Returns the landing at 3 m/s on feet of 20 mm, on a level height field or on the plane."""
    robot = load_robot("athena")
    robot = replace(robot, foot=replace(robot.foot, radius=SMALL_FOOT))
    if field:
        robot = on_terrain(robot, LEVEL)
    hold = [Command(angle_ref=robot.stance)] * round(FALL / STEP)
    name = f"landing-{'field' if field else 'plane'}"
    return Job(name=name, robot=robot, commands=hold, height=SMALL_FOOT, speed=IMPACT_SPEED)


# ---- this plant ----


class OurEngine:
    """Runs jobs in the plant's C library."""

    def __init__(self, tools: Tools) -> None:
        self.core = ct.CDLL(str(next((tools.native / "plant_fmu").glob("libhexapod_c.[sd]*"))))

    def plant(self, job: Job, setting: Setting) -> tuple[Plant, Ground | None]:
        """Returns a plant at the job's start, and its ground, which must outlive it."""
        solver = replace(
            job.robot.solver,
            method=setting.method,
            step=0.0 if setting.adaptive else setting.value,
            tolerance=setting.value if setting.adaptive else job.robot.solver.tolerance,
        )
        robot = replace(job.robot, solver=solver)
        if robot.terrain.surface is None:
            return Plant(self.core, robot, **job.start), None
        ground = Ground(self.core, grid_bytes(robot.terrain.surface))
        return on_grid(self.core, _flat(robot), ground, **job.start), ground

    def run(self, job: Job, setting: Setting, *, timed: bool = True) -> Motion:
        """Runs a job. Raises DriverError."""
        assert setting.method in METHODS
        records = [inputs(command) for command in job.commands]
        walk, seconds = self._walked(job, setting, records), []
        for _ in range(REPEATS if timed else 1):
            taken, path, speed = next(walk)
            seconds.append(taken)
            if sum(seconds) > REPEATED_TIME:
                break
        force, peak = self._forces(job, setting)
        return Motion(seconds=median(seconds), path=path, speed=speed, force=force, peak=peak)

    def _walked(
        self, job: Job, setting: Setting, records: Sequence[Any]
    ) -> Iterator[tuple[float, Array, Array]]:
        """Yields time, path and vertical speed of one walk after the other."""
        n = len(records)
        while True:
            plant, ground = self.plant(job, setting)
            states = np.empty((n + 1, BODIES, BODY_STATE))
            step, bodies = self.core.hx_plant_step, self.core.hx_plant_get_bodies
            places = [pointer(state) for state in states]
            refs, failed = [ct.byref(record) for record in records], 0
            begin = time.perf_counter()
            bodies(plant.handle, places[0])
            for k in range(n):
                failed |= step(plant.handle, refs[k], (k + 1) * STEP)
                bodies(plant.handle, places[k + 1])
            seconds = time.perf_counter() - begin
            if failed:
                raise DriverError(plant.message)
            yield seconds, states[:, 0, :3].copy(), states[:, 0, 9].copy()
            del plant, ground

    def _forces(self, job: Job, setting: Setting) -> tuple[Array, Array]:
        """Returns the normal forces at the begin of each macro-step, and their peaks."""
        plant, _ground = self.plant(job, setting)
        force, peak = [], np.zeros(len(LEG_NAMES))
        for k, command in enumerate(job.commands):
            foot = plant.output(command).foot
            force.append(foot.normal_force)
            peak = np.maximum(peak, foot.peak_force)
            plant.step((k + 1) * STEP, command)
        return np.array(force), np.maximum(peak, plant.output(job.commands[-1]).foot.peak_force)


def _flat(robot: Robot) -> Robot:
    """Returns the robot for a definition, whose ground on_grid sets."""
    return replace(robot, terrain=replace(robot.terrain, kind="flat", surface=None))


# ---- MuJoCo ----


class MuJoCo:
    """Runs jobs in MuJoCo, on the exported MJCF file, in the Python of the peers."""

    def __init__(self, tools: Tools) -> None:
        self.python = tools.python
        FOLDER.mkdir(parents=True, exist_ok=True)

    def run(self, job: Job, setting: Setting, *, timed: bool = True) -> Motion:
        """Runs a job. Raises DriverError."""
        model, file, out = (FOLDER / f"{job.name}{end}" for end in (".xml", ".npz", "-out.npz"))
        model.write_text(robot_to_mjcf(job.robot), encoding="utf-8")
        np.savez(file, allow_pickle=False, **_arrays(job))
        repeats = MOST_REPEATS if timed else 1
        words = [model, file, setting.method, repr(setting.value), repeats, out]
        script = Path(__file__).parent / "mujoco_ground.py"
        printed = json.loads(call([str(self.python), str(script), *map(str, words)]))
        with np.load(out) as found:
            return Motion(seconds=median(printed["seconds"]), **dict(found))


def _arrays(job: Job) -> dict[str, Any]:
    """Returns what mujoco_ground.py reads: the servos' positions contain kd speed_ref / kp."""
    lead = job.robot.servo.kd / job.robot.servo.kp
    at = job.start
    origin = at["position"] - rotation_matrix(at["quaternion"]) @ np.array(job.robot.torso.com)
    return {
        "ctrl": np.array([(one.angle_ref + lead * one.speed_ref).ravel() for one in job.commands]),
        "h": STEP,
        "qpos": np.concatenate([origin, at["quaternion"], at["angle"].ravel()]),
        "qvel": np.concatenate([at["velocity"], np.zeros(21)]),
        "names": np.array([f"{leg}_foot" for leg in LEG_NAMES]),
    }


# ---- measurements ----


def engines(tools: Tools) -> dict[str, OurEngine | MuJoCo]:
    """Returns the engines that can be run."""
    found: dict[str, OurEngine | MuJoCo] = {OURS: OurEngine(tools)}
    if MUJOCO not in tools.missing:
        found[MUJOCO] = MuJoCo(tools)
    return found


def walks_over_waves(tools: Tools, *, quick: bool) -> list[dict[str, Any]]:
    """Returns one record for each engine, setting and walk: error, time and foot forces."""
    found, present = [], engines(tools)
    for walk in family()[:1] if quick else family()[::EVERY]:
        job = on_waves(walk)
        exact = {
            name: engine.run(job, CONVERGED[name], timed=False) for name, engine in present.items()
        }
        found += [
            _measured(present, job, setting, exact[setting.engine])
            for setting in settings(quick=quick)
            if setting.engine in present
        ]
    return found


def _measured(
    present: Mapping[str, OurEngine | MuJoCo], job: Job, setting: Setting, exact: Motion
) -> dict[str, Any]:
    """Runs a job at a setting and compares it with the converged motion."""
    facts = {
        "engine": setting.engine,
        "method": f"{setting.method}{'' if setting.adaptive else '-fixed'}",
        "setting": setting.value,
        "walk": job.name,
    }
    weight = job.robot.weight
    try:
        motion = present[setting.engine].run(job, setting)
    except DriverError:
        bad = dict.fromkeys(("error", "seconds", "force_error", "peak"), math.inf)
        return facts | bad | {"exact_peak": float(exact.peak.max()) / weight}
    gap = motion.force - exact.force
    return facts | {
        "error": distance(motion.path, exact.path),  # m
        "seconds": motion.seconds,
        "force_error": float(np.sqrt(np.mean(gap * gap))) / weight,  # 1, RMS of a foot
        "peak": float(motion.peak.max()) / weight,  # 1
        "exact_peak": float(exact.peak.max()) / weight,
    }


def landings(tools: Tools) -> list[dict[str, Any]]:
    """Returns the rebound of the landing on plane and height field, by engine and step."""
    found = []
    for name, engine in engines(tools).items():
        for step in FORCE_STEPS:
            method = "rosw3" if name == OURS else "implicitfast"
            setting = Setting(engine=name, method=method, value=step)
            for field in (False, True):
                job = landing(field=field)
                motion = engine.run(job, setting, timed=False)
                found.append(
                    {
                        "engine": name,
                        "ground": "height field" if field else "plane",
                        "step": step,
                        "rebound": float(motion.speed.max()),  # m/s
                        "lowest": float(motion.path[:, 2].min()),  # m
                        "peak": float(motion.peak.max()) / job.robot.weight,  # 1
                    }
                )
    return found
