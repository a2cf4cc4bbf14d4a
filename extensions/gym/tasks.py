"""The registered environments and their settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from hexapod_cosim.extensions.gym.settings import LEGGED_GYM_HEIGHTS, EnvSettings
from hexapod_cosim.models import unknown_name

FLAT = EnvSettings()
ROUGH = replace(
    FLAT,
    terrain={"kind": "rubble", "max_height": 0.03, "stone_size": 0.15},
    terrain_seeds=8,
    observation=LEGGED_GYM_HEIGHTS,
    randomise={"friction.mu": (0.5, 0.9)},
)
SOIL = replace(FLAT, terrain={"kind": "sand", "soil": "dry_sand"}, pad_radius=0.025)
PUSH = replace(FLAT, push_force=40.0, randomise={"friction.mu": (0.5, 0.9)})

TASKS: Mapping[str, EnvSettings] = {
    "Hexapod-v0": FLAT,
    "HexapodRough-v0": ROUGH,
    "HexapodSoil-v0": SOIL,
    "HexapodPush-v0": PUSH,
}
TITLES: Mapping[str, str] = {
    "Hexapod-v0": "flat ground",
    "HexapodRough-v0": "rubble of up to 30 mm from 8 seeds, friction 0.5 to 0.9",
    "HexapodSoil-v0": "dry sand, feet with pads",
    "HexapodPush-v0": "flat ground, pushes of up to 40 N every 2 s, friction 0.5 to 0.9",
}


def task(name: str) -> EnvSettings:
    """Returns the settings of a registered environment. Raises HexapodError."""
    if name not in TASKS:
        raise unknown_name("environment", name, TASKS)
    return TASKS[name]


def environment_rows() -> list[dict[str, Any]]:
    """Returns what `hexapod list environments` shows."""
    return [{"name": name, "title": title} for name, title in TITLES.items()]
