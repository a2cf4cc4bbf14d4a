"""What a report says first: what compliant control changes, in a sentence and on cards; of a
single run, what it was.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from hexapod_cosim.cosim.results.comparison import BETTER, WORSE, Change, Comparison
from hexapod_cosim.cosim.results.metrics import METRICS, PER_RADIAN
from hexapod_cosim.cosim.results.walk import TANH

# metric -> its name on a card, and what there is less or more of in the sentence: first what
# depends on no assumed slope of friction, slip last
TOLD = {
    "height_rms": ("height, RMS", "bobbing"),
    "roll_rms": ("roll, RMS", "rolling"),
    "foot_error_stance": ("feet from their plan, stance", "error of the standing feet"),
    "loading_rate": ("loading rate", "jolt on landing"),
    "cost_of_transport": ("cost of transport", "motor work per metre"),
    "electrical_cost": ("electrical cost", "electrical energy per metre"),
    "servo_load_max": ("hottest servo, of its rating", "torque on the hottest servo"),
    "slip_per_metre": ("slip per metre", "slip"),
}
TURNED = {
    "cost_of_transport": ("work per radian", "motor work per radian"),
    "electrical_cost": ("electrical cost per radian", "electrical energy per radian"),
    "slip_per_metre": ("slip per radian", "slip"),
}  # the same of a robot that turns on the spot
CREEP = (
    "Under the tanh friction law a foot under load always creeps, at a rate that friction.slope assumes: most of the slip is that. "
    "Walk with friction.law=bristle to see what slips on ground that holds a foot."
)
MILLI = {
    "m": (1e3, "mm"),
    "rad": (1e3, "mrad"),
    "m/m": (1e3, "mm/m"),
    "m/rad": (1e3, "mm/rad"),
    "1": (1.0, ""),
}  # units that people read on a card
MOST_GAINS = 4  # in the sentence


@dataclass(frozen=True)
class Part:
    """A piece of the sentence; with a verdict it stands out."""

    text: str
    verdict: str = ""


@dataclass(frozen=True)
class Card:
    """A figure to see first."""

    name: str
    change: str
    values: str
    interval: str
    verdict: str


def headline(comparison: Comparison) -> list[Part]:
    """Who did not walk to the end; then what the second control gains and what it costs, as far
    as the runs are sure of it.
    """
    first, second = comparison.labels
    falls = _falls(comparison)
    if falls and not any(
        a.walked and b.walked for a, b in zip(comparison.first, comparison.second, strict=True)
    ):
        return [*falls, Part(". No pair of walks can be compared.")]
    begin = (
        f"Where both walked, against {first} control, {second}"
        if falls
        else f"Against {first} control, {second}"
    )
    stop = [*falls, Part(". ")] if falls else []
    gains, losses = _of(comparison, BETTER), _of(comparison, WORSE)
    if not gains and not losses:
        return [*stop, Part(_nothing(comparison, begin))]
    parts = [
        *stop,
        Part(begin),
        Part(" walks with " if gains else " brings "),
        *_listed(gains[:MOST_GAINS] or losses),
    ]
    if gains and losses:
        parts += [Part(", and costs "), *_listed(losses)]
    return [*parts, Part(".")]


def _told(comparison: Comparison) -> dict[str, tuple[str, str]]:
    """TOLD, with what is per radian where that is what the runs have."""
    told: dict[str, tuple[str, str]] = {}
    for name, text in TOLD.items():
        twin = PER_RADIAN.get(name, name)
        turned = (
            name in TURNED and comparison.changes[twin].pairs and not comparison.changes[name].pairs
        )
        told[twin if turned else name] = TURNED[name] if turned else text
    return told


def creep_note(parameters: Mapping[str, Any]) -> str:
    """What to know of slip under a run's friction law, "" when nothing."""
    return CREEP if parameters.get("friction.law", TANH) == TANH else ""


