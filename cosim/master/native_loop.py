"""Runs the master's loop in C (src/master.c) on a plant FMU and a controller FMU.

It computes the same walk as `loop.run` with an `FmuController`. Python loads, initialises and
frees the FMUs; the C loop drives them through FMI functions alone, for some macro-steps at a time
and without the interpreter's lock. Interrupts are handled between these calls.
"""

from __future__ import annotations

import ctypes as ct
from collections.abc import Sequence
from functools import cache
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.master.fmu_controller import COMMANDS
from hexapod_cosim.cosim.master.force_sensor import SensorSettings, noise_factors
from hexapod_cosim.cosim.master.interrupts import interruptible
from hexapod_cosim.cosim.master.loop import COMPLETED, FAILED, INTERRUPTED, Outcome, Progress
from hexapod_cosim.cosim.master.loop_library import load_loop
from hexapod_cosim.cosim.master.recorder import COMMAND_COLUMNS, Peaks, Recording, kept_moments
from hexapod_cosim.cosim.master.signals import (
    ACCELERATION,
    MEASURED,
    PUSH,
    check_plant_variables,
)
from hexapod_cosim.cosim.master.wiring import (
    JOINT_COMMANDS,
    Names,
    Wiring,
    ours,
    own_wiring,
    theirs,
)
from hexapod_cosim.cosim.scenario.schedule import Schedule
from hexapod_cosim.models import LEG_NAMES, FmuError

LAYOUT = 2  # of the structures below, HX_MASTER_LAYOUT in C
BLOCK_ROWS = 8  # HX_MASTER_BLOCK in C
STEPS_PER_CALL = 500  # macro-steps between two checks for interrupts, about 10 ms
FORCE = MEASURED["foot_force"]

_Size = ct.c_size_t
_Pointer = ct.c_void_p


class _Fmu(ct.Structure):
    """hxMasterFmu in C."""

    _fields_ = [
        (name, _Pointer) for name in ("instance", "get_real", "get_boolean", "set_real", "do_step")
    ]


class _Block(ct.Structure):
    """hxMasterBlock in C."""

    _fields_ = [("reference", _Pointer), ("count", _Size), ("place", _Size)]


class _Sensor(ct.Structure):
    """hxMasterSensor in C."""

    _fields_ = [(name, _Pointer) for name in ("factor", "fault", "memory")] + [
        (name, _Size) for name in ("delay", "feet", "forces", "place", "reading")
    ]


class _Table(ct.Structure):
    """hxMasterTable in C."""

    _fields_ = [
        ("column", _Pointer),
        ("columns", _Size),
        ("first", _Pointer),
        ("stride", _Size),
        ("rows", _Size),
        ("block", _Pointer),
        ("waiting", _Size),
    ]


class _Peaks(ct.Structure):
    """hxMasterPeaks in C."""

    _fields_ = [
        ("place", _Pointer), ("places", _Size), ("count", _Pointer), ("counts", _Size),
        *((name, _Pointer) for name in ("largest", "seen", "kept")),
    ]  # fmt: skip


class _Master(ct.Structure):
    """hxMaster in C."""

    _fields_ = [
        *((name, _Fmu) for name in ("plant", "controller")),
        *(
            (name, _Block)
            for name in (
                "plant_output",
                "plant_flag",
                "plant_input",
                "controller_output",
                "controller_flag",
            )
        ),
        *(
            (name, _Pointer)
            for name in ("flag", "value", "controller_input", "controller_value", "sensed")
        ),
        *((name, _Size) for name in ("command_count", "sensed_count")),
        ("sensor", _Sensor),
        *((name, _Pointer) for name in ("time", "command", "push")),
        *((name, _Size) for name in ("push_count", "push_place")),
        ("h", ct.c_double),
        ("kept", _Table),
        ("every", _Size),
        ("peaks", _Peaks),
        ("judged", _Table),
        ("step", _Size),
        *((name, ct.c_int) for name in ("call", "status")),
    ]


# hxMasterCall, from 1: the FMU and the message; "" for a step, whose message is made by the FMU
CALLS = (
    ("plant", "the FMU does not give its outputs"),
    ("plant", "the FMU does not take its inputs"),
    ("plant", ""),
    ("controller", "the FMU does not give its outputs"),
    ("controller", "the FMU does not take its inputs"),
    ("controller", ""),
)


@cache
def _library() -> ct.CDLL:
    """Loads the C loop and declares its functions' types.

    Raises FmuError when the library is missing or has another version.
    """
    library = load_loop(("hx_master_layout", LAYOUT), ("hx_master_size", ct.sizeof(_Master)))
    library.hx_master_begin.argtypes = library.hx_master_record.argtypes = [ct.POINTER(_Master)]
    library.hx_master_run.argtypes = [ct.POINTER(_Master), _Size]
    library.hx_master_record.restype = None
    return library


