"""Turns the cases of scenarios.toml into settings of a scenario.

The cases vary one factor at a time around the judged walk, and gait and speed together.
"""

from __future__ import annotations

import tomllib
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from hexapod_cosim.controller import COMPLIANT_PARTS
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.cosim.scenario.scenario import load_scenario
from hexapod_cosim.cosim.scenario.variation import STANDARD
from hexapod_cosim.models import load_robot

DATA: dict[str, Any] = tomllib.loads(
    (Path(__file__).parent / "scenarios.toml").read_text(encoding="utf-8")
)
SWITCH = "compliance."  # settings that begin with it do not apply to kinematic control


@dataclass(frozen=True, kw_only=True)
class Case:
    """A walk to be run under both controls: its name and its settings (as with --set)."""

    name: str
    scenario: str
    settings: tuple[str, ...]

    def plan(self, control: str, seed: int) -> Scenario:
        """Returns the scenario of a seed. Raises ScenarioError for an unknown setting."""
        kept = [
            text for text in self.settings if control == "compliant" or not text.startswith(SWITCH)
        ]
        scenario = load_scenario(
            self.scenario,
            overrides=[*kept, f"control={control}", f"seed={seed}", "outputs.plots=false"],
        )
        return replace(scenario, variation=STANDARD)


def seeds(name: str) -> range:
    """Returns the seeds of a set of cases; by default they start at the first judged seed."""
    table = DATA[name]
    first = table.get("first_seed", DATA["judged"]["first_seed"])
    return range(first, first + table["seeds"])


def judged_walk(name: str = "judged", *settings: str) -> Case:
    """Returns the judged walk with settings."""
    return Case(name=name, scenario=DATA["judged"]["scenario"], settings=settings)


def ablation() -> list[Case]:
    """Returns cases with no part, the default, each part alone, and the default but one part.

    The squeeze belongs to the support, and so to the support alone.
    """
    cases = [_with_parts("no part", set()), judged_walk("by default")]
    cases += [_with_parts(f"{part} alone", {part}) for part in COMPLIANT_PARTS]
    cases += [
        _with_parts(f"without {part}", {*COMPLIANT_PARTS} - {part}) for part in COMPLIANT_PARTS
    ]
    return [*cases, judged_walk("without squeeze", f"{SWITCH}squeeze=0")]


def _with_parts(name: str, on: Collection[str]) -> Case:
    """Returns the judged walk with these parts of compliant control and no others."""
    switches = (f"{SWITCH}{part}={str(part in on).lower()}" for part in COMPLIANT_PARTS)
    return judged_walk(name, *switches)


def sticking() -> list[Case]:
    """Returns the judged walk on ground that holds a foot still."""
    return [judged_walk("by default", *DATA["judged"]["sticking"])]


def robustness() -> list[Case]:
    """Returns the judged walk with disturbances, faults and model errors."""
    return [judged_walk(entry["name"], *entry["settings"]) for entry in DATA["robustness"]["cases"]]


def grid(robot: str) -> list[Case]:
    """Returns every gait at every speed, then friction and payload around the judged walk."""
    table, own = DATA["judged"], load_robot(robot)
    frictions = [
        _walk(table, f"mu {mu:g}", robot, [f"friction.mu={mu}"])
        for mu in table["mu"]
        if mu != own.friction.mu
    ]
    payloads = [
        _walk(table, f"payload {load:g} kg", robot, _payload(robot, load))
        for load in table["payload"]
        if load
    ]
    return [*_plane(table, robot, []), *frictions, *payloads]


def tuning(robot: str) -> list[Case]:
    """Returns the same cases for tuning.

    Every case differs from every judged one in speed, friction, payload and timing.
    """
    table = DATA["tuning"]
    (mu, *frictions), (load, *payloads) = table["mu"], table["payload"]
    gait, speed = next(iter(table["gaits"])), f"command.vx={table['vx'][0]}"
    first = [
        f"gait.name={gait}",
        *table["gaits"][gait],
        speed,
        f"friction.mu={mu}",
        *_payload(robot, load),
    ]
    others = {f"mu {value:g}": [f"friction.mu={value}"] for value in frictions}
    others |= {f"payload {value:g} kg": _payload(robot, value) for value in payloads}
    others |= {f"period {value:g} s": [f"gait.period={value}"] for value in table["period"]}
    plane = _plane(table, robot, [f"friction.mu={mu}", *_payload(robot, load)])
    return [
        *plane,
        *(_walk(table, name, robot, [*first, *changes]) for name, changes in others.items()),
    ]


def _plane(table: dict[str, Any], robot: str, rest: Sequence[str]) -> list[Case]:
    return [
        _walk(
            table,
            f"{gait}, {vx:g} m/s",
            robot,
            [f"gait.name={gait}", *timing, f"command.vx={vx}", *rest],
        )
        for gait, timing in table["gaits"].items()
        for vx in table["vx"]
    ]


def _walk(table: dict[str, Any], name: str, robot: str, settings: Sequence[str]) -> Case:
    return Case(name=name, scenario=table["scenario"], settings=(f"robot={robot}", *settings))


def _payload(robot: str, load: float) -> list[str]:
    return [f"torso.mass={load_robot(robot).torso.mass + load}"]
