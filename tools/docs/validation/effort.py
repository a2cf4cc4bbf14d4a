"""Shows deviations of the feet from their plan, use of the friction cone, and servo loads."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from matplotlib.figure import Figure

from hexapod_cosim.cosim.interface.names import joint_names
from hexapod_cosim.cosim.results.metrics import planned_feet
from hexapod_cosim.cosim.results.result import Result
from hexapod_cosim.cosim.results.walk import Array, real_feet
from hexapod_cosim.cosim.scenario.records import COMPARED
from hexapod_cosim.models import JOINT_NAMES, LEG_NAMES, load_robot
from tools.docs.validation.shown import PALETTE, Shown
from tools.docs.validation.walked import MILLI, judged, shown, under_both, view

ROBOTS = {"athena": "ATHENA-like", "phantomx_mk4": "PhantomX Mark 4"}
LEGS = ("LM", "LR")  # whose feet are shown
FINE = "macro_step=0.001"  # distributions over time depend on it


def feet() -> Shown:
    """Shows planned and real feet in the torso's frame."""
    pairs = {title: under_both(f"robot={name}") for name, title in ROBOTS.items()}

    def draw(figure: Figure) -> None:
        panels = figure.subplots(1, len(LEGS), sharey=True)
        for axes, leg in zip(panels, LEGS, strict=True):
            number = LEG_NAMES.index(leg)
            for k, (name, result) in enumerate(zip(COMPARED, pairs[ROBOTS["athena"]], strict=True)):
                last = view(result).last_cycles()
                if not k:
                    x, z = MILLI * planned_feet(last.recording)[:, number, [0, 2]].T
                    axes.plot(x, z, color="0.6", linewidth=3.0, label="planned")
                x, z = MILLI * real_feet(last.recording, last.parameters)[:, number, [0, 2]].T
                axes.plot(x, z, color=PALETTE[k], linewidth=1.0, label=name)
            axes.set(title=leg, xlabel="x, torso frame [mm]")
        panels[0].set_ylabel("z [mm]")
        panels[0].legend()

    rows = [
        (f"{title}, {where}", *(shown(MILLI * run.metrics[metric]) for run in pair))
        for title, pair in pairs.items()
        for where, metric in (("stance", "foot_error_stance"), ("swing", "foot_error_swing"))
    ]
    return Shown(
        columns=("feet off the plan, RMS [mm]", *COMPARED), rows=rows, draw=draw, size=(7.6, 3.0),
        alt="Paths of two feet from the side: compliant control keeps to the plan, the other sags",
    )  # fmt: skip


COSTS = {
    "cost_of_transport": "cost of transport", "electrical_cost": "electrical cost",
    "servo_load_max": "hottest servo, load", "cone_use_p50": "friction cone, median",
    "cone_use_p95": "95 %", "cone_use_over_90": "time above 90 % of it [%]",
}  # fmt: skip


def servos() -> Shown:
    """Shows the load of each servo, costs, and use of the friction cone."""
    pairs = {name: under_both(f"robot={name}", FINE) for name in ROBOTS}
    loads = {name: [_loads(name, run) for run in pair] for name, pair in pairs.items()}
    places = np.arange(len(LEG_NAMES) * len(JOINT_NAMES))

    def draw(figure: Figure) -> None:
        panels = figure.subplots(len(ROBOTS), 1, sharex=True, sharey=True)
        for axes, (name, pair) in zip(panels, loads.items(), strict=True):
            for k, (control, load) in enumerate(zip(COMPARED, pair, strict=True)):
                axes.bar(places + 0.4 * k - 0.2, load, 0.38, color=PALETTE[k], label=control)
            axes.axhline(1.0, color="0.5", linewidth=1.0)
            axes.grid(visible=False, axis="x")
            axes.set(title=ROBOTS[name], ylabel="RMS torque / rating")
        panels[0].legend(ncols=2)
        names = [f"{leg} {joint}" for leg in LEG_NAMES for joint in JOINT_NAMES]
        panels[-1].set_xticks(places, names, rotation=60, ha="right")
        panels[-1].set_xlim(-0.6, len(places) - 0.4)

    rows = []
    for name, pair in pairs.items():
        for control, run in zip(COMPARED, pair, strict=True):
            values = [run.metrics[metric] for metric in COSTS]
            cells = [*(shown(value) for value in values[:-1]), shown(100.0 * values[-1])]
            rows.append((f"{ROBOTS[name]}, {control}", *cells))
    return Shown(
        columns=("", *COSTS.values()), rows=rows, draw=draw, size=(7.6, 4.6),
        alt="Load of each of 18 servos over its rating, under both controls, for two robots",
    )  # fmt: skip


def _loads(name: str, result: Result) -> Array:
    """Returns the load of all servos in the judged walk, RMS torque over rating (18,)."""
    walk = judged(result)
    mean = walk.gained(joint_names("torque_squared")) / walk.duration  # N2 m2
    return np.asarray(np.sqrt(mean) / load_robot(name).servo.torque_continuous)


RESULTS: Mapping[str, Callable[[], Shown]] = {"feet": feet, "servos": servos}
