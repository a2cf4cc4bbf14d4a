"""Judges parts of a control: what each one betters and worsens, class by class.

A part's effect on a figure is the ratio of the figure with the part to that without it, the median
over the cases of a class. A part pays when it betters a figure of some class by GAIN and worsens
none by LOSS. Success rates count as figures, in shares of all runs of a class.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from hexapod_cosim.extensions.course.records import SHOWN
from hexapod_cosim.extensions.course.table import ALL, CaseFigures, ClassFigures, Table

GAIN, LOSS = 0.1, 0.05
SUCCESS = "success"


@dataclass(frozen=True)
class Effect:
    """The effect of a part on a figure of a class: a relative change, negative for the better."""

    kind: str
    quantity: str
    change: float


@dataclass(frozen=True)
class Judgement:
    """A part of a control with its best and its worst effect."""

    label: str  # of the column without the part
    control: str  # with it
    best: Effect
    worst: Effect

    @property
    def pays(self) -> bool:
        """Whether the part betters a figure by GAIN and worsens none by LOSS."""
        return self.best.change <= -GAIN and self.worst.change < LOSS

    def as_table(self) -> dict[str, Any]:
        """Returns a table for JSON."""
        effects = {
            name: {"class": each.kind, "quantity": each.quantity, "change": each.change}
            for name, each in (("best", self.best), ("worst", self.worst))
        }
        return {"label": self.label, "control": self.control, **effects, "pays": self.pays}


def judge_parts(table: Table) -> list[Judgement]:
    """Returns the judgements of the columns of a table that lack a part."""
    found = []
    for label, control in table.parts.items():
        effects = effects_of(table, label, control)
        if effects:
            best = min(effects, key=lambda effect: effect.change)
            worst = max(effects, key=lambda effect: effect.change)
            found.append(Judgement(label, control, best, worst))
    return found


def effects_of(table: Table, label: str, control: str) -> list[Effect]:
    """Returns the effects of the part that column `label` lacks and column `control` has."""
    effects = []
    for kind in dict.fromkeys(name for name, _ in table.classes if name != ALL):
        whole = table.cases_of(kind, control)
        without = table.cases_of(kind, label)
        both = ClassFigures(
            kind,
            control,
            tuple(
                CaseFigures(one.case, control, one.runs, other.runs)
                for one, other in zip(whole, without, strict=True)
            ),
        )
        rates = (ClassFigures(kind, label, without).success, both.success)
        before, after = (rate.interval.value for rate in rates)
        ratios = {item.name: both.ratio(item.name).value - 1.0 for item in SHOWN}
        effects += [
            Effect(kind, name, change)
            for name, change in {SUCCESS: before - after, **ratios}.items()
            if math.isfinite(change)
        ]
    return effects
