"""A co-simulation FMU opened through fmpy: parameters by name, variables in blocks whose arrays are
made once.

The master needs only what protocols.py says of a plant.
"""

from __future__ import annotations

import ctypes
import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import chdir
from functools import cached_property, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Any, Self

import numpy as np
from fmpy import extract
from fmpy.fmi2 import FMU2Slave
from numpy.typing import NDArray

from hexapod_cosim.cosim.common.plant_files import packed_binary
from hexapod_cosim.cosim.interface.descriptions import read_description
from hexapod_cosim.cosim.master.fmu_log import STATUS, WARNING, FmuLog
from hexapod_cosim.models.errors import FmuError, nearest_name, unknown_name

LAST_SUCCESSFUL_TIME = 2  # fmi2StatusKind
SUFFIX = {
    "Real": "Real",
    "Integer": "Integer",
    "Enumeration": "Integer",
    "Boolean": "Boolean",
}  # of fmi2Get..., fmi2Set...


class StepError(FmuError):
    """A step that the FMU discarded or refused; `reached` is the last time it vouches for [s],
    NaN when it does not say.
    """

    def __init__(self, what: str, *, reached: float, **facts: Any) -> None:
        super().__init__(what, **facts)
        self.reached = reached


class FmuBlock:
    """A block of an FMU. The arguments of its calls are made once, as C has them, so that a call
    converts and allocates nothing.

    `buffer`: a contiguous array for the values, float64 for Reals, int32 else; without one the
    block makes its own.
    """

    def __init__(
        self,
        fmu: Fmu,
        names: Sequence[str],
        kind: str,
        references: Sequence[int],
        buffer: NDArray[Any] | None,
    ) -> None:
        dtype = np.dtype(np.float64 if kind == "Real" else np.int32)
        values = np.zeros(len(names), dtype) if buffer is None else buffer
        if values.dtype != dtype or values.shape != (len(names),) or not values.flags.c_contiguous:
            got = f"{values.dtype} {values.shape}, {values.strides[:1]} bytes apart"
            raise FmuError(
                "not a buffer for these variables",
                got=got,
                expected=f"{dtype} ({len(names)},), contiguous",
            )
        self.names, self.values = tuple(names), values
        self._fmu = fmu
        numbers, size, address = (
            (ctypes.c_uint * len(names))(*references),
            ctypes.c_size_t(len(names)),
            ctypes.c_void_p(values.ctypes.data),
        )
        self._get, self._set = (
            fmu.bind(f"fmi2{verb}{SUFFIX[kind]}", numbers, size, address) for verb in ("Get", "Set")
        )

    def get(self) -> None:
        """Reads all values from the FMU. Raises FmuError."""
        self._fmu.forget()
        status = self._get()
        if status > WARNING:
            raise self._fmu.failure("the FMU does not give its outputs", status)

    def put(self) -> int:
        """Hands all values to the FMU. Returns its status."""
        self._fmu.forget()
        return self._set()

    def set(self) -> None:
        """Hands all values to the FMU. Raises FmuError."""
        self._fmu.forget()
        status = self._set()
        if status > WARNING:
            raise self._fmu.failure("the FMU does not take its inputs", status)


