"""Shows whether metrics of the judged walk depend on sampling and on the assumed friction."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from measured import driven, integral, landing_rates, sampled, slipped

from hexapod_cosim.cosim.interface.names import joint_names
from hexapod_cosim.cosim.results.metrics import compute_metrics, shown_metrics
from hexapod_cosim.cosim.results.result import Result
from hexapod_cosim.cosim.results.walk import View
from hexapod_cosim.cosim.scenario.records import CONTROLS
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
    for control in CONTROLS:
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
    """Compares the plant's measures of the default walk with sums over samples of 0.1 ms."""
    rows: dict[str, list[str]] = {}
    for control in CONTROLS:
        settings = (f"control={control}", "duration=6")
        result = walk(*settings)
        part = judged(result)
        seen = sampled(result.scenario, result.outcome.recording, begin=1.4)
        later = seen.after(2.0)
        squares, load = integral(later.torque**2), part.weight * part.distance
        own = {
            "slip_per_metre": slipped(later, part.weight) / part.distance,
            "cost_of_transport": driven(later) / load,
            "torque_rms": float(np.sqrt(squares.mean() / part.duration)),
            "servo_load_max": float(np.sqrt(squares.max() / part.duration))
            / load_robot("athena").servo.torque_continuous,
            "peak_force": float(later.normal.max()) / part.weight,
            "loading_rate": float(
                np.percentile(landing_rates(seen, apart=0.5 * PERIOD, after=2.0), 95)
            )
            / part.weight,
        }
        for name, value in own.items():
            told = result.metrics[name]
            rows.setdefault(name, []).extend(
                [f"{told:.5g}", f"{value:.5g}", f"{100.0 * (told / value - 1.0):+.2f} %"]
            )
    headings = [
        f"{control}, {what}"
        for control in CONTROLS
        for what in ("the plant's", "of samples", "difference")
    ]
    return Shown(
        columns=("metric", *headings), rows=[(f"`{name}`", *row) for name, row in rows.items()]
    )


def work_by_step() -> Shown:
    """Shows the cost of transport by macro-step: the plant's, and from one sample per
    macro-step.
    """
    rows = []
    for control in CONTROLS:
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
        for control in CONTROLS
    }
    columns = ("metric", *(f"{law}: {control}" for law, control in runs))
    rows = [(heading(name), *figures(name, list(runs.values()))) for name in OF_FRICTION]
    return Shown(columns=columns, rows=rows)


RESULTS: Mapping[str, Callable[[], Shown]] = {
    "intervals": intervals, "samples": sampled_again, "works": work_by_step, "friction": friction,
}  # fmt: skip
