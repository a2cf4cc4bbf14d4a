"""What the catalogue knows of a surface, and the parameters that several surfaces share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace

from hexapod_cosim.models.ground.parameters import TILE, Parameters, length
from hexapod_cosim.models.ground.surface import Surface


@dataclass(frozen=True)
class Entry:
    """A surface of the catalogue."""

    about: str
    make: Callable[[SimpleNamespace], Surface]
    parameters: Parameters


# legged_gym's 0.05 + 0.18 difficulty, by half
STEP_HEIGHT = length((0.025, 0.115), "height of a step")
STEP_WIDTH = length(0.15, "depth of a step's tread", least=0.01, zero=True)
DEPTH = length(0.3, "depth of the gaps")
STEPS: Parameters = {**TILE, "step_height": STEP_HEIGHT, "step_width": STEP_WIDTH}
ONE_STEP: Parameters = {**TILE, "step_height": STEP_HEIGHT}