class NativeMaster:
    """A plant FMU connected to a controller FMU, for any number of successive runs.

    `columns`: the signals to record; None for all. `judged`: the signals to keep for every
    macro-step where `columns` are kept for fewer. `wiring`: the connected variables of a controller
    FMU with other names or fewer variables than ours; the controller's columns are recorded as far
    as it has them. Raises FmuError when an FMU lacks variables that every FMU of `hexapod export`
    has.
    """

    def __init__(
        self,
        plant: Fmu,
        controller: Fmu,
        *,
        columns: Sequence[str] | None = None,
        judged: Sequence[str] = (),
        wiring: Wiring | None = None,
    ) -> None:
        self._library, self._fmus = _library(), {"plant": plant, "controller": controller}
        outputs, flags = plant.names("output"), plant.names("output", "Boolean")
        check_plant_variables(outputs, plant.names("input"), flags)
        self._wiring = wired = own_wiring(plant, controller) if wiring is None else wiring
        shown = {"diagnostics": wired.diagnostics, "flags": wired.flags}  # of the controller
        if columns is not None:  # read only what is recorded or needed by the controller
            wanted = {*columns, *ours(wired.measured), *FORCE}
            outputs = [name for name in outputs if name in wanted]
            flags = [name for name in flags if name in wanted]
            shown = {
                key: tuple(pair for pair in pairs if f"controller.{pair[0]}" in wanted)
                for key, pairs in shown.items()
            }
        shown_names = [f"controller.{name}" for pairs in shown.values() for name in ours(pairs)]
        self._commands = ours(wired.outputs)
        inputs = [name for name in (*JOINT_COMMANDS, *ACCELERATION) if name in plant.variables]
        kept = [name for name in inputs if name not in self._commands]  # these stay 0
        self._places = {
            name: place
            for place, name in enumerate(
                (*outputs, *flags, *PUSH, *self._commands, *shown_names, *kept)
            )
        }
        self._reading = len(self._places)  # the sensors' readings come last and are not recorded
        self._value = np.zeros(self._reading + len(FORCE))
        self.columns = tuple(
            self._places
            if columns is None
            else [
                name
                for name in columns
                if name in self._places or not name.startswith("controller.")
            ]
        )
        self._judged = tuple(name for name in self.columns if name in set(judged))
        self._arrays: list[NDArray[Any]] = []  # keeps alive what the structure points to
        self._master = self._make_master(outputs, flags, **shown)

    def _make_master(
        self,
        outputs: list[str],
        plant_flags: list[str],
        *,
        diagnostics: Names,
        flags: Names,
    ) -> _Master:
        """Fills the part of the structure that is the same in all runs."""
        plant, controller = self._fmus["plant"], self._fmus["controller"]
        commands, sensed = self._wiring.commands, self._wiring.measured
        given = [*theirs(self._wiring.outputs), *theirs(diagnostics)]
        place = self._places[self._commands[0]]
        peaks = Peaks(tuple(self._places))
        peak_memory = {
            name: self._keep(np.zeros(len(peaks.places))) for name in ("largest", "seen", "kept")
        }
        flag_count = max(len(plant_flags), len(flags))
        return _Master(
            plant=_functions(plant),
            controller=_functions(controller),
            plant_output=self._block(plant, outputs),
            plant_flag=self._block(plant, plant_flags),
            plant_input=self._block(plant, [*PUSH, *self._commands]),
            controller_output=self._block(controller, given, place),
            controller_flag=self._block(controller, theirs(flags), place + len(given)),
            flag=self._keep(np.zeros(flag_count, dtype=np.int32)),
            value=self._value.ctypes.data,
            controller_input=self._references(controller, theirs((*commands, *sensed))),
            controller_value=self._keep(np.zeros(len(commands) + len(sensed))),
            command_count=len(commands),
            sensed_count=len(sensed),
            push_count=len(PUSH),
            push_place=self._places[PUSH[0]],
            kept=self._table(self.columns),
            judged=self._table(self._judged),
            peaks=_Peaks(
                self._indices(peaks.places),
                len(peaks.places),
                self._indices(peaks.counts),
                len(peaks.counts),
                **peak_memory,
            ),
        )

    def _keep(self, array: NDArray[Any]) -> int:
        """Returns the address of an array and keeps the array alive as long as this object."""
        self._arrays.append(array)
        return int(array.ctypes.data)

    def _table(self, columns: Sequence[str]) -> _Table:
        """Returns a table without rows."""
        return _Table(
            column=self._indices([self._places[name] for name in columns]),
            columns=len(columns),
            block=self._keep(np.zeros((BLOCK_ROWS, len(columns)))),
        )

    def _indices(self, places: Sequence[int]) -> int:
        return self._keep(np.array(places, dtype=np.uintp))

    def _references(self, fmu: Fmu, names: Sequence[str]) -> int:
        return self._keep(np.array(fmu.references(names), dtype=np.uint32))

    def _block(self, fmu: Fmu, names: Sequence[str], place: int | None = None) -> _Block:
        return _Block(
            self._references(fmu, names),
            len(names),
            self._places[names[0]] if place is None else place,
        )

    def run(
        self,
        schedule: Schedule,
        *,
        h: float,
        every: int = 1,
        sensor: SensorSettings | None = None,
        progress: Progress | None = None,
    ) -> Outcome:
        """Runs both initialised FMUs over the whole schedule in macro-steps of h [s].

        One of `every` macro-steps is recorded. Works as `loop.run`, but never raises.
        """
        master = self._master
        kept = _allocate_rows(master.kept, self.columns, schedule, every)
        judged = _allocate_rows(master.judged, self._judged, schedule, 1) if every > 1 else None
        if judged is None:
            master.judged.first = None
        self._value[:] = 0.0
        arrays = self._point_to_run(schedule, sensor)
        master.h, master.every = h, every
        for fmu in self._fmus.values():
            fmu.clear_log()
        begin = perf_counter()
        status, reason, cause = self._run_steps(schedule.times, h, progress)
        wall, recording = perf_counter() - begin, _recording(self.columns, kept, master.kept)
        every_step = recording
        if judged is not None:
            every_step = _recording(self._judged, judged, master.judged)
        del arrays  # the C loop needs them until here
        simulated = float(every_step.time[-1] - schedule.times[0]) if len(every_step.time) else 0.0
        return Outcome(status, reason, simulated, wall, recording, cause, every_step)

    def _point_to_run(
        self, schedule: Schedule, sensor: SensorSettings | None
    ) -> list[NDArray[Any]]:
        """Points the structure to the arrays of this run and returns them to be kept alive."""
        master, count = self._master, len(schedule.rows)
        chosen = [COMMANDS.index(name) for name in ours(self._wiring.commands)]
        arrays: dict[str, NDArray[Any] | None] = {
            "time": schedule.times,
            "command": schedule.rows[:, chosen],
            "push": schedule.pushes,
        }
        reals = {
            name: None if array is None else np.ascontiguousarray(array, dtype=np.float64)
            for name, array in arrays.items()
        }
        for name, array in reals.items():
            setattr(master, name, None if array is None else array.ctypes.data)
        parts, sensed = {}, self._places[FORCE[0]]
        if sensor is not None:
            parts = {
                "memory": np.zeros((sensor.delay + 1, len(FORCE))),
                "factor": noise_factors(sensor, count),
                "fault": None if sensor.faults is None else sensor.faults.kind,
            }
        master.sensor = _Sensor(
            **{name: array.ctypes.data for name, array in parts.items() if array is not None},
            delay=0 if sensor is None else sensor.delay,
            feet=len(LEG_NAMES),
            forces=len(FORCE),
            place=sensed,
            reading=self._reading,
        )
        force = self._reading if parts else sensed
        places = [
            force + FORCE.index(name) if name in FORCE else self._places[name]
            for name in ours(self._wiring.measured)
        ]
        where = np.array(places, dtype=np.uintp)
        master.sensed = where.ctypes.data
        return [array for array in (*reals.values(), *parts.values(), where) if array is not None]

    def _run_steps(
        self, times: NDArray[np.float64], h: float, progress: Progress | None
    ) -> tuple[str, str, Exception | None]:
        """Runs all macro-steps; returns status, reason and cause of the outcome."""
        master, library, steps = self._master, self._library, len(times) - 1
        try:
            with interruptible():
                going = library.hx_master_begin(master)
                while going and master.step < steps:
                    going = library.hx_master_run(master, min(master.step + STEPS_PER_CALL, steps))
                    if progress is not None and going:
                        progress(master.step * h)
                if going:
                    library.hx_master_record(master)
                    return COMPLETED, "", None
        except KeyboardInterrupt:
            return INTERRUPTED, "interrupted", None
        error = self._error(float(times[master.step]))
        return FAILED, str(error), error

    def _error(self, t: float) -> FmuError:
        """Returns the error that ended the macro-step at t [s], worded as the Python master's."""
        which, what = CALLS[self._master.call - 1]
        fmu, status = self._fmus[which], self._master.status
        return fmu.failure(what, status) if what else fmu.step_failure(t, status)


def _allocate_rows(
    table: _Table, columns: Sequence[str], schedule: Schedule, every: int
) -> NDArray[np.float64]:
    """Allocates the rows of a table, fills times and commands, and points the table to them.

    Columns adjoin in memory, because metrics read columns.
    """
    moments = kept_moments(len(schedule.rows), every)
    data = np.empty((len(moments), 1 + len(columns) + len(COMMAND_COLUMNS)), order="F")
    data[:, 0], data[:, 1 + len(columns) :] = schedule.times[moments], schedule.rows[moments]
    table.first, table.stride = data.ctypes.data + data.strides[1], len(moments)
    return data


def _recording(columns: Sequence[str], data: NDArray[np.float64], table: _Table) -> Recording:
    return Recording(("time", *columns, *COMMAND_COLUMNS), data[: table.rows])


def _functions(fmu: Fmu) -> _Fmu:
    return _Fmu(
        fmu.component,
        *(
            fmu.address(name)
            for name in ("fmi2GetReal", "fmi2GetBoolean", "fmi2SetReal", "fmi2DoStep")
        ),
    )
