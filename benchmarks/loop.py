"""Measures the whole co-simulation against real time."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from benchmarks.toolchain import Tools
from hexapod_cosim.cosim.design.gains import design_for
from hexapod_cosim.cosim.export.plant import export_controller
from hexapod_cosim.cosim.run.plan import make_plan
from hexapod_cosim.cosim.run.runner import Runner
from hexapod_cosim.cosim.run.single_run import simulate
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.models import load_robot

SCENARIO = "walk_flat"
REPEATS = 5


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
        with Runner(fmu=tools.fmu, controller=controller, everything=True) as runner:
            in_c = [
                runner.simulate(scenario, gains=gains).outcome.realtime_factor
                for _ in range(REPEATS)
            ]
    return {"loop through fmpy": median(from_python), "loop in C": median(in_c)}
