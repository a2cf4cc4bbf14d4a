"""The structures and functions of environments.h for ctypes, and what a batch has to free."""

from __future__ import annotations

import ctypes as ct
import os
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache, partial
from itertools import pairwise
from pathlib import Path
from queue import SimpleQueue

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
    return load_loop("environments", "hx_environments_settings_size", "hxEnvSettings", HEADER)


Job = Callable[[], None]


def work(jobs: SimpleQueue[Job | None], done: SimpleQueue[None]) -> None:
    """Does jobs until there is None; the thread of a batch."""
    while (job := jobs.get()) is not None:
        job()
        done.put(None)


@dataclass
class Owned:
    """Threads, environments and the plant's FMU of one batch.

    It has no reference to the batch, so that a batch that nobody closed can be freed by it.
    """

    handle: int | None = None  # of hxEnvironments
    count: int = 1  # of environments
    threads: int = 1  # that share the environments, with the calling one
    workers: list[threading.Thread] = field(default_factory=list)
    jobs: SimpleQueue[Job | None] = field(default_factory=SimpleQueue)
    done: SimpleQueue[None] = field(default_factory=SimpleQueue)
    plant: Fmu | None = None
    process: int = field(default_factory=os.getpid)  # that made them

    def call(self, function: Callable[..., None], handle: int, *given: int | None) -> None:
        """Calls a function in C for all environments, in each thread with a share of them.

        In a process that was forked from the one that made the threads it uses the calling one
        alone.
        """
        if self.threads == 1 or os.getpid() != self.process:
            function(handle, 0, self.count, *given)
            return
        while len(self.workers) < self.threads - 1:
            self.workers.append(
                threading.Thread(target=work, args=(self.jobs, self.done), daemon=True)
            )
            self.workers[-1].start()
        ends = [self.count * share // self.threads for share in range(self.threads + 1)]
        for first, end in pairwise(ends[1:]):
            self.jobs.put(partial(function, handle, first, end, *given))
        function(handle, 0, ends[1], *given)
        for _ in self.workers:
            self.done.get()

    def free(self) -> None:
        """Ends the threads and frees the environments; may be called twice.

        In a process that was forked from the one that made them it frees nothing: the threads do
        not exist there, and the unpacked files belong to the first process.
        """
        handle, self.handle = self.handle, None
        if os.getpid() != self.process:
            return
        if handle:
            for _ in self.workers:
                self.jobs.put(None)
            for worker in self.workers:
                worker.join()
            environments_library().hx_environments_destroy(handle)
        if self.plant:
            self.plant.close()
        self.workers.clear()
        self.plant = None
