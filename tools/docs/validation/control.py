"""Compares both controls: touch-downs, turns, pushes, wrong models, other worlds."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from matplotlib.figure import Figure
from test_conditions import WORLDS
from test_controller_continuity import LARGEST, steepest

from hexapod_cosim.cosim.master.signals import COMMANDED
from hexapod_cosim.cosim.results.result import Result
from hexapod_cosim.cosim.scenario.records import COMPARED
from tools.docs.validation.shown import PALETTE, Shown
from tools.docs.validation.walked import (
    MILLI,
    changed,
    judged,
    shown,
    under_both,
)

PERIODS = (0.001, 0.002, 0.005)  # s
LEG, JOINT = "LM", "femur"  # the most loaded joint of a tripod
BY_HAND = tuple(LARGEST)  # robots of the tests
TURN = "command={yaw_rate=0.3}"
PUSH = "events=[{time=4, duration=0.5, torque=[0, 0, 8]}]"
UNKNOWN = {  # what the plant has and its controller does not know -> settings
    "as modelled": (),
    "ground 100 times softer": ("parameters.contact.stiffness=1.07e4",),
    "torso of 10 kg": ("parameters.torso.mass=10",),
    "torso of 14 kg": ("parameters.torso.mass=14",),
}
PLAIN = {  # figures of tests/cosim/test_controller_walks.py -> heading, factor
    "slip_per_metre": ("slip [m/m]", 1.0), "height_rms": ("height [mm]", MILLI),
    "roll_rms": ("roll [mrad]", MILLI), "pitch_rms": ("pitch [mrad]", MILLI),
    "peak_force": ("peak force [BW]", 1.0),
}  # fmt: skip
OF_WORLDS = {
    "slip_per_metre": "slip [m/m]", "peak_force": "peak force [BW]",
    "cost_of_transport": "cost of transport",
}  # fmt: skip
GRAVITY = {"earth": 9.81} | WORLDS  # m/s2


def touch_down() -> Shown:
    """Shows the feed-forward torque and the slip of the judged walk by control period."""
    walks = {period: under_both(f"macro_step={period}") for period in PERIODS}

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for k, (period, (_, compliant)) in enumerate(walks.items()):
            part = judged(compliant).recording
            rows = part.time <= part.time[0] + compliant.facts.gait_period
            torque = part.column(f"{LEG}.{JOINT}.torque_ref")[rows]
            label = f"{MILLI * period:g} ms"
            style = {"color": PALETTE[k], "label": label, "linewidth": 1.0}
            axes.step(part.time[rows], torque, where="post", **style)
        axes.set(xlabel="time [s]", ylabel=f"torque_ref of {LEG}.{JOINT} [N m]")
        axes.legend(title="control period", ncols=3)

    rows = []
    for period, pair in walks.items():
        largest, steps = zip(*map(_torques, pair), strict=True)
        alone = [steepest(name, "tripod", period) for name in BY_HAND]
        slips = (run.metrics["slip_per_metre"] for run in pair)
        cells = (*map(changed, (slips, largest, steps)), ", ".join(map(shown, alone)))
        rows.append((f"{MILLI * period:g} ms", *cells))
    return Shown(
        columns=(
            "control period", "slip [m/m]", "largest torque_ref [N m]",
            "its largest change in a period [N m]",
            f"the same, controller alone: {', '.join(BY_HAND)} [N m]",
        ),
        rows=rows, draw=draw, size=(7.6, 2.8),
        alt="Feed-forward torque of a femur over a gait cycle: the same curve at all three periods",
    )  # fmt: skip


def _torques(result: Result) -> tuple[float, float]:
    """Returns the largest torque_ref of the judged walk, and its largest change between rows.

    Both are in N m.
    """
    torque = judged(result).recording.columns(COMMANDED["torque_ref"])
    return float(np.abs(torque).max()), float(np.abs(np.diff(torque, axis=0)).max())


def yaw() -> Shown:
    """Shows a turn on the spot and a push about the vertical."""
    rows = []
    for title, metric, scale, settings in (
        ("turning at 0.3 rad/s: pitch RMS [mrad]", "pitch_rms", MILLI, (TURN,)),
        ("the same: slip [m/rad]", "slip_per_radian", 1.0, (TURN,)),
        ("walking, pushed by 8 N m for 0.5 s: peak force [BW]", "peak_force", 1.0, (PUSH,)),
        ("walking, not pushed: peak force [BW]", "peak_force", 1.0, ()),
    ):
        runs = under_both(*settings)
        rows.append((title, *(shown(scale * run.metrics[metric]) for run in runs)))
    return Shown(columns=("", *COMPARED), rows=rows)


def model_errors() -> Shown:
    """Shows walks of plants that differ from the controller's model."""
    pairs = [under_both(*settings) for settings in UNKNOWN.values()]
    rows = [
        (title, *(changed(scale * run.metrics[name] for run in pair) for pair in pairs))
        for name, (title, scale) in PLAIN.items()
    ]  # fmt: skip
    shares = (pair[1].facts.walk.fallback for pair in pairs)
    rows.append(("fallback, compliant [%]", *(f"{100.0 * share:.0f}" for share in shares)))
    return Shown(columns=("the plant", *UNKNOWN), rows=rows)


def worlds() -> Shown:
    """Shows the judged walk under other gravities, which plant and controller use."""
    rows = []
    for world, gravity in GRAVITY.items():
        pair = under_both(scenario=world if world in WORLDS else "walk_flat")
        part = judged(pair[1])
        cells = (changed(run.metrics[name] for run in pair) for name in OF_WORLDS)
        rows.append((world, f"{gravity:.2f}", f"{part.weight:.1f}", *cells))
    headings = ("world", "gravity [m/s²]", "weight [N]")
    return Shown(columns=(*headings, *OF_WORLDS.values()), rows=rows)


RESULTS: Mapping[str, Callable[[], Shown]] = {
    "touch-down": touch_down, "yaw": yaw, "model-errors": model_errors, "worlds": worlds,
}  # fmt: skip
