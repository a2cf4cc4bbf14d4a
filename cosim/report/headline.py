"""The headline of a report: the largest effects of a control, or what a single run was."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from hexapod_cosim.cosim.results.comparison import BETTER, WORSE, Change, Comparison
from hexapod_cosim.cosim.results.facts import RunFacts
from hexapod_cosim.cosim.results.metric_table import METRICS, PER_RADIAN
from hexapod_cosim.cosim.results.window import friction_law
from hexapod_cosim.cosim.scenario.records import CONTROLS
from hexapod_cosim.models.ground.surface import LAW, Surface

# metric -> its name on a card, and its name in the sentence, where "less" or "more" precedes it.
# Metrics that depend on no assumed slope of friction come first, slip last.
CARDS = {
    "height_rms": ("height, RMS", "bobbing"),
    "roll_rms": ("roll, RMS", "rolling"),
    "foot_error_stance": ("feet from their plan, stance", "error of the standing feet"),
    "loading_rate": ("loading rate", "jolt on landing"),
    "cost_of_transport": ("cost of transport", "motor work per metre"),
    "electrical_cost": ("electrical cost", "electrical energy per metre"),
    "servo_load_max": ("hottest servo, of its rating", "torque on the hottest servo"),
    "slip_per_metre": ("slip per metre", "slip"),
    # of a robot that turns on the spot
    "cost_per_radian": ("work per radian", "motor work per radian"),
    "electrical_cost_per_radian": ("electrical cost per radian", "electrical energy per radian"),
    "slip_per_radian": ("slip per radian", "slip"),
}
# metrics that only the sentence names, where their change is among the largest
PHRASES = {name: phrase for name, (_, phrase) in CARDS.items()} | {
    "foot_error_swing": "error of the swinging feet",
    "path_error": "error of the path",
    "path_error_per_radian": "drift from the place",
    "yaw_drift": "drift of the heading",
    "yaw_drift_per_radian": "drift of the heading",
    "pitch_rms": "pitching",
    "peak_force": "largest foot force",
}
CREEP = (
    "Under the tanh friction law a foot under load always creeps, "
    "at a rate that friction.slope assumes: most of the slip is that. "
    "Walk with friction.law=bristle to see what slips on ground that holds a foot."
)
MILLI = {  # unit -> factor and unit on a card
    "m": (1e3, "mm"),
    "rad": (1e3, "mrad"),
    "m/m": (1e3, "mm/m"),
    "m/rad": (1e3, "mm/rad"),
    "1": (1.0, ""),
}
RIGID = 1.0  # soil.law: none
ROUND_OFF = 1e-9  # m    of an error of the feet; a smaller one is not shown
MOST = 3  # gains, and costs, in the sentence


@dataclass(frozen=True)
class Part:
    """A piece of the sentence; one with a verdict is highlighted."""

    text: str
    verdict: str = ""


@dataclass(frozen=True)
class Card:
    """A metric at the top of the report, as texts."""

    name: str
    change: str
    values: str
    interval: str
    verdict: str


def headline(comparison: Comparison) -> list[Part]:
    """Returns the headline of a comparison: the runs that did not walk to the end, then the largest
    of the significant gains and losses of the second control.
    """
    first, second = comparison.labels
    falls = _falls(comparison)
    pairs = zip(comparison.first, comparison.second, strict=True)
    if falls and not any(a.success and b.success for a, b in pairs):
        return [*falls, Part(". No pair of walks can be compared.")]
    against = f"gainst {first} control, {second}"
    begin = [*falls, Part(f". Where both walked, a{against}")] if falls else [Part(f"A{against}")]
    return effects(comparison.changes, begin)


def effects(changes: Mapping[str, Change], begin: list[Part]) -> list[Part]:
    """Returns a sentence that begins with some parts and names the largest of the changes."""
    gains, losses = _largest(changes, BETTER), _largest(changes, WORSE)
    if not gains and not losses:
        return _no_change(changes, begin)
    begin += [Part(" walks with " if gains else " brings "), *_listed(gains or losses)]
    if gains and losses:
        begin += [Part(", and costs "), *_listed(losses)]
    return [*begin, Part(".")]


def _known(changes: Mapping[str, Change]) -> set[str]:
    """Returns the metrics that the runs have; those per radian instead of those per metre."""
    known = {name for name, change in changes.items() if change.pairs}
    return known - {radian for metre, radian in PER_RADIAN.items() if metre in known}


def creep_note(facts: RunFacts, surface: Surface | None = None) -> str:
    """Returns a note on slip under a run's friction law, "" if there is none.

    Ground with soil has none: there the law does not act, and slip is shear.

    surface: the run's.
    """
    parameters = facts.parameters
    creeps = friction_law(parameters).creep is not None
    return CREEP if creeps and not _has_soil(parameters, surface) else ""


def _has_soil(parameters: Mapping[str, Any], surface: Surface | None) -> bool:
    """Whether the ground of a run is soil, or has soil somewhere."""
    plain = parameters.get("soil.law", RIGID) != RIGID
    if surface is None or surface.material is None or surface.materials is None:
        return bool(plain)
    soft = np.concatenate([[plain], surface.materials[:, LAW] > 0.0])
    return bool(soft[np.unique(surface.material)].any())


def _falls(comparison: Comparison) -> list[Part]:
    """Tells how many runs did not complete with the robot upright; returns [] when all did."""
    count = len(comparison.seeds)
    first, second = (count - comparison.walked[label] for label in comparison.labels)
    if not first + second:
        return []
    verdicts = (
        ("", "") if first == second else (WORSE, BETTER) if first > second else (BETTER, WORSE)
    )
    begin, end = (
        Part(f"{label} in {lost} of {count}", verdict)
        for label, lost, verdict in zip(comparison.labels, (first, second), verdicts, strict=True)
    )
    start = Part("The robot did not walk to the end under ")
    return [start, begin, Part(" and under "), end, Part(" runs")]


def _no_change(changes: Mapping[str, Change], begin: list[Part]) -> list[Part]:
    """Returns the sentence for runs that differ in no metric that it can name."""
    if not _known(changes) & CARDS.keys():
        text = (
            "The walk was too short to measure: "
            "figures are of whole gait cycles after the first two."
        )
        return [Part(text)]
    return [*begin, Part(" control changes nothing that these runs could tell.")]


def _largest(changes: Mapping[str, Change], verdict: str) -> list[Part]:
    """Returns the largest changes with a verdict, by their ratio, as parts of the sentence."""
    found = {
        name: change
        for name, change in changes.items()
        if name in _known(changes) & PHRASES.keys()
        and change.verdict == verdict
        and math.isfinite(change.relative)
    }
    ordered = sorted(found, key=lambda name: -_size(found[name]))
    return [Part(_less_or_more(PHRASES[name], found[name]), verdict) for name in ordered[:MOST]]


def _size(change: Change) -> float:
    """Returns how large a change is: the logarithm of its ratio, of either sign."""
    return abs(math.log(max(1.0 + change.relative, 1e-12)))


def _less_or_more(what: str, change: Change) -> str:
    if change.relative >= 1.0:
        return f"{1.0 + change.relative:.1f} times the {what}"
    direction = "less" if change.relative < 0.0 else "more"
    return f"{100.0 * abs(change.relative):.0f} % {direction} {what}"


def _listed(parts: list[Part]) -> list[Part]:
    """Joins parts with commas and "and"."""
    joined = [parts[0]]
    for number, part in enumerate(parts[1:], 2):
        joined += [Part(" and " if number == len(parts) else ", "), part]
    return joined


def cards(changes: Mapping[str, Change]) -> list[Card]:
    """Returns the cards of the metrics in CARDS that the runs have."""
    known = _known(changes)
    return [
        _card(text, METRICS[name][0], changes[name])
        for name, (text, _) in CARDS.items()
        if name in known
    ]


def _card(name: str, unit: str, change: Change) -> Card:
    scale, unit = MILLI.get(unit, (1.0, unit))
    before, after = _digits(scale * change.before), _digits(scale * change.after)
    known = math.isfinite(change.relative)
    low, high = change.interval
    interval = f"({_share(low).removesuffix(' %')} to {_share(high)})" if math.isfinite(low) else ""
    relative = _share(change.relative) if known else change.verdict
    return Card(name, relative, f"{before} → {after} {unit}", interval, change.verdict)


def _digits(value: float) -> str:
    """Returns a value with three digits, never as a power of ten."""
    places = 2 - math.floor(math.log10(abs(value))) if value else 0
    return f"{value:.{min(max(places, 0), 3)}f}"


def _share(value: float) -> str:
    """Returns a share in per cent with its sign and up to three digits."""
    return f"{100.0 * value:+.{1 if abs(value) < 1.0 else 0}f} %".replace("-", "−")


def plain_headline(metrics: Mapping[str, float | None], facts: RunFacts) -> list[Part]:
    """Returns the headline of one run: duration, speed, error of the feet, cost of transport."""
    speed, label = facts.walk.mean_speed, facts.control
    name = f"{label.capitalize()} control" if label in CONTROLS else f"Control {label}"
    begin = f"{name}, {facts.simulated:.4g} s"
    error, cost = metrics.get("foot_error_stance"), metrics.get("cost_of_transport")
    parts = [f"{1e3 * speed:.3g} mm/s"] if math.isfinite(speed) else []
    if error is not None and math.isfinite(error) and error > ROUND_OFF:
        parts.append(f"standing feet {1e3 * error:.3g} mm from their plan")
    if cost is not None and math.isfinite(cost):
        parts.append(f"cost of transport {cost:.3g}")
    return [Part(f"{begin}: {', '.join(parts)}." if parts else f"{begin}.")]