class Fmu:
    """One instance of an FMI 2.0 co-simulation FMU; a context manager that frees it. Raises
    FmuError when it is none.
    """

    def __init__(self, path: str | Path, *, name: str = "plant") -> None:
        self.path = Path(path)
        self.description = read_description(self.path)
        self.variables = {variable.name: variable for variable in self.description.modelVariables}
        self._logged = FmuLog()
        self._log = self._logged.messages
        self.forget = self._log.clear  # what the FMU said before a call is of no interest after it
        self._directory = TemporaryDirectory(prefix="hexapod-fmu-")
        self._slave: Any = None
        try:
            self._instantiate(name)
        except Exception as error:
            self.close()
            raise self._not_loaded(error) from error

    def _instantiate(self, name: str) -> None:
        """Unpacks, loads the binary and makes the instance, every message of which lands in our
        log.
        """
        extract(self.path, self._directory.name)
        identifier = self.description.coSimulation.modelIdentifier
        library = packed_binary(self._directory.name, identifier)
        facts = {
            "guid": self.description.guid,
            "modelIdentifier": identifier,
            "unzipDirectory": self._directory.name,
        }
        with chdir(
            Path.cwd()
        ):  # fmpy leaves the working folder changed when the library does not load
            slave = FMU2Slave(instanceName=name, libraryPath=library, **facts)
        try:
            slave.instantiate(callbacks=self._logged.callbacks, loggingOn=True)
        except Exception:
            slave.freeLibrary()
            raise
        self._slave = slave
        self._begin, self._length = ctypes.c_double(), ctypes.c_double()
        self._reset = self.bind("fmi2Reset")
        self._do_step = self.bind(
            "fmi2DoStep", self._begin, self._length, ctypes.c_int(1)
        )  # 1: nothing before is needed again

    def _not_loaded(self, error: Exception) -> FmuError:
        said = self._log[-1] if self._log else str(error)
        fix = "export it again on this machine with `hexapod export`"
        return FmuError("the FMU cannot be loaded", got=said, fix=fix, where=str(self.path))

    @cached_property
    def sha256(self) -> str:
        """Of the file, in hex."""
        return hashlib.sha256(self.path.read_bytes()).hexdigest()

    @property
    def component(self) -> int:
        """The instance, as C has it."""
        return int(self._slave.component)

    def address(self, name: str) -> int:
        """Where a C function of the FMU is."""
        return int(ctypes.cast(getattr(self._slave.dll, name), ctypes.c_void_p).value or 0)

    def bind(self, name: str, *arguments: Any) -> Callable[[], int]:
        """A C function of the FMU with its arguments, as C has them, in place: called, it returns
        the status.

        The arguments are of the types that fmpy declares, so its function goes without the
        conversion it would make at every call.
        """
        function = getattr(self._slave.dll, name)
        unchecked = ctypes.cast(function, ctypes.CFUNCTYPE(function.restype))
        return partial(unchecked, ctypes.c_void_p(self._slave.component), *arguments)

    def failure(self, what: str, status: int) -> FmuError:
        """The error for a call that came back with `status`, in the FMU's own words where it
        gave any.
        """
        return FmuError(what, got=self._said(status), where=self.path.name)

    def _said(self, status: int) -> str:
        return self._log[-1] if self._log else f"status {STATUS[status]} without a message"

    def names(self, causality: str, kind: str = "Real") -> list[str]:
        """Names of all variables of a causality and an FMI type, in the order of the model
        description.
        """
        return [
            name
            for name, variable in self.variables.items()
            if variable.causality == causality and variable.type == kind
        ]

    def references(self, names: Sequence[str]) -> list[int]:
        """Value references by name. Raises FmuError for a name the FMU lacks."""
        for name in names:
            if name not in self.variables:
                raise self._unknown(name)
        return [self.variables[name].valueReference for name in names]

    def block(self, names: Sequence[str], buffer: NDArray[Any] | None = None) -> FmuBlock:
        """The named variables, all of one type, as a block, its values in `buffer` if given.
        Raises FmuError for a name the FMU lacks.
        """
        references = self.references(names)
        kinds = {self.variables[name].type for name in names} or {"Real"}
        if len(kinds) != 1:
            raise FmuError(
                "a block holds variables of one type", got=sorted(kinds), where=str(self.path)
            )
        return FmuBlock(self, names, kinds.pop(), references, buffer)

    def parameters(self) -> dict[str, float]:
        """All parameters with the values that hold now; an enumeration's is the number of its
        item.
        """
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
        """Sets parameters by name, enumerations by the name of their item. Before `initialise`.
        Raises FmuError, naming the parameter.
        """
        self.set_blocks(self.parameter_blocks(values))

    def parameter_blocks(self, values: Mapping[str, Any]) -> list[FmuBlock]:
        """Blocks that hold these parameters, to be set again and again. Raises FmuError for what
        is no parameter or no value of it.
        """
        kinds: dict[str, dict[str, float]] = {}
        for name, value in values.items():
            kind = self.variables[self._parameter(name)].type
            kinds.setdefault(kind, {})[name] = self._number(name, value)
        blocks = [self.block(list(numbers)) for numbers in kinds.values()]
        for block, numbers in zip(blocks, kinds.values(), strict=True):
            block.values[:] = list(numbers.values())
        return blocks

    def set_blocks(self, blocks: Sequence[FmuBlock]) -> None:
        """Sets parameters. Before `initialise`. Raises FmuError, naming the parameter."""
        for whole in blocks:
            if whole.put() > WARNING:
                self._set_one_by_one(dict(zip(whole.names, whole.values.tolist(), strict=True)))

    def _set_one_by_one(self, numbers: Mapping[str, float]) -> None:
        """To name the one that is refused."""
        for name, value in numbers.items():
            block = self.block([name])
            block.values[0] = value
            status = block.put()
            if status > WARNING and self._log:
                raise FmuError(
                    self._said(status), where=self.path.name
                )  # its sentence has name, value and range
            if status > WARNING:
                raise FmuError(
                    f"{name}: the FMU refuses the value", got=value, where=self.path.name
                )

    def _parameter(self, name: str) -> str:
        if name not in self.variables:
            raise self._unknown(
                name,
                [
                    known
                    for known, variable in self.variables.items()
                    if variable.causality == "parameter"
                ],
            )
        kind = self.variables[name].causality
        if kind != "parameter":
            fix = (
                "[[events]] push the torso" if name.startswith("torso.push") else "set a parameter"
            )
            raise FmuError(
                "not a parameter",
                got=name,
                expected=f"a parameter, and this is an {kind}",
                fix=fix,
                where=self.path.name,
            )
        return name

    def _number(self, name: str, value: Any) -> float:
        """The value as the FMU takes it."""
        variable = self.variables[name]
        items = (
            {item.name: item.value for item in variable.declaredType.items}
            if variable.type == "Enumeration"
            else {}
        )
        if isinstance(value, str) and items:
            if value not in items:
                raise unknown_name(f"choice for {name}", value, items, error=FmuError)
            return int(items[value])
        if not isinstance(value, int | float):
            raise FmuError(
                f"parameter {name} is refused",
                got=value,
                expected=f"a number [{variable.unit or '1'}]",
                fix="give a number",
            )
        return value

    def _unknown(self, name: str, valid: Sequence[str] = ()) -> FmuError:
        near = nearest_name(name, valid or self.variables)
        fix = f"did you mean {near!r}?" if near else "`fmpy info` lists the names it has"
        return FmuError("the FMU has no such variable", got=name, fix=fix, where=str(self.path))

    def initialise(self, start: float, stop: float) -> None:
        """Compiles the parameters and puts the robot into its initial state at time `start` [s].
        Raises FmuError.
        """
        calls = (
            lambda: self._slave.setupExperiment(startTime=start, stopTime=stop),
            self._slave.enterInitializationMode,
            self._slave.exitInitializationMode,
        )
        for call in calls:
            self.forget()
            try:
                call()
            except Exception as error:
                said = self._log[-1] if self._log else str(error)
                raise FmuError(
                    "the FMU cannot be initialised", got=said, where=str(self.path)
                ) from error

    def reset(self) -> None:
        """Back to how it was made: start values, not initialised. Raises FmuError."""
        self.forget()
        status = self._reset()
        if status > WARNING:
            raise self.failure("the FMU cannot be reset", status)

    def step(self, t: float, h: float) -> None:
        """Steps from t to t + h [s]. Raises StepError."""
        self.forget()
        self._begin.value, self._length.value = t, h
        status = self._do_step()
        if status > WARNING:
            raise self.step_failure(t, status)

    def step_failure(self, t: float, status: int) -> StepError:
        """The error for a step from t [s] that came back with `status`."""
        said, reached = self._said(status), self._reached(status)
        return StepError(
            f"the FMU {STATUS[status]}s the step from {t:.6g} s",
            reached=reached,
            got=said,
            where=self.path.name,
        )

    def _reached(self, status: int) -> float:
        if STATUS[status] != "discard":
            return math.nan
        try:
            return float(self._slave.getRealStatus(LAST_SUCCESSFUL_TIME))
        except Exception:  # fmpy's own error type: the FMU does not say
            return math.nan

    def close(self) -> None:
        """Frees the instance and what was unpacked; harmless when called twice."""
        slave, self._slave = self._slave, None
        if slave is not None:
            slave.fmiCallLogger = None
            slave.freeInstance()
        self._directory.cleanup()
        self._logged.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()
