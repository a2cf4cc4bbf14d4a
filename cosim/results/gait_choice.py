"""Gait and stance of a run, and whose choice they were, in words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

OF_FMU = "controller FMU"  # a stance that is read from such an FMU
LEAST_LENGTH = 5e-4  # m    a smaller change of the stance is not named


@dataclass(frozen=True, kw_only=True)
class GaitChoice:
    """Gait and stance of a run."""

    gait: str
    period: float  # s
    duty: float  # 1
    stance: str  # its name, or OF_FMU
    outward: float  # m    by which the feet stand further out from the hips than the robot's
    deeper: float  # m    and deeper below them
    narrowing: float  # m    by which the feet are set nearer together at speed
    chosen_by: str  # scenario, control or robot file

    @property
    def brief(self) -> str:
        """Gait and stance."""
        return f"{self.gait}, period {self.period:.3g} s, {self._feet()}"

    @property
    def text(self) -> str:
        """Gait and stance, and whose choice they were."""
        return f"{self.brief}, chosen by the {self.chosen_by}"

    def _feet(self) -> str:
        """Returns the stance against the robot file's, or that it is a controller FMU's."""
        if self.stance == OF_FMU:
            return f"the stance of the {OF_FMU}"
        changes = (
            (self.outward, "further out from the hips", "nearer to the hips"),
            (self.deeper, "deeper below them", "less deep below them"),
        )
        parts = [
            f"{1e3 * abs(length):.0f} mm {more if length > 0.0 else less}"
            for length, more, less in changes
            if abs(length) > LEAST_LENGTH
        ]
        return f"feet {' and '.join(parts)}" if parts else "the robot file's stance"


def gait_differences(choices: Mapping[str, GaitChoice]) -> list[str]:
    """Returns a sentence for each gait and stance, with its controls, if there are several.

    choices: by the labels of the controls.
    """
    groups: dict[str, list[str]] = {}
    for label, choice in choices.items():
        groups.setdefault(choice.brief, []).append(label)
    if len(groups) < 2:
        return []
    return [
        f"{', '.join(labels)} {'walks' if len(labels) == 1 else 'walk'} {choices[labels[0]].text}"
        for labels in groups.values()
    ]
