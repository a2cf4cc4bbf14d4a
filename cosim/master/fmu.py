"""Opens a co-simulation FMU through fmpy and reads and writes its variables in blocks."""

from __future__ import annotations

import ctypes
import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import chdir, suppress
from functools import cached_property, partial
from pathlib import Path
from typing import Any

from fmpy.fmi2 import FMU2Slave
from numpy.typing import NDArray

from hexapod_cosim.cosim.common.archives import unpack
from hexapod_cosim.cosim.common.binaries import refuse_incomplete
from hexapod_cosim.cosim.common.plant_files import packed_binary
from hexapod_cosim.cosim.common.temporary import Closing, TemporaryFolder
from hexapod_cosim.cosim.interface.descriptions import read_description
from hexapod_cosim.cosim.master.fmu_block import (
    STATUS,
    WARNING,
    FmuBlock,
    FmuLog,
    FmuVariable,
    StepError,
    parameter_number,
    type_of_block,
)
from hexapod_cosim.models.errors import FmuError, check_type, suggestion

LAST_SUCCESSFUL_TIME = 2  # fmi2StatusKind


class Fmu(Closing):
    """One instance of an FMI 2.0 co-simulation FMU; a context manager that frees it.

    Raises FmuError when the file cannot be loaded as such an FMU.
    """

    def __init__(self, path: str | Path, *, name: str = "plant") -> None:
        check_type(path, (str, Path), "the path of an FMU", where="path", error=FmuError)
        self.path = Path(path)
        self.description = read_description(self.path)
        self.variables = {variable.name: variable for variable in self.description.modelVariables}
        self.log = FmuLog(self.path.name)
        self._directory = TemporaryFolder("fmu")
        self._slave: Any = None
        self._initialised = False
        try:
            self._instantiate(name)
        except Exception as error:
            message = self.log.last(str(error))
            self.close()
            if isinstance(error, FmuError):
                raise
            fix = "export it again on this machine with `hexapod export`"
            raise FmuError(
                "the FMU cannot be loaded", got=message, fix=fix, where=str(self.path)
            ) from error

    def _instantiate(self, name: str) -> None:
        """Unpacks the FMU, loads its binary and creates the instance, which logs to our FmuLog."""
        unpack(self.path, self._directory.path)
        identifier = self.description.coSimulation.modelIdentifier
        library = packed_binary(self._directory.path, identifier)
        if library is not None:
            refuse_incomplete(library)
        facts = {
            "guid": self.description.guid,
            "modelIdentifier": identifier,
            "unzipDirectory": str(self._directory.path),
        }
        with chdir(Path.cwd()):  # fmpy does not restore the folder when the library fails to load
            slave = FMU2Slave(instanceName=name, libraryPath=library, **facts)
        try:
            slave.instantiate(callbacks=self.log.callbacks, loggingOn=True)
        except Exception:
            slave.freeLibrary()
            raise
        self._slave = slave
        self._begin, self._length = ctypes.c_double(), ctypes.c_double()
        self._reset = self.bind("fmi2Reset")
        no_state_prior = ctypes.c_int(1)  # noSetFMUStatePriorToCurrentPoint = true
        self._do_step = self.bind("fmi2DoStep", self._begin, self._length, no_state_prior)

    @property
    def described(self) -> list[FmuVariable]:
        """The variables of the FMU, of all causalities."""
        return [
            FmuVariable(
                name, variable.causality, variable.type == "Real", variable.type == "Boolean", 1
            )
            for name, variable in self.variables.items()
        ]

    @cached_property
    def sha256(self) -> str:
        """SHA-256 of the FMU file, in hex."""
        return hashlib.sha256(self.path.read_bytes()).hexdigest()

    @property
    def resources(self) -> Path:
        """Folder of the unpacked resources of this instance."""
        return self._directory.path / "resources"

    @property
    def component(self) -> int:
        """Pointer to the instance (fmi2Component) as an integer."""
        return int(self._slave.component)

    def address(self, name: str) -> int:
        """Returns the address of a C function of the FMU, 0 if its binary does not have it."""
        function = getattr(self._slave.dll, name, None)
        return int(ctypes.cast(function, ctypes.c_void_p).value or 0) if function else 0

    def bind(self, name: str, *arguments: Any) -> Callable[[], int]:
        """Returns a call of a C function of the FMU with fixed arguments; it returns the status.

        The arguments must have the types that fmpy declares: the call skips fmpy's conversion.
        """
        function = getattr(self._slave.dll, name)
        unchecked = ctypes.cast(function, ctypes.CFUNCTYPE(function.restype))
        return partial(unchecked, ctypes.c_void_p(self._slave.component), *arguments)

    def names(self, causality: str, kind: str = "Real") -> list[str]:
        """Names of all variables of a causality and FMI type, in model description order."""
        return [
            name
            for name, variable in self.variables.items()
            if (variable.causality, variable.type) == (causality, kind)
        ]

    def references(self, names: Sequence[str]) -> list[int]:
        """Value references by name. Raises FmuError for a name the FMU lacks."""
        for name in names:
            if name not in self.variables:
                raise self._unknown(name)
        return [self.variables[name].valueReference for name in names]

    def block(self, names: Sequence[str], buffer: NDArray[Any] | None = None) -> FmuBlock:
        """Returns a block of the named variables, which must all have one type.

        The values stand in `buffer` if one is given. Raises FmuError for an unknown name and for
        several types.
        """
        references = self.references(names)
        kind = type_of_block(self.variables, names, "Real", where=str(self.path))
        return FmuBlock(self.bind, self.log, names, kind, references, buffer)

    def parameters(self) -> dict[str, float]:
        """Returns the present values of all parameters; enumerations as the number of the item."""
        found: dict[str, float] = {}
        for block in self._parameter_blocks:
            block.get()
            found |= dict(zip(block.names, block.values.tolist(), strict=True))
        return found

    @cached_property
    def _parameter_blocks(self) -> list[FmuBlock]:
        names = (
            self.names("parameter", kind) for kind in ("Real", "Integer", "Enumeration", "Boolean")
        )
        return [self.block(some) for some in names if some]

    def set_parameters(self, values: Mapping[str, Any]) -> None:
        """Sets parameters by name, enumerations by the name of their item, before `initialise`.

        Raises FmuError, which names the parameter.
        """
        self.set_blocks(self.parameter_blocks(values))

    def parameter_blocks(self, values: Mapping[str, Any]) -> list[FmuBlock]:
        """Returns blocks that hold these parameter values and can be set repeatedly.

        Raises FmuError for a name that is no parameter or a value that it cannot take.
        """
        kinds: dict[str, dict[str, float]] = {}
        for name, value in values.items():
            variable = self._parameter(name)
            kinds.setdefault(variable.type, {})[name] = parameter_number(variable, value)
        blocks = [self.block(list(numbers)) for numbers in kinds.values()]
        for block, numbers in zip(blocks, kinds.values(), strict=True):
            block.values[:] = list(numbers.values())
        return blocks

    def set_blocks(self, blocks: Sequence[FmuBlock]) -> None:
        """Sets blocks of parameters, before `initialise`. Raises FmuError, naming the parameter."""
        for block in blocks:
            if block.try_set() > WARNING:
                self._set_one_by_one(dict(zip(block.names, block.values.tolist(), strict=True)))

    def _set_one_by_one(self, numbers: Mapping[str, float]) -> None:
        """Sets parameters one at a time, so that the error names the one that is refused."""
        for name, value in numbers.items():
            block = self.block([name])
            block.values[0] = value
            status = block.try_set()
            if status > WARNING and self.log.messages:  # the message has name, value and range
                raise FmuError(self.log.last_of(status), where=self.path.name)
            if status > WARNING:
                what, fix = f"{name}: the FMU refuses the value", "give one in its range"
                raise FmuError(what, got=value, fix=fix, where=self.path.name)

    def _parameter(self, name: str) -> Any:
        """Returns the variable of a parameter. Raises FmuError when the name is none."""
        variable = self.variables.get(name)
        if variable is None:
            raise self._unknown(name, [n for b in self._parameter_blocks for n in b.names])
        if variable.causality != "parameter":
            raise FmuError(
                "not a parameter",
                got=name,
                expected=f"a parameter, and this is an {variable.causality}",
                fix="set a parameter; [[events]] push the torso",
                where=self.path.name,
            )
        return variable

    def _unknown(self, name: str, valid: Sequence[str] = ()) -> FmuError:
        otherwise = "`fmpy info` lists the names it has"
        fix = suggestion(name, valid or self.variables, otherwise=otherwise)
        return FmuError("the FMU has no such variable", got=name, fix=fix, where=str(self.path))

    def initialise(
        self, start: float, stop: float, begin: Callable[[], None] = lambda: None
    ) -> None:
        """Initialises the FMU with its parameters and initial state at time `start` [s].

        begin: is called in initialisation mode, and may set inputs. Raises FmuError.
        """
        slave = self._slave
        self._call_to_initialise(lambda: slave.setupExperiment(startTime=start, stopTime=stop))
        self._call_to_initialise(slave.enterInitializationMode)
        begin()
        self._call_to_initialise(slave.exitInitializationMode)
        self._initialised = True

    def _call_to_initialise(self, call: Callable[[], Any]) -> None:
        """Calls a function of fmpy. Raises FmuError with the FMU's last message."""
        self.log.clear()
        try:
            call()
        except Exception as error:
            got = self.log.last(str(error))
            what, fix = "the FMU cannot be initialised", "correct the parameters that it names"
            raise FmuError(what, got=got, fix=fix, where=str(self.path)) from error

    def reset(self) -> None:
        """Resets the instance to its start values, not initialised. Raises FmuError."""
        self.log.clear()
        status = self._reset()
        if status > WARNING:
            raise self.log.failure("the FMU cannot be reset", status)
        self._initialised = False

    def step(self, t: float, h: float) -> None:
        """Steps from t to t + h [s]. Raises StepError."""
        self.log.clear()
        self._begin.value, self._length.value = t, h
        status = self._do_step()
        if status > WARNING:
            raise self.step_failure(t, status)

    def step_failure(self, t: float, status: int) -> StepError:
        """Returns the error for a step from t [s] that returned `status`."""
        message, reached = self.log.last_of(status), math.nan
        if STATUS[status] == "discard":
            with suppress(Exception):  # fmpy's own error type: the FMU does not report the time
                reached = float(self._slave.getRealStatus(LAST_SUCCESSFUL_TIME))
        return StepError(
            f"the FMU {STATUS[status]}s the step from {t:.6g} s",
            reached=reached,
            got=message,
            where=self.path.name,
        )

    def close(self) -> None:
        """Frees the instance and deletes the unpacked files; may be called twice."""
        slave, self._slave = self._slave, None
        if slave is not None:
            if self._initialised:
                with suppress(Exception):  # an FMU that fails to terminate is freed all the same
                    slave.terminate()
            slave.fmiCallLogger = None
            slave.freeInstance()
        self._directory.close()
        self.log.close()
