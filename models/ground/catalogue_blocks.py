"""Surfaces of the catalogue that are made of blocks."""

from __future__ import annotations

from dataclasses import replace

from hexapod_cosim.models.ground import steps
from hexapod_cosim.models.ground.entries import DEPTH, ONE_STEP, STEPS, Entry
from hexapod_cosim.models.ground.parameters import (
    HARD,
    HORIZONTAL,
    PLATFORM,
    RANDOM_TILE,
    SEED,
    SIZE,
    TILE,
    VERTICAL,
    count,
    length,
)

BLOCK_SURFACES: dict[str, Entry] = {
    "stairs": Entry(
        "Stairs up along +x and a landing",
        steps.stairs,
        {**STEPS, "num_steps": count(5, "number of steps", most=1000)},
    ),
    "pyramid_stairs": Entry("Stairs down to all sides", steps.pyramid_stairs, STEPS),
    "inverted_pyramid_stairs": Entry(
        "Stairs up to all sides", steps.inverted_pyramid_stairs, STEPS
    ),
    "steps": Entry("Kerbs across x", steps.steps, STEPS),
    "step_up": Entry("One step up along +x", steps.step_up, ONE_STEP),
    "step_down": Entry("One step down along +x", steps.step_down, ONE_STEP),
    "stepping_stones": Entry(
        "Square stones with gaps between them",
        steps.stepping_stones,
        {
            **RANDOM_TILE,
            "stone_size": length((0.5, 0.1), "edge of a stone", least=0.01, zero=True),
            "stone_distance": length(0.05, "width of the gaps"),
            "max_height": length(0.0, "largest deviation of the tops", zero=True),
            "depth": DEPTH,
        },
    ),
    "gaps": Entry(
        "Gaps across x",
        steps.gaps,
        {
            **TILE,
            "gap_size": length((0.02, 0.2), "width of a gap", least=0.01, zero=True),
            "gap_distance": length(0.4, "ground between two gaps"),
            "depth": DEPTH,
        },
    ),
    "discrete_obstacles": Entry(
        "Flat rectangles above and below the ground",
        steps.discrete_obstacles,
        {
            **RANDOM_TILE,
            "max_height": length((0.025, 0.125), "largest height"),
            "min_size": length(0.2, "shortest edge"),
            "max_size": length(0.6, "longest edge"),
            "num_rects": count(40, "number of rectangles"),
        },
    ),
    "rubble": Entry(
        "Square stones of random height",
        steps.rubble,
        {
            **RANDOM_TILE,
            "stone_size": length(0.2, "edge of a stone", least=0.01, zero=True),
            "max_height": length((0.02, 0.1), "largest height of a stone"),
        },
    ),
    "course": Entry(
        "5 m of rubble, kerbs, stones with gaps, stairs, along +x",
        steps.course,
        {
            "size": replace(SIZE, default=2.0, about="width of the course"),
            "horizontal_scale": HORIZONTAL,
            "platform_size": PLATFORM,
            "difficulty": HARD,
            "step_height": length((0.015, 0.1), "height of kerbs, stairs and rubble"),
            "depth": DEPTH,
            "vertical_scale": VERTICAL,
            "seed": SEED,
        },
    ),
}
