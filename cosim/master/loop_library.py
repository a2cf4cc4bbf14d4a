"""Loads the co-simulation library (cosim/master/src) and compares its structures with Python's."""

from __future__ import annotations

import ctypes as ct

from hexapod_cosim.cosim.common.plant_files import BUILD, LOOP, shared_library
from hexapod_cosim.models import FmuError


def load_loop(layout: tuple[str, int], size: tuple[str, int]) -> ct.CDLL:
    """Returns the library whose structures have the layout and size that the caller declares.

    Args:
        layout: the library's function that returns the number of the layout, and the caller's.
        size: the function that returns the size of the structure, and the caller's, B.

    Raises FmuError when the library is missing or has other structures.
    """
    path = shared_library(LOOP)
    library = ct.CDLL(str(path))
    got = 0, 0
    if hasattr(library, layout[0]) and hasattr(library, size[0]):
        getattr(library, size[0]).restype = ct.c_size_t
        got = int(getattr(library, layout[0])()), int(getattr(library, size[0])())
    if got != (layout[1], size[1]):
        raise FmuError(
            "the co-simulation library is another version's",
            got=f"layout {got[0]} of {got[1]} bytes",
            expected=f"layout {layout[1]} of {size[1]} bytes",
            fix=BUILD,
            where=str(path),
        )
    return library
