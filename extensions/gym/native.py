"""The structures and functions of environments.h for ctypes."""

from __future__ import annotations

import ctypes as ct
from functools import cache

from hexapod_cosim.cosim.master.loop_library import load_loop
from hexapod_cosim.extensions.gym.settings import BLOCKS, JOINTS, TERMS

LAYOUT = 1  # of the structures below, HX_ENVIRONMENTS_LAYOUT in C
# functions of an FMU in the order of hxEnvFmu
CALLS = (
    *("Instantiate", "FreeInstance", "Reset", "SetupExperiment", "EnterInitializationMode"),
    *("ExitInitializationMode", "GetReal", "SetReal", "DoStep"),
)
WORK = ("hx_shared_work_size", "hx_shared_work_use")  # which a foreign FMU does not have

Pointer, Size = ct.c_void_p, ct.c_size_t


class NativeFmu(ct.Structure):
    """hxEnvFmu in C."""

    _fields_ = [
        *((name, Pointer) for name in CALLS),
        ("guid", ct.c_char_p),
        ("resources", ct.c_char_p),
        *((name, Pointer) for name in WORK),
    ]


class NativeDraws(ct.Structure):
    """hxEnvDraws in C."""

    _fields_ = [
        *((name, Pointer) for name in ("reference", "low", "high", "whole", "group")),
        ("count", Size),
    ]


class NativeGround(ct.Structure):
    """hxEnvGround in C."""

    _fields_ = [
        ("height", Pointer), ("place", Pointer),
        *((name, Size) for name in ("count", "rows", "columns", "points", "draw")),
        *((name, ct.c_double) for name in ("x0", "y0", "spacing", "clearance")),
    ]  # fmt: skip


class NativeSettings(ct.Structure):
    """hxEnvSettings in C."""

    _fields_ = [
        ("plant", NativeFmu), ("controller", NativeFmu),
        *((name, Pointer) for name in (
            "plant_output", "plant_input", "controller_input", "controller_output")),
        ("draws", NativeDraws), ("ground", NativeGround),
        ("h", ct.c_double), ("substeps", Size), ("length", Size),
        ("stance", ct.c_double * JOINTS), ("action_scale", ct.c_double * JOINTS),
        ("action_limit", ct.c_double), ("observed", ct.c_double * 3 * len(BLOCKS)),
        ("clock", ct.c_double),
        ("command_low", ct.c_double * 3), ("command_high", ct.c_double * 3),
        ("command_interval", Size),
        ("push_interval", Size), ("push_length", Size), ("push_force", ct.c_double),
        ("upright", ct.c_double), ("belly_force", ct.c_double),
        ("weight", ct.c_double * len(TERMS)), ("width", ct.c_double * 2),
        ("autoreset", ct.c_int),
    ]  # fmt: skip


ARRAYS = (  # of hxEnvArrays in C
    *("action", "observation", "last", "reward", "term"),
    *("terminated", "truncated", "refused", "reason"),
)


class NativeArrays(ct.Structure):
    """hxEnvArrays in C."""

    _fields_ = [(name, Pointer) for name in ARRAYS]


@cache
def environments_library() -> ct.CDLL:
    """Loads the C loop and declares its functions.

    Raises FmuError when the library is missing or has another version.
    """
    library = load_loop(
        ("hx_environments_layout", LAYOUT),
        ("hx_environments_settings_size", ct.sizeof(NativeSettings)),
    )
    library.hx_environments_create.restype = Pointer
    library.hx_environments_create.argtypes = [Pointer, Pointer, Size, ct.c_char_p]
    library.hx_environments_message.restype = ct.c_char_p
    library.hx_environments_message.argtypes = [Pointer, Size]
    library.hx_environments_reset.argtypes = [Pointer] * 3
    for name in ("drawn", "values"):
        getattr(library, f"hx_environments_{name}").argtypes = [Pointer, Size, Pointer]
    for name in ("step", "serve", "stop", "destroy"):
        getattr(library, f"hx_environments_{name}").argtypes = [Pointer]
    for name in ("reset", "step", "serve", "stop", "destroy", "drawn", "values"):
        getattr(library, f"hx_environments_{name}").restype = None
    return library
