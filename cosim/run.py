"""One co-simulation from scenario to figures: robot, plant FMU, controller, master, metrics."""

from __future__ import annotations

import hashlib
import math
import platform
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from hexapod_cosim.controller import Controller, Gains, make_gait
from hexapod_cosim.cosim.export import export_fmu
from hexapod_cosim.cosim.fmu import Fmu
from hexapod_cosim.cosim.interface import load_interface
from hexapod_cosim.cosim.master import COMPLETED, Outcome, Progress, insides, run
from hexapod_cosim.cosim.metrics import View, compute_metrics, cut_walk
from hexapod_cosim.cosim.plant_files import package_version
from hexapod_cosim.cosim.recorder import Recorder, Recording, chosen_columns
from hexapod_cosim.cosim.scenario import scenario_robot
from hexapod_cosim.cosim.scenario_records import Scenario
from hexapod_cosim.cosim.schedule import make_schedule
from hexapod_cosim.cosim.signals import Signals, joint_names
from hexapod_cosim.models import LEG_NAMES, FmuError, Robot, load_robot

BODY_PARAMETERS = ("torso.", "foot.", *(f"{leg}." for leg in LEG_NAMES))  # these make the robot; the rest are settings
SAME = 1e-9  # relative, of a parameter printed and read again
UPRIGHT = 0.6  # rad    of roll or pitch: beyond it the robot has fallen


@dataclass(frozen=True, kw_only=True)
class Result:
    """A run and what came of it."""

    scenario: Scenario
    outcome: Outcome
    metrics: Mapping[str, float]
    parameters: Mapping[str, float]  # of the FMU, as run
    facts: Mapping[str, Any]  # robot, FMU, versions, warnings

    @property
    def completed(self) -> bool:
        return self.outcome.status == COMPLETED


def simulate(scenario: Scenario, *, fmu: Path | None = None, gains: Gains | None = None, progress: Progress | None = None) -> Result:
    """Runs a scenario on the robot's own FMU, exported for it, or on a given one; compliant gains are designed when not given.

    Raises HexapodError for anything that keeps the run from starting; how a run that started ended is in the result.
    """
    robot = load_robot(scenario.robot)
    gait = make_gait(robot, **dict(scenario.settings.get("gait", {})))
    if scenario.control == "kinematic":
        gains = None
    elif gains is None:
        from hexapod_cosim.controller.design import design_gains  # noqa: PLC0415  python-control takes a second to import

        gains = design_gains(robot, period=scenario.macro_step)
    controller = Controller(robot, period=scenario.macro_step, gait=gait, gains=gains)
    schedule = make_schedule(scenario)
    with open_plant(scenario, fmu) as plant:
        plant.set_parameters(scenario.parameters)
        plant.initialise(scenario.start, scenario.start + scenario.duration)
        parameters = plant.parameters()
        signals = Signals(plant, noise=scenario.sensors.foot_force_noise, seed=scenario.seed)
        recorder = Recorder(signals, schedule.times, schedule.rows, extra=insides(controller))
        chosen_columns(recorder.names, scenario.outputs.csv)  # a misspelt column is told before the run, not after it
        outcome = run(plant, signals, controller, schedule, recorder, h=scenario.macro_step, progress=progress)
        facts = describe(robot, plant, gait.period) | {"warnings": [*controller.warnings, *doubts(outcome.recording, robot)]}
    view = View(outcome.recording, parameters, gait.period)
    metrics = compute_metrics(view, realtime_factor=outcome.realtime_factor)
    facts["walk"] = describe_walk(view)
    return Result(scenario=scenario, outcome=outcome, metrics=metrics, parameters=parameters, facts=facts)


@contextmanager
def open_plant(scenario: Scenario, path: Path | None = None) -> Iterator[Fmu]:
    """The FMU of a scenario, its settings in place: exported for the occasion, or a given one that must hold the same robot."""
    robot = scenario_robot(scenario)
    if path is not None:
        with Fmu(path) as plant:
            adopt_settings(plant, robot)
            yield plant
        return
    with TemporaryDirectory(prefix="hexapod-") as folder:
        exported = Path(folder) / f"{robot.name}.fmu"
        export_fmu(robot, exported)
        with Fmu(exported) as plant:
            yield plant


def adopt_settings(plant: Fmu, robot: Robot) -> None:
    """Sets the laws and settings of a given FMU to those of the robot. Raises FmuError when the FMU holds another robot."""
    wanted = {
        entry.name: entry.start for entry in load_interface(robot).variables if entry.causality == "parameter" and entry.start is not None
    }
    present = plant.parameters()
    changes = {
        name: value
        for name, value in wanted.items()
        if name in present and not math.isclose(present[name], value, rel_tol=SAME, abs_tol=SAME**2)
    }
    for name, value in changes.items():
        if name.startswith(BODY_PARAMETERS):
            fix = "export one of this robot with `hexapod export --robot`, or name the FMU's robot in the scenario"
            expected = f"{value:g}, as robot {robot.name!r} has"
            raise FmuError(f"the FMU holds another robot: {name}", got=present[name], expected=expected, fix=fix, where=str(plant.path))
    plant.set_parameters(changes)


def describe(robot: Robot, plant: Fmu, period: float) -> dict[str, Any]:
    """What is needed to say which robot, FMU and software made a run."""
    names = ("fmpy", "numpy", "scipy", "control")
    return {
        "robot": {"name": robot.name, "hash": robot.hash},
        "gait_period": period,
        "fmu": {"file": plant.path.name, "guid": plant.description.guid, "sha256": hashlib.sha256(plant.path.read_bytes()).hexdigest()},
        "versions": {"hexapod-cosim": package_version(), "python": platform.python_version(), **{name: version(name) for name in names}},
        "platform": f"{sys.platform} {platform.machine()}",
    }


def describe_walk(view: View) -> dict[str, Any]:
    """Distance [m] and mean speed [m/s] over the judged cycles (NaN when none was walked), and whether the robot stayed upright."""
    walk = cut_walk(view)
    distance = walk.distance if walk else math.nan
    lasted = float(walk.recording.time[-1] - walk.recording.time[0]) if walk else math.nan
    return {"distance": distance, "mean_speed": distance / lasted, "upright": is_upright(view.recording)}


def is_upright(recording: Recording) -> bool:
    """Whether roll and pitch stayed within bounds."""
    return bool(np.all(np.abs(recording.columns(["torso.roll", "torso.pitch"])) < UPRIGHT))


def doubts(recording: Recording, robot: Robot) -> list[str]:
    """What a reader of the results should know: a fall, legs out of reach, servos hotter than they may be for long."""
    found = [] if is_upright(recording) else [f"the robot fell: roll or pitch beyond {UPRIGHT} rad"]
    unreachable = [f"controller.{leg}.unreachable" for leg in LEG_NAMES]
    if len(recording.time) and set(unreachable) <= set(recording.names):
        share = float(np.mean(recording.columns(unreachable).max(axis=1)))
        found += [f"a foot was out of its leg's reach for {share:.1%} of the time"] if share else []
    if len(recording.time):
        torque = np.sqrt(np.mean(recording.columns(joint_names("torque")) ** 2, axis=0))
        worst, limit = int(np.argmax(torque)), robot.servo.torque_continuous
        name = joint_names("torque")[worst].removesuffix(".torque")
        found += (
            [f"servo {name} works at {torque[worst]:.2f} N m RMS, above the {limit:g} N m it bears for long"]
            if torque[worst] > limit
            else []
        )
    return found
