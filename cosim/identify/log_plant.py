"""Drives the plant FMU with the commands of a log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.common.closing import Closing
from hexapod_cosim.cosim.identify.log import Log, LogError
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.models import FmuError

Array = NDArray[np.float64]
Event = tuple[float, bool, int]  # time [s], whether it is a command, row of the log
SAME_TIME = 1e-9  # s    events closer than this are one


class LogPlant(Closing):
    """A plant FMU that is reset for each simulation of a log; a context manager that frees it.

    Args:
        fmu: the plant's file.
        parameters: parameters of all simulations, by name.
    """

    def __init__(self, fmu: Path, parameters: Mapping[str, Any] | None = None) -> None:
        self.fmu = Fmu(fmu)
        self._common = self.fmu.parameter_blocks(parameters or {})
        self._outputs = set(self.fmu.names("output"))

    def known(self, names: Sequence[str]) -> list[str]:
        """Returns those of some columns that follow from outputs of the FMU."""
        return [name for name in names if self._outputs.issuperset(_terms(name))]

    def simulate(
        self,
        log: Log,
        names: Sequence[str],
        parameters: Mapping[str, float],
        *,
        offset: Array | None = None,
        delay: float = 0.0,
    ) -> Array:
        """Simulates a log and returns outputs at the times of its rows (rows, names).

        Args:
            log: its commands are the FMU's inputs; each holds until the next row.
            names: outputs of the FMU, or motor angles.
            parameters: initial state and further parameters.
            offset: added to the commanded angles (18,) [rad]; None: nothing.
            delay: how much older than its row a reading is [s].

        Raises FmuError for a parameter that is refused, LogError for a refused command or step.
        """
        commands, time = log.commands, log.time
        inputs = self.fmu.block(list(commands))
        sources = list(dict.fromkeys(term for name in names for term in _terms(name)))
        outputs = self.fmu.block(sources)
        table = np.column_stack(list(commands.values()))
        if offset is not None:
            places = [k for k, name in enumerate(commands) if name.endswith(".angle_ref")]
            table[:, places] += offset
        self.fmu.reset()
        self.fmu.set_blocks(self._common)
        self.fmu.set_parameters(parameters)
        self.fmu.initialise(float(time[0]), float(time[-1]))
        found = np.empty((len(time), len(sources)))
        try:
            self._run(_events(time, delay), table, inputs, outputs, found)
        except FmuError as error:
            raise LogError(
                "the plant cannot follow the log",
                got=str(error),
                expected="a robot that can move as the log says",
                fix="check the robot file and the units of the commands",
                where=log.where,
            ) from error
        return _summed(found, sources, names)

    def _run(
        self, events: Sequence[Event], table: Array, inputs: Any, outputs: Any, found: Array
    ) -> None:
        now = events[0][0]
        for time, is_command, row in events:
            if time - now > SAME_TIME:
                self.fmu.step(now, time - now)
                now = time
            if is_command:
                inputs.values[:] = table[row]
                inputs.set()
            else:
                outputs.get()
                found[row] = outputs.values

    def close(self) -> None:
        """Frees the FMU."""
        self.fmu.close()


def _terms(name: str) -> tuple[str, ...]:
    """Returns the outputs of the FMU whose sum a column is.

    The angle of a rotor, seen at its joint, is the link's and the deflection of the gear.
    """
    stem, _, kind = name.rpartition(".")
    return (f"{stem}.angle", f"{stem}.gear_deflection") if kind == "motor_angle" else (name,)


def _summed(found: Array, sources: Sequence[str], names: Sequence[str]) -> Array:
    """Returns the columns (rows, names) from outputs of the FMU (rows, sources)."""
    if list(names) == list(sources):
        return found
    places = [[sources.index(term) for term in _terms(name)] for name in names]
    return np.column_stack([found[:, own].sum(axis=1) for own in places])


def _events(time: Array, delay: float) -> list[Event]:
    """Returns all readings and commands in order of time; a reading comes before the command of
    the same time, as the master reads. Readings from before the first row are of the first row.
    """
    readings = np.maximum(time - delay, time[0]).tolist()
    events = [(t, False, k) for k, t in enumerate(readings)]
    events += [(t, True, k) for k, t in enumerate(time[:-1].tolist())]
    return sorted(events)
