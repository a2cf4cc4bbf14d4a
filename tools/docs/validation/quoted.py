"""Shows whether metrics of the judged walk depend on sampling and on the assumed friction."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from measured import repeated, sampled_metrics

from hexapod_cosim.cosim.interface.names import joint_names
from hexapod_cosim.cosim.results.metrics import compute_metrics, shown_metrics
from hexapod_cosim.cosim.results.result import Result
from hexapod_cosim.cosim.results.walk import View
from hexapod_cosim.cosim.scenario.records import COMPARED
from hexapod_cosim.models import load_robot
from tools.docs.validation.shown import Shown
from tools.docs.validation.walked import figures, heading, judged, walk

PERIOD = 1.0  # s    of the judged walk's gait
FINE_STEP, COARSE = 0.001, 0.02  # s
OF_THE_LOOP = "realtime_factor"
LAWS = {  # friction -> settings
    "tanh, 100 s/m": (),
    "tanh, 1000 s/m": ("friction.slope=1000",),
    "bristle": ("friction.law=bristle",),
}
OF_FRICTION = (
    "slip_per_metre",
    "cone_use_p50",
    "cone_use_p95",
    "foot_error_stance",
    "roll_rms",
    "peak_force",
    "cost_of_transport",
    "electrical_cost",
    "servo_load_max",
)


def intervals() -> Shown:
    """Shows every metric with rows 1 ms and 20 ms apart: of the run, and of the recorded rows
    alone.
    """
    columns = ["metric"]
    cells: dict[str, list[str]] = {}
    for control in COMPARED:
        at = (f"control={control}", f"macro_step={FINE_STEP}")
        every, coarse = walk(*at), walk(*at, f"outputs.interval={COARSE}")
        view = View(coarse.outcome.recording, coarse.parameters, PERIOD)
        alone = compute_metrics(view, servo=load_robot("athena").servo, realtime_factor=np.nan)
        columns += [f"{control}, rows 1 ms apart", "20 ms", "20 ms, of these rows alone"]
        names = [
            name
            for name in shown_metrics({"": every.metrics}, net_slip=False)
            if name != OF_THE_LOOP
        ]
        for name in names:
            value = every.metrics[name]
            cells.setdefault(name, []).extend(
                [f"{value:.4g}", _gap(coarse.metrics[name], value), _gap(alone[name], value)]
            )
    return Shown(columns=columns, rows=[(f"`{name}`", *row) for name, row in cells.items()])


def _gap(value: float, reference: float) -> str:
    """Formats the relative difference in per cent."""
    if not np.isfinite(value / reference if reference else np.nan):
        return "" if value == reference else "-"
    share = 100.0 * (value / reference - 1.0)
    return f"{share:+.2g} %" if share else "0 %"


def sampled_again() -> Shown:
    """Compares the plant's measures with sums over samples of 0.1 ms of the same motion, and with
    the judged walk, whose motion differs by the solver's error.
    """
    servo, rows = load_robot("athena").servo, []
    for control in COMPARED:
        result = walk(f"control={control}", "duration=6")
        again = repeated(result.scenario, result.outcome.recording, begin=1.4)
        seen = View(again.recording, result.parameters, PERIOD)
        assert seen.walk is not None
        mu = result.parameters["friction.mu"]
        own = sampled_metrics(again.samples, seen.walk, servo, mu=mu)
        measured = compute_metrics(seen, servo=servo, realtime_factor=np.nan)
        for name, value in own.items():
            plant_value, walk_value = measured[name], result.metrics[name]
            values = (f"{each:.5g}" for each in (walk_value, plant_value, value))
            gaps = (_gap(plant_value, value), _gap(walk_value, plant_value))
            rows.append((f"`{name}`", control, *values, *gaps))
    columns = (
        "metric", "control", "judged walk", "sampled run: the plant's", "of samples",
        "plant's against samples", "judged walk against sampled run",
    )  # fmt: skip
    return Shown(columns=columns, rows=rows)


def work_by_step() -> Shown:
    """Shows the cost of transport by macro-step: the plant's, and from one sample per
    macro-step.
    """
    rows = []
    for control in COMPARED:
        cells = []
        for step in (0.02, 0.005, 0.001):
            result = walk(f"control={control}", f"macro_step={step}", "duration=4")
            cells.append(f"{result.metrics['cost_of_transport']:.3f} ({_sampled_cost(result):.3f})")
        rows.append((control, *cells))
    return Shown(columns=("cost of transport (of samples)", "20 ms", "5 ms", "1 ms"), rows=rows)


def _sampled_cost(result: Result) -> float:
    """Returns the cost of transport computed from the rows at macro-steps."""
    part = judged(result)
    power = np.maximum(
        part.recording.columns(joint_names("torque"))
        * part.recording.columns(joint_names("speed")),
        0.0,
    ).sum(axis=1)
    return float(part.weights @ power) * part.duration / (part.weight * part.distance)


def friction() -> Shown:
    """Shows the judged walk with three laws of friction."""
    runs = {
        (law, control): walk(f"control={control}", *settings)
        for law, settings in LAWS.items()
        for control in COMPARED
    }
    columns = ("metric", *(f"{law}: {control}" for law, control in runs))
    rows = [(heading(name), *figures(name, list(runs.values()))) for name in OF_FRICTION]
    return Shown(columns=columns, rows=rows)


RESULTS: Mapping[str, Callable[[], Shown]] = {
    "intervals": intervals, "samples": sampled_again, "works": work_by_step, "friction": friction,
}  # fmt: skip
