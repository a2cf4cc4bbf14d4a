"""Shows the lag of kinematic drives with and without the planned acceleration."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.master.signals import ACCELERATION, COMMANDED
from hexapod_cosim.cosim.results.metrics import compute_metrics
from hexapod_cosim.cosim.results.result import Result
from hexapod_cosim.cosim.run.single_run import initialise_plant, make_plan, open_plant
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.models import load_robot
from tools.docs.validation.shown import Shown
from tools.docs.validation.walked import MILLI, judged, shown, view, walk

METRICS = ("slip_per_metre", "path_error", "foot_error_stance", "foot_error_swing")
HEADINGS = (
    "slip [m/m]", "path error [m/m]", "feet off the plan [mm]: standing", "swinging",
)  # fmt: skip


def lag() -> Shown:
    """Shows the judged walk of a robot with kinematic drives, under kinematic control."""
    planned = walk("servo.mode=kinematic", "duration=6")
    rows = [_row("planned", planned), _row("0", _without_accelerations(planned))]
    columns = ("acceleration_ref", "largest lag of a joint [mrad]", "RMS [mrad]", *HEADINGS)
    return Shown(columns=columns, rows=rows)


def _row(name: str, result: Result) -> tuple[str, ...]:
    part = judged(result).recording
    behind = part.joints("angle")[1:-1] - part.joints("angle_ref")[1:-1]
    values = [MILLI * np.abs(behind).max(), MILLI * np.sqrt(np.mean(behind**2))]
    values += [result.metrics[metric] for metric in METRICS[:2]]
    values += [MILLI * result.metrics[metric] for metric in METRICS[2:]]
    return name, *(shown(float(value)) for value in values)


def _without_accelerations(result: Result) -> Result:
    """Repeats the commands of a run without the accelerations."""
    recording = _driven(result.scenario, result.outcome.recording)
    again = replace(result, outcome=replace(result.outcome, recording=recording, every_step=None))
    servo = load_robot(result.scenario.robot).servo
    return replace(again, metrics=compute_metrics(view(again), servo=servo, realtime_factor=np.nan))


def _driven(scenario: Scenario, recording: Recording) -> Recording:
    data, h = recording.data.copy(), scenario.macro_step
    joints = [name for names in COMMANDED.values() for name in names]
    commands = recording.columns(joints)
    data[:, [recording.names.index(name) for name in ACCELERATION]] = 0.0
    with open_plant(scenario) as plant:
        initialise_plant(plant, make_plan(scenario))
        inputs, blocks = plant.block(joints), []
        for names in (plant.names("output"), plant.names("output", "Boolean")):
            kept = [name for name in names if name in recording.names]
            places = [recording.names.index(name) for name in kept]
            blocks.append((plant.block(kept), places))
        for k in range(len(data)):
            for block, places in blocks:
                block.get()
                data[k, places] = block.values
            if k + 1 < len(data):
                inputs.values[:] = commands[k]
                inputs.set()
                plant.step(k * h, h)
    return Recording(recording.names, data)


RESULTS: Mapping[str, Callable[[], Shown]] = {"lag": lag}
