"""Shows the residual of the energy balance, by tolerance and for every shipped scenario."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from matplotlib.figure import Figure

from hexapod_cosim.cosim.export.plant_export import export_fmu
from hexapod_cosim.cosim.interface.names import joint_names
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.run.single_run import simulate
from hexapod_cosim.cosim.run.walker import Walker
from hexapod_cosim.cosim.scenario.records import COMPARED
from hexapod_cosim.cosim.scenario.scenario import load_scenario
from hexapod_cosim.cosim.scenario.tables import list_scenarios
from hexapod_cosim.models import load_robot
from tools.docs.validation.shown import PALETTE, Shown, short
from tools.docs.validation.walked import changed

TOLERANCES = (1e-1, 1e-2, 1e-4, 1e-6)
DURATION = 4.0  # s
GROSS_WORK = [*joint_names("positive_work"), *joint_names("negative_work")]  # J
LEAST = 1e-12  # of the work: below it the residual is rounding
HELD = ("drop",)  # scenarios with held joints, which have no compliant control


def _recordings() -> dict[float, Recording]:
    with TemporaryDirectory() as folder:
        fmu = export_fmu(load_robot("athena"), Path(folder) / "athena.fmu")
        plans = {
            one: load_scenario(
                "walk_flat", overrides=[f"duration={DURATION}", f"solver.tolerance={one}"]
            )
            for one in TOLERANCES
        }
        return {one: simulate(plan, fmu=fmu).outcome.recording for one, plan in plans.items()}


def books() -> Shown:
    """Shows the residual of one walk at several tolerances."""
    walks = {}
    for tolerance, recording in _recordings().items():
        work = float(recording.columns(GROSS_WORK)[-1].sum())
        walks[tolerance] = (
            recording.time,
            np.abs(recording.column("energy.residual")) / work,
            recording.column("solver.evaluations")[-1],
        )

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for k, (tolerance, (time, share, _)) in enumerate(walks.items()):
            axes.semilogy(
                time[1:],
                np.maximum(share[1:], LEAST),
                color=PALETTE[k],
                label=f"tolerance {tolerance:g}",
                linewidth=1.1,
            )
        axes.set(xlabel="time [s]", ylabel="residual / the motors' gross work")
        axes.legend(ncols=2)

    rows = [
        (f"{tolerance:g}", f"{evaluations:.0f}", short(float(share[-1])))
        for tolerance, (_, share, evaluations) in walks.items()
    ]
    return Shown(
        columns=(
            "solver.tolerance",
            "evaluations",
            f"residual over the motors' gross work after {DURATION:g} s",
        ),
        rows=rows,
        draw=draw,
        alt="The energy residual of a walk over time: it falls with the tolerance",
    )


SOLVERS = {"default": (), "ros2 at 0.1": ("solver.method=ros2", "solver.tolerance=0.1")}
OTHER = "robot=phantomx_mk4"
FAST = ("gait.period=0.5", "command.vx=0.15")  # on the torque-speed line
COARSE = ("solver.method=rk4", "solver.step=1e-3")


def scenarios() -> Shown:
    """Shows energy_residual of every shipped scenario, a fast walk, and a step that is too
    coarse.
    """
    with Walker() as walker:

        def residuals(name: str, *settings: str) -> str:
            controls = [f"control={each}" for each in COMPARED]
            plans = [load_scenario(name, overrides=[each, *settings]) for each in controls]
            runs = [walker.simulate(plan) for plan in plans]
            return changed((run.metrics["energy_residual"] for run in runs), form=short)

        def row(name: str, *settings: str) -> list[str]:
            return [residuals(name, *settings, *more) for more in SOLVERS.values()]

        rows = [
            [name, *row(name), residuals(name, OTHER)]
            for name in list_scenarios()
            if name not in HELD
        ]
        rows.append(["walk_flat, 0.15 m/s, gait period 0.5 s", *row("walk_flat", *FAST), ""])
        rows.append(["stand, rk4 at 1 ms", residuals("stand", *COARSE), "", ""])
    return Shown(columns=("kinematic → compliant", *SOLVERS, "PhantomX, default"), rows=rows)
