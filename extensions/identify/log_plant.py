"""Drives the plant FMU with the commands of a log."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.common.closing import Closing
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.extensions.identify.log import Log, LogError
from hexapod_cosim.models import FmuError

Array = NDArray[np.float64]
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
        self.watch: Callable[[], None] = lambda: None  # called after each simulation
        self._outputs = set(self.fmu.names("output"))
        # of the log that was simulated last: its commands, and the events of some delays
        self._last: tuple[Log, list[str], Array] | None = None
        self._ordered: tuple[Log, tuple[float, ...], list[Event]] | None = None

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
        delay: float | Sequence[float] = 0.0,
    ) -> Array:
        """Simulates a log and returns outputs at the times of its rows (rows, names).

        Args:
            log: its commands are the FMU's inputs; each holds until the next row.
            names: outputs of the FMU, or motor angles.
            parameters: initial state and further parameters.
            offset: added to the commanded angles (18,) [rad]; None: nothing.
            delay: how much older than its row a reading is [s]; one for all, or one for each name.

        Raises FmuError for a parameter that is refused, LogError for a refused command or step.
        """
        time = log.time
        commands, table = self._commands(log)
        inputs = self.fmu.block(commands)
        late = [delay] * len(names) if isinstance(delay, float | int) else list(delay)
        delays = list(dict.fromkeys(late))
        # outputs that are read at the same time, one block for each delay
        sources = [
            list(dict.fromkeys(
                term for name, own in zip(names, late, strict=True) if own == one
                for term in _terms(name)
            ))
            for one in delays
        ]  # fmt: skip
        outputs = [self.fmu.block(own) for own in sources]
        if offset is not None:
            table = table.copy()
            places = [k for k, name in enumerate(commands) if name.endswith(".angle_ref")]
            table[:, places] += offset
        self.fmu.reset()
        self.fmu.set_blocks(self._common)
        self.fmu.set_parameters(parameters)
        self.fmu.initialise(float(time[0]), float(time[-1]))
        found = [np.empty((len(time), len(own))) for own in sources]
        try:
            self._run(self._in_order(log, delays), table, inputs, outputs, found)
        except FmuError as error:
            raise LogError(
                "the plant cannot follow the log",
                got=str(error),
                expected="a robot that can move as the log says",
                fix="check the robot file and the units of the commands",
                where=log.where,
            ) from error
        columns = {
            (one, term): values[:, k]
            for one, own, values in zip(delays, sources, found, strict=True)
            for k, term in enumerate(own)
        }
        self.watch()
        return _summed(columns, names, late)

    def _commands(self, log: Log) -> tuple[list[str], Array]:
        """Returns names and rows of a log's commands (rows, names), which nobody may change."""
        if self._last is None or self._last[0] is not log:
            commands = log.commands
            self._last = log, list(commands), np.column_stack(list(commands.values()))
        return self._last[1], self._last[2]

    def _in_order(self, log: Log, delays: Sequence[float]) -> list[Event]:
        """Returns the events of a log with some delays; those of the last ones are kept."""
        key = tuple(delays)
        last = self._ordered
        if last is None or last[0] is not log or last[1] != key:
            self._ordered = last = log, key, _events(log.time, delays)
        return last[2]

    def _run(
        self,
        events: Sequence[Event],
        table: Array,
        inputs: Any,
        outputs: Sequence[Any],
        found: Sequence[Array],
    ) -> None:
        step, rows = self.fmu.step, [(one.get, one.values) for one in outputs]
        now = events[0][0]
        for time, is_command, row, which in events:
            if time - now > SAME_TIME:
                step(now, time - now)
                now = time
            if is_command:
                inputs.values[:] = table[row]
                inputs.set()
            else:
                get, values = rows[which]
                get()
                found[which][row] = values

    def close(self) -> None:
        """Frees the FMU."""
        self.fmu.close()


def _terms(name: str) -> tuple[str, ...]:
    """Returns the outputs of the FMU whose sum a column is.

    The angle of a rotor, seen at its joint, is the link's and the deflection of the gear.
    """
    stem, _, kind = name.rpartition(".")
    return (f"{stem}.angle", f"{stem}.gear_deflection") if kind == "motor_angle" else (name,)


def _summed(
    columns: Mapping[tuple[float, str], Array], names: Sequence[str], delays: Sequence[float]
) -> Array:
    """Returns columns (rows, names) from outputs of the FMU, by their delay and name."""
    found = []
    for name, delay in zip(names, delays, strict=True):
        first, *more = (columns[delay, term] for term in _terms(name))
        found.append(sum(more, start=first))
    return np.column_stack(found)


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
