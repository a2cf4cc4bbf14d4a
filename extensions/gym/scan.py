"""Samples the grounds of an environment for the observation of heights."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.extensions.gym.plants import surfaces
from hexapod_cosim.extensions.gym.settings import EnvSettings, symmetric
from hexapod_cosim.models import Robot
from hexapod_cosim.models.ground.faces import ground_height, surface_heights
from hexapod_cosim.models.records import Array, Terrain
from hexapod_cosim.models.statics import settled

SPACING = 0.02  # m  of the samples
MARGIN = 0.5  # m  beyond the places that a robot can scan after an episode at its largest speed
LARGEST = 20.0  # m  from the origin to an edge of the map


@dataclass(frozen=True)
class GroundMaps:
    """Heights of grounds on a square grid."""

    height: NDArray[np.float32]  # (grounds, rows, columns) m  rows along y, columns along x
    first: float  # m  x and y of the first node
    clearance: float  # m  height of the torso over level ground in the stance

    def at(self, number: int, x: Array, y: Array) -> Array:
        """Returns the heights [m] of the nodes of a ground, from 0, nearest to places [m]."""
        last = self.height.shape[1] - 1
        row, column = (
            np.clip(np.round((place - self.first) / SPACING), 0, last).astype(int)
            for place in (y, x)
        )
        heights: Array = self.height[number][row, column].astype(np.float64)
        return heights


def ground_maps(settings: EnvSettings, robots: Sequence[Robot]) -> GroundMaps:
    """Returns the heights of the grounds, in the order of their numbers in the plant's FMU.

    robots: the robot on each of the grounds. The maps reach as far as it can walk in an episode.
    """
    level = settled(replace(robots[0], terrain=Terrain(kind="flat")))[0]
    speed = max(map(abs, (*settings.command_vx, *settings.command_vy)))
    scanned = math.hypot(settings.scan_length, settings.scan_width)
    reach = min(settings.duration * speed + scanned + MARGIN, LARGEST)
    nodes = np.array(symmetric(2.0 * reach, SPACING))
    base = robots[0].terrain
    found = surfaces(robots)
    heights = [base.height + surface_heights(surface, nodes, nodes) for surface in found]
    height = np.array(heights or [plane_heights(base, nodes)], dtype=np.float32)
    return GroundMaps(height, float(nodes[0]), float(level[2]))


def plane_heights(terrain: Terrain, nodes: Array) -> Array:
    """Returns the heights (y, x) [m] of a plane at all pairs of nodes along x and y [m]."""
    origin = ground_height(terrain, 0.0, 0.0)
    rise_x, rise_y = ground_height(terrain, 1.0, 0.0), ground_height(terrain, 0.0, 1.0)
    return np.add.outer((rise_y - origin) * nodes, (rise_x - origin) * nodes) + origin
