"""Structures, constants and statuses of hexapod.h in ctypes, read from the headers.

test_plant_functions.py compares the structures with the compiler's layout.
"""

from __future__ import annotations

import ctypes as ct
from pathlib import Path
from typing import Any

from hexapod_cosim.cosim.master.loop_library import Header

ROOT = Path(__file__).resolve().parents[2]
HEADER = Header(
    *(
        ROOT / f"plant_fmu/include/hexapod/{name}.h"
        for name in ("legs", "status", "terrain", "generated/plant_settings", "hexapod")
    )
)
LEGS: int = HEADER.constants["HX_LEGS"]
JOINTS: int = HEADER.constants["HX_JOINTS"]
BODIES: int = HEADER.constants["HX_BODIES"]
BODY_STATE: int = HEADER.constants["HX_BODY_STATE"]
MULTIPLIERS: int = HEADER.constants["HX_MULTIPLIERS"]
MESSAGE_SIZE: int = HEADER.constants["HX_MESSAGE_SIZE"]
CONE_BINS: int = HEADER.constants["HX_CONE_BINS"]
OK, INVALID_ARGUMENT, INVALID_MODEL, STEP_TOO_SMALL, NOT_FINITE, OUT_OF_MEMORY, BAD_STATE = range(7)

Real = ct.c_double
Doubles = ct.POINTER(Real)
HxLink: Any = HEADER.types["hxLink"]
HxLeg: Any = HEADER.types["hxLeg"]
HxSoilDefinition: Any = HEADER.types["hxSoilDefinition"]
HxDefinition: Any = HEADER.types["hxDefinition"]
HxInput: Any = HEADER.types["hxInput"]
HxCoordinates: Any = HEADER.types["hxCoordinates"]
HxOutput: Any = HEADER.types["hxOutput"]
