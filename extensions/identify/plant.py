"""Drives the plant FMU with the commands of a log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hexapod_cosim.cosim.common.temporary import Closing
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.extensions.identify.log import Log, LogError
from hexapod_cosim.models import FmuError
from hexapod_cosim.models.arrays import Array

# time [s], whether it is a command, row of the log, which of the delays
Event = tuple[float, bool, int, int]
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
        """Returns those of some columns that are outputs of the FMU."""
        return [name for name in names if name in self._outputs]

    def simulate(
        self,
        log: Log,
        names: Sequence[str],
        parameters: Mapping[str, float],
        *,
        offset: Array | None = None,
        delay: float | Sequence[float] = 0.0,
    ) -> Array:
        """Simulates a log and returns outputs at the times of its rows (rows, names).

        Args:
            log: its commands are the FMU's inputs; each holds until the next row.
            names: outputs of the FMU.
            parameters: initial state and further parameters.
            offset: added to the commanded angles (18,) [rad]; None: nothing.
            delay: how much older than its row a reading is [s]; one for all, or one for each name.

        Raises FmuError for a parameter that is refused, LogError for a refused command or step.
        """
        late = [delay] * len(names) if isinstance(delay, float | int) else list(delay)
        # outputs that are read at the same time, by their delay
        sources: dict[float, dict[str, None]] = {}
        for name, own in zip(names, late, strict=True):
            sources.setdefault(own, {})[name] = None
        commands = log.commands
        table = np.column_stack(list(commands.values()))
        if offset is not None:
            places = [k for k, name in enumerate(commands) if name.endswith(".angle_ref")]
            table[:, places] += offset
        self._begin(log.time, parameters)
        outputs = [self.fmu.block(list(own)) for own in sources.values()]
        try:
            found = self._run(
                log.time, list(sources), table, self.fmu.block(list(commands)), outputs
            )
        except FmuError as error:
            raise LogError(
                "the plant cannot follow the log",
                got=str(error),
                expected="a robot that can move as the log says",
                fix="check the robot file and the units of the commands",
                where=log.where,
            ) from error
        columns = {
            (name, own): values[:, k]
            for (own, block), values in zip(sources.items(), found, strict=True)
            for k, name in enumerate(block)
        }
        return np.column_stack([columns[pair] for pair in zip(names, late, strict=True)])

    def _begin(self, time: Array, parameters: Mapping[str, float]) -> None:
        """Resets and initialises the FMU. Raises FmuError for a parameter that is refused."""
        self.fmu.reset()
        self.fmu.set_blocks(self._common)
        self.fmu.set_parameters(parameters)
        self.fmu.initialise(float(time[0]), float(time[-1]))

    def _run(
        self, time: Array, delays: Sequence[float], table: Array, inputs: Any, outputs: list[Any]
    ) -> list[Array]:
        """Simulates rows of commands; returns the outputs of each block (rows, outputs).

        This is no macro-step: nothing controls, and readings lie between the commands by delays of
        their own.
        """
        found = [np.empty((len(time), len(one.values))) for one in outputs]
        step, rows = self.fmu.step, [(one.get, one.values) for one in outputs]
        now = float(time[0])
        for at, is_command, row, which in _events(time, delays):
            if at - now > SAME_TIME:
                step(now, at - now)
                now = at
            if is_command:
                inputs.values[:] = table[row]
                inputs.set()
            else:
                get, values = rows[which]
                get()
                found[which][row] = values
        return found

    def close(self) -> None:
        """Frees the FMU."""
        self.fmu.close()


def _events(time: Array, delays: Sequence[float]) -> list[Event]:
    """Returns all readings and commands in order of time; a reading comes before the command of
    the same time, as the master reads. Readings from before the first row are of the first row.
    """
    events = [
        (t, False, k, which)
        for which, delay in enumerate(delays)
        for k, t in enumerate(np.maximum(time - delay, time[0]).tolist())
    ]
    events += [(t, True, k, 0) for k, t in enumerate(time[:-1].tolist())]
    return sorted(events)
