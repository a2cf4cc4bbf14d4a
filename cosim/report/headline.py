"""What a report says first: what compliant control changes, in a sentence and on cards; of a single run, what it was."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from hexapod_cosim.cosim.comparison import BETTER, WORSE, Change, Comparison

# metric -> its name on a card, and what there is less or more of in the sentence
TOLD = {
    "slip_per_metre": ("slip per metre", "slip"),
    "height_rms": ("height, RMS", "bobbing"),
    "roll_rms": ("roll, RMS", "rolling"),
    "loading_rate": ("loading rate at touch-down", "jolt at touch-down"),
    "cost_of_transport": ("cost of transport", "motor work per metre"),
    "torque_rms": ("motor torque, RMS", "motor torque"),
}
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
    """What the second control gains and what it costs, as far as the runs are sure of it."""
    first, second = comparison.labels
    gains, losses = _of(comparison, BETTER), _of(comparison, WORSE)
    begin = Part(f"{second.capitalize()} control")
    if not gains and not losses:
        return [begin, Part(f" changes nothing against {first} control that these runs could tell.")]
    parts = [begin, Part(" walks with " if gains else " brings "), *_listed(gains[:MOST_GAINS] or losses)]
    if gains and losses:
        parts += [Part(", and costs "), *_listed(losses)]
    return [*parts, Part(f" than {first}.")]


def _of(comparison: Comparison, verdict: str) -> list[Part]:
    found = [(name, comparison.changes[name]) for name in TOLD]
    return [
        Part(_less_or_more(TOLD[name][1], change), verdict)
        for name, change in found
        if change.verdict == verdict and math.isfinite(change.relative)
    ]


def _less_or_more(what: str, change: Change) -> str:
    share = abs(change.relative)
    size = f"{1.0 + share:.1f} times the" if change.relative >= 1.0 else f"{share:.0%} {'less' if change.relative < 0.0 else 'more'}"
    return f"{size} {what}"


def _listed(parts: list[Part]) -> list[Part]:
    """With commas between them and "and" before the last."""
    between = [Part(", ")] * (len(parts) - 2) + [Part(" and ")] * (len(parts) > 1)
    return [piece for pair in zip(parts, [*between, Part("")], strict=True) for piece in pair if piece.text]


def cards(comparison: Comparison, rows: list[dict[str, Any]]) -> list[Card]:
    """The figures of TOLD, as the table's `rows` have them."""
    by_name = {row["name"]: row for row in rows}
    return [_card(TOLD[name][0], by_name[name]) for name in TOLD if comparison.changes[name].pairs]


def _card(name: str, row: Mapping[str, Any]) -> Card:
    before, after = row["values"]
    unit = "" if row["unit"] == "1" else f" {row['unit']}"
    return Card(name, row["change"] or row["verdict"] or "-", f"{before} → {after}{unit}", row["interval"], row["verdict"])


def plain_headline(metrics: Mapping[str, float | None], facts: Mapping[str, Any]) -> list[Part]:
    """Of one run: how long and how fast it walked, and what it slipped on the way."""
    speed, slip = (facts.get("walk") or {}).get("mean_speed"), metrics.get("slip_per_metre")
    begin = f"{facts['control'].capitalize()} control, {facts['simulated']:.4g} s"
    if speed is None or slip is None or not math.isfinite(speed + slip):
        return [Part(f"{begin}.")]
    return [Part(f"{begin}: {1e3 * speed:.3g} mm/s, {1e3 * slip:.3g} mm of slip per metre walked.")]
