"""Tells in words which gait and stance a run's control walked."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

WALKING = "walking"  # key of run.json: gait and stance
OF_FMU = "controller FMU"  # a stance that is read from such an FMU
LEAST_LENGTH = 5e-4  # m    a smaller change of the stance is not told


def walking_text(facts: Mapping[str, Any], *, brief: bool = False) -> str:
    """Returns gait and stance of a run, and whose choice they were; "" of an earlier version.

    facts: those of run.json; brief: without whose choice.
    """
    walking = facts.get(WALKING)
    if not walking:
        return ""
    text = f"{walking['gait']}, period {walking['period']:.3g} s, {_stance(walking)}"
    if brief:
        return text
    return f"{text}, chosen by the {walking['chosen_by']}"


def _stance(walking: Mapping[str, Any]) -> str:
    """Returns the stance against the robot file's, or that it is a controller FMU's."""
    if walking.get("stance") == OF_FMU:
        return f"the stance of the {OF_FMU}"
    parts = [
        f"{1e3 * abs(walking[key]):.0f} mm {more if walking[key] > 0.0 else less}"
        for key, more, less in (
            ("outward", "further out from the hips", "nearer to the hips"),
            ("deeper", "deeper below them", "less deep below them"),
        )
        if abs(walking[key]) > LEAST_LENGTH
    ]
    return f"feet {' and '.join(parts)}" if parts else "the robot file's stance"


def different_walks(facts: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Returns a sentence for each walk, with its controls by label, if there are several walks."""
    walks: dict[str, list[str]] = {}
    for label, one in facts.items():
        walks.setdefault(walking_text(one, brief=True), []).append(label)
    if len(walks) < 2:
        return []
    return [
        f"{', '.join(labels)} {'walks' if len(labels) == 1 else 'walk'} "
        f"{walking_text(facts[labels[0]])}"
        for text, labels in walks.items()
        if text
    ]
