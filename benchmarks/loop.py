"""Measures the co-simulation: the whole loop, and the master on an FMU that computes nothing."""

from __future__ import annotations

import zipfile
from dataclasses import replace
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter

from benchmarks.toolchain import Tools
from hexapod_cosim.controller import BodyCommand, JointCommand, Measurement
from hexapod_cosim.cosim.design.gain_design import design_for
from hexapod_cosim.cosim.export.controller_export import export_controller
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.master.loop import run
from hexapod_cosim.cosim.master.recorder import Recorder
from hexapod_cosim.cosim.master.signals import Signals
from hexapod_cosim.cosim.run.single_run import make_plan, simulate
from hexapod_cosim.cosim.run.walker import Walker
from hexapod_cosim.cosim.scenario.scenario import load_scenario
from hexapod_cosim.cosim.scenario.schedule import make_schedule
from hexapod_cosim.models import load_robot

SCENARIO = "walk_flat"
REPEATS = 5


class Still:
    """A controller that commands nothing."""

    def __init__(self) -> None:
        self._command = JointCommand()

    def step(self, t: float, command: BodyCommand, measurement: Measurement) -> JointCommand:
        """Returns the same command in every step."""
        return self._command


def realtime_factor(tools: Tools, control: str) -> float:
    """Returns the real-time factor of plant and Python controller at a macro-step of 5 ms."""
    scenario = load_scenario(SCENARIO, overrides=[f"control={control}"])
    gains = (
        None
        if control == "kinematic"
        else design_for(load_robot(scenario.robot), scenario.macro_step)
    )
    return median(
        simulate(scenario, fmu=tools.fmu, gains=gains).outcome.realtime_factor
        for _ in range(REPEATS)
    )


def compiled_factors(tools: Tools) -> dict[str, float]:
    """Returns the real-time factors of plant FMU and compliant controller FMU, both loaded by fmpy:
    driven from Python in every macro-step, and by the loop in C.
    """
    scenario = load_scenario(SCENARIO, overrides=["control=compliant"])
    gains = design_for(load_robot(scenario.robot), scenario.macro_step)
    plan = make_plan(scenario, gains=gains)
    with TemporaryDirectory(prefix="hexapod-bench-") as folder:
        controller = export_controller(plan.controller, Path(folder) / "controller.fmu")
        driven = replace(scenario, control=str(controller))
        from_python = [
            simulate(driven, fmu=tools.fmu).outcome.realtime_factor for _ in range(REPEATS)
        ]
        with Walker(fmu=tools.fmu, controller=controller, everything=True) as walker:
            in_c = [
                walker.simulate(scenario, gains=gains).outcome.realtime_factor
                for _ in range(REPEATS)
            ]
    return {"loop through fmpy": median(from_python), "loop in C": median(in_c)}


def master_overhead(tools: Tools) -> float:
    """Returns the time per macro-step of fmpy's calls and the recording alone [us]."""
    scenario = load_scenario(SCENARIO)
    schedule = make_schedule(scenario)
    with TemporaryDirectory(prefix="hexapod-bench-") as folder:
        idle = _idle_fmu(Path(folder), tools)
        with Fmu(idle) as plant:
            plant.initialise(0.0, scenario.duration)
            walls = []
            for _ in range(REPEATS):
                signals = Signals(plant)
                recorder = Recorder(signals, schedule.times, schedule.rows)
                begin = perf_counter()
                run(plant, signals, Still(), schedule, recorder, h=scenario.macro_step)
                walls.append(perf_counter() - begin)
    return 1e6 * median(walls) / scenario.steps


def _idle_fmu(folder: Path, tools: Tools) -> Path:
    """Writes the FMU with a binary that does nothing and returns its path."""
    idle = folder / "idle.fmu"
    library = next(tools.native.glob("libbench_idle_fmu.*"))
    with zipfile.ZipFile(tools.fmu) as source, zipfile.ZipFile(idle, "w") as target:
        for name in source.namelist():
            target.writestr(
                name, library.read_bytes() if name.startswith("binaries/") else source.read(name)
            )
    return idle