def _falls(comparison: Comparison) -> list[Part]:
    """How many of whose runs did not come to their end with the robot on its feet; nothing when
    all did.
    """
    count, walked = len(comparison.seeds), comparison.walked
    lost = {label: count - number for label, number in walked.items()}
    if not any(lost.values()):
        return []
    first, second = comparison.labels
    verdicts = (
        ("", "")
        if lost[first] == lost[second]
        else (WORSE, BETTER)
        if lost[first] > lost[second]
        else (BETTER, WORSE)
    )
    told = [
        Part(f"{label} in {lost[label]} of {count}", verdict)
        for label, verdict in zip(comparison.labels, verdicts, strict=True)
    ]
    return [
        Part("The robot did not walk to the end under "),
        told[0],
        Part(" and under "),
        told[1],
        Part(" runs"),
    ]


def _nothing(comparison: Comparison, begin: str) -> str:
    """Where no main figure differs: that there is none, that others do, or that none does."""
    told = _told(comparison)
    if not any(comparison.changes[name].pairs for name in told):
        return "The walk was too short to measure: figures are of whole gait cycles after the first two."
    others = [
        name for name, change in comparison.changes.items() if change.verdict in {BETTER, WORSE}
    ]
    if others:
        return f"{begin} control changes none of the main figures, but {', '.join(others)}."
    return f"{begin} control changes nothing that these runs could tell."


def _of(comparison: Comparison, verdict: str) -> list[Part]:
    found = [(what, comparison.changes[name]) for name, (_, what) in _told(comparison).items()]
    return [
        Part(_less_or_more(what, change), verdict)
        for what, change in found
        if change.verdict == verdict and math.isfinite(change.relative)
    ]


def _less_or_more(what: str, change: Change) -> str:
    share = abs(change.relative)
    size = (
        f"{1.0 + share:.1f} times the"
        if change.relative >= 1.0
        else f"{100.0 * share:.0f} % {'less' if change.relative < 0.0 else 'more'}"
    )
    return f"{size} {what}"


def _listed(parts: list[Part]) -> list[Part]:
    """With commas between them and "and" before the last."""
    between = [Part(", ")] * (len(parts) - 2) + [Part(" and ")] * (len(parts) > 1)
    return [
        piece
        for pair in zip(parts, [*between, Part("")], strict=True)
        for piece in pair
        if piece.text
    ]


def cards(comparison: Comparison) -> list[Card]:
    """The figures of TOLD, as far as the runs have them."""
    told = {
        name: text
        for name, (text, _) in _told(comparison).items()
        if comparison.changes[name].pairs
    }
    return [_card(text, METRICS[name][0], comparison.changes[name]) for name, text in told.items()]


def _card(name: str, unit: str, change: Change) -> Card:
    scale, unit = MILLI.get(unit, (1.0, unit))
    before, after = _digits(scale * change.before), _digits(scale * change.after)
    known = math.isfinite(change.relative)
    low, high = change.interval
    interval = f"({_share(low).removesuffix(' %')} to {_share(high)})" if math.isfinite(low) else ""
    return Card(
        name,
        _share(change.relative) if known else change.verdict,
        f"{before} → {after} {unit}",
        interval,
        change.verdict,
    )


def _digits(value: float) -> str:
    """Three of them, never as a power of ten."""
    places = 2 - math.floor(math.log10(abs(value))) if value else 0
    return f"{value:.{min(max(places, 0), 3)}f}"


def _share(value: float) -> str:
    """Per cent with its sign, to three digits."""
    return f"{100.0 * value:+.{1 if abs(value) < 1.0 else 0}f} %".replace("-", "−")


def plain_headline(metrics: Mapping[str, float | None], facts: Mapping[str, Any]) -> list[Part]:
    """Of one run: how long and how fast it walked, how far its feet were from their plan, and
    what it took.
    """
    speed = (facts.get("walk") or {}).get("mean_speed")
    begin = f"{facts['control'].capitalize()} control, {facts['simulated']:.4g} s"
    error, cost = metrics.get("foot_error_stance"), metrics.get("cost_of_transport")
    told = [f"{1e3 * speed:.3g} mm/s"] if speed is not None and math.isfinite(speed) else []
    told += (
        [f"standing feet {1e3 * error:.3g} mm from their plan"]
        if error is not None and math.isfinite(error)
        else []
    )
    told += [f"cost of transport {cost:.3g}"] if cost is not None and math.isfinite(cost) else []
    return [Part(f"{begin}: {', '.join(told)}." if told else f"{begin}.")]
