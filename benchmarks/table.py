"""Builds the table of results: our figure, each peer's, their ratio, the goal."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

from benchmarks.judge import Choice, best, per_evaluation, spreads
from benchmarks.measure import Run
from benchmarks.series import DRAKE_LAW, MUJOCO_LAW, OURS, PLANT_LAW, Series
from benchmarks.studies import Studies

FINE, FINER = 1e-3, 1e-5  # m    errors at which engines are compared
KERNEL_GOALS = {"avx512": 0.62, "avx2": 0.85, "baseline": 1.3}  # us
MULTIPLIERS_GOAL = 0.1  # of the evaluation
PINOCCHIO_GOAL, PEERS_GOAL, OWN_CONTACT_GOAL = 8.0, 40.0, 10.0  # times faster
REALTIME_GOALS = {FINE: 2200.0, FINER: 600.0}
WORST_GOAL = 1200.0  # times real time, at FINE
STEEP_GOAL = 2.0  # times the default's cost
LOOP_GOALS = {"kinematic": 40.0, "compliant": 20.0}  # times real time
COMPILED_GOAL = 150.0  # times real time
MANY_GOAL = 0.97  # of one plant's rate
WALKS_GOALS = {"default solver": 3500.0, "fast solver": 6500.0}  # per minute
COMPARISON_GOAL, GAINS_GOAL = 7.0, 1.0  # s
MEMORY_GOAL, GROWTH_GOAL = 65536.0, 98304.0  # bytes
OWN_CONTACT = ("own-implicitfast", 1e-3)  # what MuJoCo's users run


@dataclass(frozen=True, kw_only=True)
class Row:
    """One line of the table; NaN means missing. `better` is the good side of the goal."""

    figure: str
    unit: str
    ours: float = math.nan
    peer: str = ""
    theirs: float = math.nan
    ratio: float = math.nan
    goal: float = math.nan
    judged: str = "ours"  # what the goal is for: ours, or ratio
    better: str = "less"  # or "more"

    @property
    def met(self) -> bool | None:
        """Whether the goal is met; None without a goal or a figure."""
        value = self.ratio if self.judged == "ratio" else self.ours
        if math.isnan(self.goal) or math.isnan(value):
            return None
        return value <= self.goal if self.better == "less" else value >= self.goal


@dataclass(frozen=True, kw_only=True)
class Parts:
    """Measurements other than those of the walks."""

    derivatives: dict[str, dict[str, float]]
    steep: dict[str, float]  # cost over the default's, by what is steep
    loop: dict[str, float]  # real-time factor, by control
    compiled: dict[str, float]  # of compliant control compiled, by what drives the FMUs
    crowd: float  # 1    time of a step among many plants, over that of one plant alone
    studies: Studies
    structure: float  # bytes
    resident: float  # bytes
    allocations: float
    instructions: dict[str, float] = field(default_factory=dict)
    walk_instructions: float = math.nan


def rows(runs: Sequence[Run], series: Sequence[Series], parts: Parts) -> list[Row]:
    """Returns all rows of the table."""
    return [
        *_evaluation(runs, parts),
        *_walking(runs, series),
        *_own_contact(runs, series),
        *_many(runs, series, parts),
        *_studies(parts.studies),
        *_rest(parts),
    ]


def goals(found: Sequence[Row]) -> list[Row]:
    """Returns the rows that have a goal."""
    return [row for row in found if not math.isnan(row.goal)]


def _evaluation(runs: Sequence[Run], parts: Parts) -> Iterable[Row]:
    for kernel, goal in KERNEL_GOALS.items():
        times = parts.derivatives.get(kernel, {})
        plain, full = times.get("plain", math.nan), times.get("multipliers", math.nan)
        yield Row(figure=f"right-hand side, {kernel}", unit="us", ours=plain, goal=goal)
        yield Row(
            figure=f"the same with all multipliers, {kernel}: extra",
            unit="1",
            ours=full / plain - 1.0,
            goal=MULTIPLIERS_GOAL,
        )
    fastest = min((times["plain"] for times in parts.derivatives.values()), default=math.nan)
    peers = [
        ("pinocchio", PLANT_LAW),
        ("mujoco", PLANT_LAW),
        ("mujoco", MUJOCO_LAW),
        ("drake", DRAKE_LAW),
    ]
    for engine, law in peers:
        theirs = per_evaluation(runs, engine, law)
        goal = PINOCCHIO_GOAL if engine == "pinocchio" else math.nan
        name = engine if law == PLANT_LAW else f"{engine}, its own contact"
        yield Row(
            figure="right-hand side against",
            unit="us",
            ours=fastest,
            peer=name,
            theirs=theirs,
            ratio=theirs / fastest,
            goal=goal,
            judged="ratio",
            better="more",
        )


def _walking(runs: Sequence[Run], series: Sequence[Series]) -> Iterable[Row]:
    """Yields, for each error, ours and every peer: first all walks within it, then the median
    walk.
    """
    mine = [one for one in series if one.engine == OURS]
    theirs = [one for one in series if one.engine != OURS and one.law != MUJOCO_LAW]
    for target in REALTIME_GOALS:
        for every_walk in (True, False):
            at = f"{'every' if every_walk else 'median'} walk within {target:g} m"
            chosen = best(runs, mine, target, every_walk=every_walk)
            yield from _ours(chosen, target, at)
            yield from _against(runs, theirs, target, at, _factor(chosen), every_walk=every_walk)


def _ours(chosen: Choice | None, target: float, at: str) -> Iterable[Row]:
    slowest = chosen.spread.worst_realtime_factor if chosen else math.nan
    worst = chosen.spread.worst_error if chosen else math.nan
    yield Row(
        figure=f"{at}{_how(chosen)}: real time",
        unit="x",
        ours=_factor(chosen),
        goal=REALTIME_GOALS[target],
        better="more",
    )
    yield Row(
        figure=f"{at}: slowest walk",
        unit="x",
        ours=slowest,
        goal=WORST_GOAL if target == FINE else math.nan,
        better="more",
    )
    yield Row(figure=f"{at}: worst error", unit="m", ours=worst)


def _against(
    runs: Sequence[Run],
    peers: Sequence[Series],
    target: float,
    at: str,
    ours: float,
    *,
    every_walk: bool,
) -> Iterable[Row]:
    """Yields a row for each peer at its best setting, and one for the best peer."""
    engines = list(dict.fromkeys(one.engine for one in peers if spreads(runs, one)))
    found = {
        engine: best(
            runs, [one for one in peers if one.engine == engine], target, every_walk=every_walk
        )
        for engine in engines
    }
    facts: dict[str, Any] = {"figure": f"{at}: against", "unit": "x", "ours": ours}
    for engine, choice in found.items():
        theirs = _factor(choice)
        yield Row(
            peer=f"{engine}{_how(choice)}" if choice else f"{engine}: not reached",
            theirs=theirs,
            ratio=ours / theirs,
            **facts,
        )
    top = max((_factor(choice) for choice in found.values() if choice), default=math.nan)
    goal = PEERS_GOAL if target == FINE else math.nan
    yield Row(
        peer="the best of them",
        theirs=top,
        ratio=ours / top,
        goal=goal,
        judged="ratio",
        better="more",
        **facts,
    )


def _own_contact(runs: Sequence[Run], series: Sequence[Series]) -> Iterable[Row]:
    """Yields MuJoCo with its own contact; each engine is judged by its own converged solution."""
    chosen = best(runs, [one for one in series if one.engine == OURS], FINE)
    method, setting = OWN_CONTACT
    for one in series:
        if one.law != MUJOCO_LAW:
            continue
        for spread in spreads(runs, one):
            goal = (
                OWN_CONTACT_GOAL if (one.method, spread.setting) == (method, setting) else math.nan
            )
            peer = f"{one.engine} {one.method} {spread.setting:g}, at {spread.error:.1e} m"
            yield Row(
                figure=f"every walk within {FINE:g} m: against",
                unit="x",
                ours=_factor(chosen),
                peer=peer,
                theirs=spread.realtime_factor,
                ratio=_factor(chosen) / spread.realtime_factor,
                goal=goal,
                judged="ratio",
                better="more",
            )


def _many(runs: Sequence[Run], series: Sequence[Series], parts: Parts) -> Iterable[Row]:
    """Yields the rate of many plants that one core steps in turn."""
    alone = _factor(best(runs, [one for one in series if one.engine == OURS], FINE))
    yield Row(
        figure=f"many robots on one core, every walk within {FINE:g} m: simulated seconds a second",
        unit="x",
        ours=alone / parts.crowd,
        better="more",
    )
    yield Row(
        figure="the same, to one robot alone",
        unit="1",
        ours=1.0 / parts.crowd,
        goal=MANY_GOAL,
        better="more",
    )


def _studies(studies: Studies) -> Iterable[Row]:
    for setting, rate in studies.per_minute.items():
        yield Row(
            figure=f"compliant walks of 10 s a minute on all cores, {setting}",
            unit="1/min",
            ours=rate,
            goal=WALKS_GOALS[setting],
            better="more",
        )
    times = {
        "hexapod compare, 20 walks of 10 s, after set-up": (studies.comparison, COMPARISON_GOAL),
        "gains of a new robot, in a new process": (studies.gains, GAINS_GOAL),
        "gains of a known robot, in a new process": (studies.kept_gains, GAINS_GOAL),
    }
    for figure, (seconds, goal) in times.items():
        yield Row(figure=figure, unit="s", ours=seconds, goal=goal)


def _rest(parts: Parts) -> Iterable[Row]:
    for name, cost in parts.steep.items():
        yield Row(
            figure=f"cost with {name} over the default's", unit="1", ours=cost, goal=STEEP_GOAL
        )
    loops = [
        (f"{control} control", factor, LOOP_GOALS[control])
        for control, factor in parts.loop.items()
    ]
    loops += [
        (f"compiled compliant control, {driven}", factor, COMPILED_GOAL)
        for driven, factor in parts.compiled.items()
    ]
    for driven, factor, goal in loops:
        yield Row(
            figure=f"whole co-simulation, {driven}", unit="x", ours=factor, goal=goal, better="more"
        )
    yield Row(
        figure="an instance, its structure", unit="byte", ours=parts.structure, goal=MEMORY_GOAL
    )
    yield Row(
        figure="an instance, by which the process grows",
        unit="byte",
        ours=parts.resident,
        goal=GROWTH_GOAL,
    )
    yield Row(
        figure="allocations in all steps of a walk", unit="1", ours=parts.allocations, goal=0.0
    )
    for name, count in parts.instructions.items():
        yield Row(figure=f"instructions of an evaluation, {name}", unit="1", ours=count)
    yield Row(figure="instructions of a macro-step", unit="1", ours=parts.walk_instructions)


def _factor(choice: Choice | None) -> float:
    return choice.spread.realtime_factor if choice else math.nan


def _how(choice: Choice | None) -> str:
    return f" ({choice.series.method} {choice.spread.setting:g})" if choice else ""


def chosen_setting(runs: Sequence[Run], series: Sequence[Series]) -> Choice | None:
    """Returns our method and setting in the table at the coarser error."""
    mine = [one for one in series if one.engine == OURS]
    return best(runs, mine, FINE) or best(runs, mine, FINE, every_walk=False)
