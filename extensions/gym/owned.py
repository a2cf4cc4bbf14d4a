"""What a batch of environments has to free: threads, environments in C, FMUs."""

from __future__ import annotations

import os
import threading
from dataclasses import dataclass, field

from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.extensions.gym.native import environments_library


@dataclass
class Owned:
    """Threads, environments and FMUs of one batch.

    It has no reference to the batch, so that a batch that nobody closed can be freed by it.
    """

    handle: int | None = None  # of hxEnvironments
    servers: list[threading.Thread] = field(default_factory=list)
    fmus: list[Fmu] = field(default_factory=list)
    process: int = field(default_factory=os.getpid)  # that made them

    def serve(self, count: int) -> None:
        """Starts a number of threads that work for the environments."""
        for _ in range(count):
            server = threading.Thread(
                target=environments_library().hx_environments_serve,
                args=(self.handle,),
                daemon=True,
            )
            server.start()
            self.servers.append(server)

    def free(self) -> None:
        """Ends the threads and frees the environments; may be called twice.

        In a process that was forked from the one that made them it frees nothing: the threads do
        not exist there, and the unpacked files belong to the first process.
        """
        handle, self.handle = self.handle, None
        if os.getpid() != self.process:
            return
        if handle:
            environments_library().hx_environments_stop(handle)
            for server in self.servers:
                server.join()
            environments_library().hx_environments_destroy(handle)
        for fmu in self.fmus:
            fmu.close()
        self.servers.clear()
        self.fmus.clear()
