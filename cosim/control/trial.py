"""Loads an FMU in a process of its own before this process loads it.

A shared library that has its full length and damaged contents cannot be told from a sound one by
its header, and may end the process that loads it.
"""

from __future__ import annotations

from contextlib import suppress
from functools import lru_cache
from pathlib import Path

from hexapod_cosim.cosim.common.files import file_stamp
from hexapod_cosim.cosim.common.own_process import ProcessEndedError, call_in_process
from hexapod_cosim.cosim.control.fmu_instance import open_controller_fmu
from hexapod_cosim.cosim.interface.descriptions import open_description
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.models import FmuError

MAX_TRIED = 64  # files whose trials are kept; the least recently used one goes first


def refuse_crashing(path: Path) -> None:
    """Raises FmuError for an FMU that ends the process that instantiates it.

    An FMU that cannot be read is not judged: whoever opens it says why. A file is tried once in
    a process unless it changes.
    """
    how = _try_once(path.absolute(), *file_stamp(path)) if path.is_file() else None
    if how is not None:
        raise FmuError(
            "the FMU's binary ends the process that loads it",
            got=how,
            expected="an instance",
            fix="the binary is damaged or made for another system: export the FMU again",
            where=str(path),
        )


@lru_cache(maxsize=MAX_TRIED)
def _try_once(path: Path, _changed: int, _size: int) -> str | None:
    """Returns how a process ended that instantiated the FMU; None if it went on."""
    try:
        call_in_process(instantiate, path)
    except ProcessEndedError as error:
        return str(error)
    return None


def instantiate(path: Path) -> None:
    """Instantiates an FMU of a plant or controller and frees it; ignores errors that it reports."""
    with suppress(FmuError):
        if open_description(path).fmiVersion == "2.0":
            Fmu(path).close()
        else:
            open_controller_fmu(path).close()
