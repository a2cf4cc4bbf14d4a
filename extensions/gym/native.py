"""The structures and functions of environments.h for ctypes."""

from __future__ import annotations

import ctypes as ct
from functools import cache
from pathlib import Path

from hexapod_cosim.cosim.master.loop_library import Header, load_loop, loop_header

# functions of an FMU by the members of hxEnvFmu
CALLS = {
    "instantiate": "fmi2Instantiate",
    "free_instance": "fmi2FreeInstance",
    "reset": "fmi2Reset",
    "setup": "fmi2SetupExperiment",
    "enter": "fmi2EnterInitializationMode",
    "leave": "fmi2ExitInitializationMode",
    "work_size": "hx_shared_work_size",  # which a foreign FMU does not have, like the next
    "work_use": "hx_shared_work_use",
}
PATH = Path(__file__).parent / "loop" / "include" / "hexapod" / "environments.h"
HEADER = Header(PATH, base=loop_header())
NativeFmu, NativeDraws = HEADER.types["hxEnvFmu"], HEADER.types["hxEnvDraws"]
NativeGround, NativeSettings = HEADER.types["hxEnvGround"], HEADER.types["hxEnvSettings"]
NativeArrays = HEADER.types["hxEnvArrays"]
ARRAYS = tuple(name for name, _ in NativeArrays._fields_)


@cache
def environments_library() -> ct.CDLL:
    """Loads the C loop and declares its functions.

    Raises FmuError when the library is missing or has another version.
    """
    return load_loop("environments", "hx_environments_settings_size", "hxEnvSettings", HEADER)
