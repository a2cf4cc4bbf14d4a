"""The structures and functions of environments.h for ctypes, and what a batch has to free."""

from __future__ import annotations

import ctypes as ct
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from hexapod_cosim.cosim.interface.names import foot_names, joint_names, vector_names
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.master.loop_library import Header, load_loop, loop_header
from hexapod_cosim.cosim.master.sensors import MEASURED

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
LIBRARY = "hexapod_gym"
PATH = Path(__file__).parent / "loop" / "include" / "hexapod" / "environments.h"
HEADER = Header(PATH, base=loop_header())
NativeFmu, NativeDraws = HEADER.types["hxEnvFmu"], HEADER.types["hxEnvDraws"]
NativeSettings, NativeArrays = HEADER.types["hxEnvSettings"], HEADER.types["hxEnvArrays"]
ARRAYS = tuple(name for name, _ in NativeArrays._fields_)
AUTORESET = ("next_step", "same_step", "disabled")  # hxAutoreset
# outputs of the plant in the order of hxEnvPlace
OUTPUTS = [
    *MEASURED["angle"],
    *MEASURED["speed"],
    *MEASURED["foot_force"],
    *MEASURED["quaternion"],
    *MEASURED["angular_velocity"],
    *joint_names("torque"),
    *vector_names("torso.position"),
    *vector_names("torso.velocity"),
    *vector_names("torso.contact_force"),
    *foot_names("slip_distance"),
]


@cache
def environments_library() -> ct.CDLL:
    """Loads the C loop and declares its functions.

    Raises FmuError when the library is missing or has another version.
    """
    size = "hx_environments_settings_size"
    return load_loop(LIBRARY, HEADER, "environments", size, "hxEnvSettings")


@dataclass
class Owned:
    """Threads, environments and the plant's FMU of one batch.

    It has no reference to the batch, so that a batch that nobody closed can be freed by it.
    """

    handle: int | None = None  # of hxEnvironments
    pool: ThreadPoolExecutor | None = None  # of all threads but the calling one
    plant: Fmu | None = None
    process: int = field(default_factory=os.getpid)  # that made them

    @property
    def is_inherited(self) -> bool:
        """Whether this process was forked from the one that made them: it has no threads."""
        return os.getpid() != self.process

    def free(self) -> None:
        """Ends the threads and frees the environments; may be called twice.

        An inherited batch frees nothing: the unpacked files belong to the first process.
        """
        handle, self.handle = self.handle, None
        if self.is_inherited:
            return
        if self.pool:
            self.pool.shutdown()
        if handle:
            environments_library().hx_environments_destroy(handle)
        if self.plant:
            self.plant.close()
        self.plant = None
