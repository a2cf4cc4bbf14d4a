"""What a report says first: what compliant control changes, in a sentence and on cards; of a single run, what it was."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from hexapod_cosim.cosim.comparison import BETTER, WORSE, Change, Comparison
from hexapod_cosim.cosim.metrics import METRICS

# metric -> its name on a card, and what there is less or more of in the sentence
TOLD = {
    "slip_per_metre": ("slip per metre", "slip"),
    "height_rms": ("height, RMS", "bobbing"),
    "roll_rms": ("roll, RMS", "rolling"),
    "loading_rate": ("loading rate", "jolt on landing"),
    "cost_of_transport": ("cost of transport", "motor work per metre"),
    "torque_rms": ("motor torque, RMS", "motor torque"),
}
MILLI = {"m": (1e3, "mm"), "rad": (1e3, "mrad"), "m/m": (1e3, "mm/m"), "1": (1.0, "")}  # units that people read on a card
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
    """Who did not walk to the end; then what the second control gains and what it costs, as far as the runs are sure of it."""
    first, second = comparison.labels
    falls = _falls(comparison)
    if falls and not any(a.walked and b.walked for a, b in zip(comparison.first, comparison.second, strict=True)):
        return [*falls, Part(". No pair of walks can be compared.")]
    begin = f"Where both walked, against {first} control, {second}" if falls else f"Against {first} control, {second}"
    stop = [*falls, Part(". ")] if falls else []
    gains, losses = _of(comparison, BETTER), _of(comparison, WORSE)
    if not gains and not losses:
        return [*stop, Part(_nothing(comparison, begin))]
    parts = [*stop, Part(begin), Part(" walks with " if gains else " brings "), *_listed(gains[:MOST_GAINS] or losses)]
    if gains and losses:
        parts += [Part(", and costs "), *_listed(losses)]
    return [*parts, Part(".")]


def _falls(comparison: Comparison) -> list[Part]:
    """How many of whose runs did not come to their end with the robot on its feet; nothing when all did."""
    count, walked = len(comparison.seeds), comparison.walked
    lost = {label: count - number for label, number in walked.items()}
    if not any(lost.values()):
        return []
    first, second = comparison.labels
    verdicts = ("", "") if lost[first] == lost[second] else (WORSE, BETTER) if lost[first] > lost[second] else (BETTER, WORSE)
    told = [Part(f"{label} in {lost[label]} of {count}", verdict) for label, verdict in zip(comparison.labels, verdicts, strict=True)]
    return [Part("The robot did not walk to the end under "), told[0], Part(" and under "), told[1], Part(" runs")]


def _nothing(comparison: Comparison, begin: str) -> str:
    """Where no main figure differs: that there is none, that others do, or that none does."""
    if not any(comparison.changes[name].pairs for name in TOLD):
        return "The walk was too short to measure: figures are of whole gait cycles after the first two."
    others = [name for name, change in comparison.changes.items() if change.verdict in {BETTER, WORSE}]
    if others:
        return f"{begin} control changes none of the main figures, but {', '.join(others)}."
    return f"{begin} control changes nothing that these runs could tell."


def _of(comparison: Comparison, verdict: str) -> list[Part]:
    found = [(name, comparison.changes[name]) for name in TOLD]
    return [
        Part(_less_or_more(TOLD[name][1], change), verdict)
        for name, change in found
        if change.verdict == verdict and math.isfinite(change.relative)
    ]


def _less_or_more(what: str, change: Change) -> str:
    share = abs(change.relative)
    size = (
        f"{1.0 + share:.1f} times the" if change.relative >= 1.0 else f"{100.0 * share:.0f} % {'less' if change.relative < 0.0 else 'more'}"
    )
    return f"{size} {what}"


def _listed(parts: list[Part]) -> list[Part]:
    """With commas between them and "and" before the last."""
    between = [Part(", ")] * (len(parts) - 2) + [Part(" and ")] * (len(parts) > 1)
    return [piece for pair in zip(parts, [*between, Part("")], strict=True) for piece in pair if piece.text]


def cards(comparison: Comparison) -> list[Card]:
    """The figures of TOLD, as far as the runs have them."""
    changes = {name: comparison.changes[name] for name in TOLD if comparison.changes[name].pairs}
    return [_card(TOLD[name][0], METRICS[name][0], change) for name, change in changes.items()]


def _card(name: str, unit: str, change: Change) -> Card:
    scale, unit = MILLI.get(unit, (1.0, unit))
    before, after = _digits(scale * change.before), _digits(scale * change.after)
    known = math.isfinite(change.relative)
    low, high = change.interval
    interval = f"({_share(low).removesuffix(' %')} to {_share(high)})" if math.isfinite(low) else ""
    return Card(name, _share(change.relative) if known else change.verdict, f"{before} → {after} {unit}", interval, change.verdict)


def _digits(value: float) -> str:
    """Three of them, never as a power of ten."""
    places = 2 - math.floor(math.log10(abs(value))) if value else 0
    return f"{value:.{min(max(places, 0), 3)}f}"


def _share(value: float) -> str:
    """Per cent with its sign, to three digits."""
    return f"{100.0 * value:+.{1 if abs(value) < 1.0 else 0}f} %".replace("-", "−")


def plain_headline(metrics: Mapping[str, float | None], facts: Mapping[str, Any]) -> list[Part]:
    """Of one run: how long and how fast it walked, and what it slipped on the way."""
    speed, slip = (facts.get("walk") or {}).get("mean_speed"), metrics.get("slip_per_metre")
    begin = f"{facts['control'].capitalize()} control, {facts['simulated']:.4g} s"
    if speed is None or slip is None or not math.isfinite(speed + slip):
        return [Part(f"{begin}.")]
    return [Part(f"{begin}: {1e3 * speed:.3g} mm/s, {1e3 * slip:.3g} mm of slip per metre walked.")]
