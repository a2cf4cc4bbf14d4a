"""Grids as grounds of the C plant: bytes of grid files, and plants on them."""

from __future__ import annotations

import ctypes as ct
import struct
from collections.abc import Callable
from typing import Any

import numpy as np
from mirror import MESSAGE_SIZE
from plant import Plant, bound, definition, probed

from hexapod_cosim.models import Robot
from hexapod_cosim.models.arrays import Array

SMOOTH, BLOCKS = 1, 2
TOP, WALL, SIDE, CORNER, NEAREST = range(5)
GRID = 3  # terrain.kind


def grid_bytes(
    height: Array,
    *,
    cell: float,
    origin: tuple[float, float] = (0.0, 0.0),
    kind: int = SMOOTH,
    material: Array | None = None,
    table: Array | None = None,
) -> bytes:
    """Returns a grid file: heights (rows, cols) [m], of nodes or columns `cell` apart [m]."""
    rows, cols = height.shape
    materials = 0 if table is None else len(table)
    head = struct.pack(
        "<8s4q3d64s", b"hxGrid01", rows, cols, kind, materials, *origin, cell, b"test"
    )
    parts = [head, np.ascontiguousarray(height, dtype="<f8").tobytes()]
    if table is not None and material is not None:
        codes = np.ascontiguousarray(material, dtype=np.uint8).tobytes()
        parts += [codes.ljust(-(-len(codes) // 8) * 8, b"\0"), np.asarray(table, "<f8").tobytes()]
    return b"".join(parts)


def sampled(
    surface: Callable[[Array, Array], Array], *, size: float, cell: float, kind: int = SMOOTH
) -> bytes:
    """Returns the grid file of a surface z(x, y) over a square of edge `size` around 0 [m]."""
    nodes = round(size / cell) + 1
    x = np.linspace(-0.5 * size, 0.5 * size, nodes)
    height = np.broadcast_to(surface(x[None, :], x[:, None]), (nodes, nodes))
    return grid_bytes(height, cell=cell, origin=(-0.5 * size, -0.5 * size), kind=kind)


class Ground:
    """A terrain of the C library; ValueError with its message for bytes that are none."""

    def __init__(self, core: ct.CDLL, file: bytes) -> None:
        self.core = bound(core)
        message = ct.create_string_buffer(MESSAGE_SIZE)
        self.handle = core.hx_terrain_create(file, len(file), message)
        if not self.handle:
            raise ValueError(message.value.decode())

    def __del__(self) -> None:
        if getattr(self, "handle", None):
            self.core.hx_terrain_destroy(self.handle)

    @property
    def checksum(self) -> int:
        """The checksum of the file."""
        return int(self.core.hx_terrain_checksum(self.handle))

    def face(self, point: Any, kind: int = NEAREST) -> tuple[float, Array, Array]:
        """Returns distance, normal and its derivative (3, 3) at a point."""
        place = np.array(point, dtype=float)
        out = probed(
            self.core.hx_probe_face, ct.c_void_p(self.handle), ct.c_int(kind), place, size=10
        )
        xx, yy, zz, xy, xz, yz = out[4:]
        return float(out[0]), out[1:4], np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])

    def depth_bound(self, centre: Any, radius: float) -> float:
        """Returns the upper bound of a sphere's depth [m]."""
        place = np.array(centre, dtype=float)
        handle = ct.c_void_p(self.handle)
        return float(
            probed(self.core.hx_probe_depth_bound, handle, place, float(radius), size=1)[0]
        )


def start_on_grid(plant: Plant, ground: Ground, *, height: float = 0.0, **initial: Any) -> None:
    """Resets a plant on a grid whose zero is at `height` [m]."""
    d = definition(plant.robot, **initial)
    d.terrain.kind, d.terrain.height = GRID, height
    plant.core.hx_plant_set_terrain(plant.handle, ground.handle)
    plant.reset(d)


def on_grid(core: ct.CDLL, robot: Robot, ground: Ground, **initial: Any) -> Plant:
    """Returns a plant on a grid; the caller keeps the ground."""
    plant = Plant(core, robot)
    start_on_grid(plant, ground, **initial)
    return plant
