"""Opens a controller FMU of FMI 2.0 or FMI 3.0 and reads and writes its variables in blocks."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import chdir, suppress
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from fmpy import platform_tuple
from fmpy.fmi3 import FMU3Slave
from numpy.typing import NDArray

from hexapod_cosim.cosim.common.archives import unpack
from hexapod_cosim.cosim.common.binaries import refuse_incomplete
from hexapod_cosim.cosim.common.files import file_stamp
from hexapod_cosim.cosim.common.own_process import ProcessEndedError, call_in_process
from hexapod_cosim.cosim.common.temporary import TemporaryFolder
from hexapod_cosim.cosim.interface.descriptions import open_description
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.master.fmu_block import FmuVariable, StepError, type_of_block
from hexapod_cosim.models import FmuError
from hexapod_cosim.models.errors import suggestion

REAL3, FLAG3 = ("Float64", "Float32"), "Boolean"
MAX_TRIED = 64  # files whose trials are kept; the least recently used one goes first


def open_controller_fmu(path: Path) -> Fmu | ControllerFmu3:
    """Opens a controller FMU of FMI 2.0 or 3.0 for co-simulation. Raises FmuError."""
    description = open_description(path)
    if description.coSimulation is None or description.fmiVersion not in ("2.0", "3.0"):
        kind = "co-simulation" if description.coSimulation else "model exchange only"
        raise FmuError(
            "a controller FMU of a wrong kind",
            got=f"FMI {description.fmiVersion}, {kind}",
            expected="FMI 2.0 or 3.0 for co-simulation",
            fix="export it for co-simulation",
            where=str(path),
        )
    try:
        if description.fmiVersion == "2.0":
            return Fmu(path, name="controller")
        return ControllerFmu3(path, description)
    except FmuError as error:
        raise FmuError(
            "the controller FMU cannot be loaded",
            got=error.got,
            expected=error.expected,
            fix="make it for this platform, with the libraries that it needs",
            where=str(path),
        ) from error


class Block3:
    """Variables of one type of an FMI 3.0 FMU that are read or written in one call."""

    def __init__(self, fmu: ControllerFmu3, names: Sequence[str], kind: str, size: int) -> None:
        self.names = tuple(names)
        self.values: NDArray[Any] = np.zeros(size, np.int32 if kind == FLAG3 else np.float64)
        self._references = [fmu.variables[name].valueReference for name in names]
        self._fmu, self._kind = fmu, kind

    def get(self) -> None:
        """Reads all values. Raises FmuError."""
        read = getattr(self._fmu.slave, f"get{self._kind}")
        self.values[:] = self._fmu.called(
            lambda: read(self._references, len(self.values)), "the FMU does not give its outputs"
        )

    def set(self) -> None:
        """Writes all values. Raises FmuError."""
        write = getattr(self._fmu.slave, f"set{self._kind}")
        values = self.values.tolist()
        if self._kind == FLAG3:
            values = [bool(value) for value in values]
        self._fmu.called(
            lambda: write(self._references, values), "the FMU does not take its inputs"
        )


class ControllerFmu3:
    """An instance of a controller FMU of FMI 3.0."""

    def __init__(self, path: Path, description: Any) -> None:
        self.path = path
        self.variables = {variable.name: variable for variable in description.modelVariables}
        self._messages: list[str] = []
        self._initialised = False
        self._directory = TemporaryFolder("fmu")
        self.slave: Any = None
        try:
            unpack(path, self._directory.path)
            identifier = description.coSimulation.modelIdentifier
            for library in (self._directory.path / "binaries" / platform_tuple).glob("*"):
                refuse_incomplete(library)
            with chdir(Path.cwd()):
                slave = FMU3Slave(
                    guid=description.guid,
                    modelIdentifier=identifier,
                    unzipDirectory=str(self._directory.path),
                    instanceName="controller",
                )
            slave.instantiate(logMessage=self._log, loggingOn=True)
        except Exception as error:
            self._directory.close()
            what, expected = "the FMU cannot be loaded", f"a binary for {platform_tuple}"
            raise FmuError(what, got=str(error), expected=expected, where=str(path)) from error
        self.slave = slave

    def _log(self, _environment: Any, _status: Any, _category: Any, message: Any) -> None:
        self._messages.append(message.decode(errors="replace") if message else "")

    @property
    def described(self) -> list[FmuVariable]:
        """The variables of the FMU, of all causalities."""
        return [
            FmuVariable(
                name, variable.causality, variable.type in REAL3, variable.type == FLAG3,
                self._size(name),
            )
            for name, variable in self.variables.items()
        ]  # fmt: skip

    def _size(self, name: str) -> int:
        """Returns the number of elements of a variable; 0 where the FMU fixes it later."""
        sizes = [item.start for item in self.variables[name].dimensions or []]
        return 0 if None in sizes else math.prod(int(size) for size in sizes)

    def block(self, names: Sequence[str]) -> Block3:
        """Returns a block of variables of one type. Raises FmuError for several types."""
        kind = type_of_block(self.variables, names, "Float64", where=str(self.path))
        return Block3(self, names, kind, sum(self._size(name) for name in names))

    def set_parameters(self, values: Mapping[str, Any]) -> None:
        """Sets parameters by name. Raises FmuError."""
        for name, value in values.items():
            variable = self.variables.get(name)
            if variable is None or variable.causality != "parameter":
                raise FmuError(
                    "the FMU has no such parameter",
                    got=name,
                    fix=suggestion(name, self.variables, otherwise="take it away"),
                    where=str(self.path),
                )
            convert = float if variable.type in REAL3 else bool if variable.type == FLAG3 else int
            items = value if isinstance(value, list | tuple) else [value]
            kind = variable.type if variable.type != "Enumeration" else "Int64"
            write = getattr(self.slave, f"set{kind}")
            self.called(
                partial(write, [variable.valueReference], [convert(item) for item in items]),
                f"the FMU refuses parameter {name}",
            )

    def called(self, call: Callable[[], Any], what: str) -> Any:
        """Returns what a call of the FMU returns. Raises FmuError with the FMU's last message."""
        self._messages.clear()
        try:
            return call()
        except Exception as error:
            got = self._messages[-1] if self._messages else str(error)
            raise FmuError(what, got=got, where=self.path.name) from error

    def initialise(self, start: float, stop: float, begin: Callable[[], None]) -> None:
        """Initialises the FMU; calls `begin`, which sets its inputs, in initialisation mode."""
        what = "the FMU cannot be initialised"
        self.called(
            lambda: self.slave.enterInitializationMode(startTime=start, stopTime=stop), what
        )
        begin()
        self.called(self.slave.exitInitializationMode, what)
        self._initialised = True

    def step(self, t: float, h: float) -> None:
        """Steps from t to t + h [s]. Raises StepError."""
        what = f"the FMU refuses the step from {t:.6g} s"
        *_, early, reached = self.called(
            lambda: self.slave.doStep(currentCommunicationPoint=t, communicationStepSize=h), what
        )
        if early:
            raise StepError(
                "the controller FMU returned early from its step", reached=reached,
                got=reached, expected=t + h, where=self.path.name,
            )  # fmt: skip

    def close(self) -> None:
        """Terminates and frees the instance; may be called twice."""
        slave, self.slave = self.slave, None
        if slave is not None:
            with suppress(Exception):
                if self._initialised:
                    slave.terminate()
            with suppress(Exception):
                slave.freeInstance()
        self._directory.close()


def refuse_crashing(path: Path) -> None:
    """Raises FmuError for an FMU that ends the process that instantiates it.

    A shared library that has its full length and damaged contents cannot be known by its header.
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
