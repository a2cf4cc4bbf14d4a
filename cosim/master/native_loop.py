"""Runs the master's loop in C (src/master.c) on a plant FMU and a controller FMU.

It computes the same walk as `loop.run` with the controller FMU. Python loads, initialises and frees
the FMUs; the C loop drives them through FMI functions alone, for some macro-steps at a time and
without the interpreter's lock. Interrupts are handled between these calls.
"""

from __future__ import annotations

import ctypes as ct
from collections.abc import Sequence
from itertools import chain
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.master.connection import Connection, Pairs, connect
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.master.interrupts import interruptible
from hexapod_cosim.cosim.master.loop import (
    COMPLETED,
    FAILED,
    INTERRUPTED,
    Outcome,
    Progress,
    outcome_of,
)
from hexapod_cosim.cosim.master.loop_library import loop_header, master_library
from hexapod_cosim.cosim.master.recorder import BLOCK_ROWS, Rows
from hexapod_cosim.cosim.master.sensors import READINGS, Errors, Sensors
from hexapod_cosim.cosim.master.signals import (
    ACCELERATION,
    COMMANDS,
    JOINT_COMMANDS,
    PUSH,
    SERVOS,
    check_plant_variables,
)
from hexapod_cosim.cosim.scenario.schedule import Schedule
from hexapod_cosim.models import FmuError

FUNCTIONS = {  # members of hxStepFmu
    "get_reals": "fmi2GetReal",
    "get_flags": "fmi2GetBoolean",
    "set_reals": "fmi2SetReal",
    "do_step": "fmi2DoStep",
}
# hxStepCall: the FMU and the message; "" for a step, whose message is made by the FMU
CALLS = {
    "HX_CALL_PLANT_GET": ("plant", "the FMU does not give its outputs"),
    "HX_CALL_PLANT_SET": ("plant", "the FMU does not take its inputs"),
    "HX_CALL_PLANT_STEP": ("plant", ""),
    "HX_CALL_CONTROLLER_GET": ("controller", "the FMU does not give its outputs"),
    "HX_CALL_CONTROLLER_SET": ("controller", "the FMU does not take its inputs"),
    "HX_CALL_CONTROLLER_STEP": ("controller", ""),
}


def step_functions(fmu: Fmu, instance: int | None) -> Any:
    """Returns the functions of an FMU that a macro-step in C calls (hxStepFmu)."""
    calls = {name: fmu.address(function) for name, function in FUNCTIONS.items()}
    return loop_header().types["hxStepFmu"](instance=instance, **calls)


class NativeMaster:
    """A plant FMU connected to a controller FMU, for any number of successive runs.

    Args:
        plant: the plant.
        controller: the controller.
        connection: of the controller; by default its variables have our names.
        columns: the signals to record; None for all.
        judged: the signals to keep for every macro-step where `columns` are kept for fewer.

    Raises FmuError when an FMU lacks variables that every FMU of `hexapod export` has.
    """

    def __init__(
        self,
        plant: Fmu,
        controller: Fmu,
        connection: Connection | None = None,
        *,
        columns: Sequence[str] | None = None,
        judged: Sequence[str] = (),
    ) -> None:
        self._library, self._fmus = master_library(), {"plant": plant, "controller": controller}
        outputs, flags = plant.names("output"), plant.names("output", "Boolean")
        check_plant_variables(outputs, plant.names("input"), flags)
        if connection is None:
            where = str(controller.path)
            connection = connect(controller.described, {}, torque=False, where=where)
        shown, marks = connection.diagnostics, connection.flags
        if columns is not None:  # read only what is recorded or needed by the controller
            wanted = {*columns, *READINGS}
            outputs = [name for name in outputs if name in wanted]
            flags = [name for name in flags if name in wanted]
            shown, marks = (
                [pair for pair in pairs if f"controller.{pair[1][0]}" in wanted]
                for pairs in (shown, marks)
            )
        self._inputs = sorted(connection.inputs, key=lambda pair: pair[1][0] not in COMMANDS)
        driven, given = connection.outputs, _ours(connection.outputs)
        inputs = (*JOINT_COMMANDS, *ACCELERATION)
        undriven = [name for name in inputs if name not in given]  # these stay 0
        self._drive = [*undriven, *given]
        insides = [f"controller.{name}" for name in (*_ours(shown), *_ours(marks))]
        row = [*outputs, *flags, *SERVOS, *PUSH, *self._drive, *insides]
        self._places = {name: place for place, name in enumerate(row)}
        self._value = np.zeros(len(row) + len(READINGS))
        everything = [name for name in row if name not in SERVOS]
        self.columns = tuple(
            name
            for name in (everything if columns is None else columns)
            if name in self._places or not name.startswith("controller.")
        )
        self._judged = judged
        self._plant_inputs: dict[int, Any] = {}  # by the number of values before the drive
        self._arrays: list[NDArray[Any]] = []  # keeps alive what the structure points to
        self._master = loop_header().types["hxMaster"](
            drive_place=self._places[self._drive[0]],
            drive_count=len(self._drive),
            drive=self._keep(np.zeros(len(self._drive))),
            column=self._keep([self._places[name] for name in self.columns], np.uintp),
            columns=len(self.columns),
        )
        self._connect(outputs, flags, driven, shown, marks)

    def _connect(
        self, outputs: list[str], flags: list[str], driven: Pairs, shown: Pairs, marks: Pairs
    ) -> None:
        """Fills the stepper, which is the same in all runs."""
        stepper, plant, controller = self._master.stepper, *self._fmus.values()
        stepper.plant = step_functions(plant, plant.component)
        stepper.controller = step_functions(controller, controller.component)
        read = [*_theirs(driven), *_theirs(shown)]
        place = self._places[self._drive[-1]] + 1 - len(driven)
        stepper.plant_output = self._block(plant, outputs, 0)
        stepper.plant_flag = self._block(plant, flags, len(outputs))
        stepper.controller_output = self._block(controller, read, place)
        stepper.controller_flag = self._block(controller, _theirs(marks), place + len(read))
        stepper.controller_input = self._references(controller, _theirs(self._inputs))
        stepper.command_count = sum(name in COMMANDS for name in _ours(self._inputs))
        stepper.sensed_count = len(self._inputs) - stepper.command_count
        stepper.given = self._keep(np.zeros(len(self._inputs)))
        stepper.flag = self._keep(np.zeros(max(len(flags), len(marks)), dtype=np.int32))
        stepper.value = self._value.ctypes.data

    def _keep(self, values: Any, dtype: Any = np.float64) -> int:
        """Returns the address of an array that lives as long as this object."""
        array = values if isinstance(values, np.ndarray) else np.array(values, dtype=dtype)
        self._arrays.append(array)
        return int(array.ctypes.data)

    def _references(self, fmu: Fmu, names: Sequence[str]) -> int:
        return self._keep(fmu.references(names), np.uint32)

    def _block(self, fmu: Fmu, names: Sequence[str], place: int) -> Any:
        """Returns the variables of an FMU that one call reads or writes."""
        make = loop_header().types["hxStepBlock"]
        return make(self._references(fmu, names), len(names), place)

    def run(
        self,
        schedule: Schedule,
        *,
        h: float,
        every: int = 1,
        errors: Errors | None = None,
        progress: Progress | None = None,
    ) -> Outcome:
        """Runs both initialised FMUs over the whole schedule in macro-steps of h [s].

        One of `every` macro-steps is recorded. Works as `loop.run`, but never raises.
        """
        rows = Rows(self.columns, schedule.times, schedule.rows, every=every, judged=self._judged)
        self._value[:] = 0.0
        self._master.stepper.h = h
        arrays = self._point_to_run(schedule, errors or Errors())
        for fmu in self._fmus.values():
            fmu.log.clear()
        begin = perf_counter()
        status, reason, cause = self._run_steps(schedule.times, h, rows, progress)
        wall = perf_counter() - begin
        del arrays  # the C loop needs them until here
        return outcome_of(rows, status, reason, cause, wall=wall)

    def _point_to_run(self, schedule: Schedule, errors: Errors) -> list[Any]:
        """Points the structure to the arrays of this run and returns what must live until its
        end.
        """
        master, sensors = self._master, Sensors(errors, self._places, first=len(self._places))
        for name in ("feet", "joints", "torso"):
            setattr(master, name, getattr(sensors, name))
        pushed = self._choose_inputs(schedule)
        ours = _ours(self._inputs)
        chosen = [COMMANDS.index(name) for name in ours if name in COMMANDS]
        kept: list[Any] = [sensors]
        for name, array, kind in (
            ("time", schedule.times, np.float64),
            ("command", schedule.rows[:, chosen], np.float64),
            ("push", pushed, np.float64),
            ("lost", schedule.lost, np.uint8),
        ):
            values = None if array is None else np.ascontiguousarray(array, dtype=kind)
            setattr(master, name, None if values is None else values.ctypes.data)
            kept.append(values)
        kept.append(self._tunings(schedule))
        master.tuning = ct.cast(kept[-1], ct.c_void_p) if schedule.tunings else None
        master.tunings = len(schedule.tunings)
        sensed = [sensors.measured[name] for name in ours if name not in COMMANDS]
        kept.append(np.array(sensed, dtype=np.uintp))
        master.stepper.sensed = kept[-1].ctypes.data
        return kept

    def _choose_inputs(self, schedule: Schedule) -> NDArray[np.float64] | None:
        """Sets which inputs the plant gets, those of servos where they have faults. Returns the
        rows of servos and pushes; None: neither changes.
        """
        master, pushes, servos = self._master, schedule.pushes, schedule.servos
        first = PUSH if servos is None else [*SERVOS, *PUSH]
        master.push_count, master.push_place = len(first), self._places[first[0]]
        if len(first) not in self._plant_inputs:
            names = [*first, *self._drive]
            block = self._block(self._fmus["plant"], names, master.push_place)
            self._plant_inputs[len(first)] = block
        master.stepper.plant_input = self._plant_inputs[len(first)]
        if servos is None:
            return pushes
        still = np.zeros((len(servos), len(PUSH)))
        return np.hstack([servos, still if pushes is None else pushes])

    def _tunings(self, schedule: Schedule) -> Any:
        """Returns the changes of the plant's parameters as an array of hxTuning."""
        plant, make = self._fmus["plant"], loop_header().types["hxTuning"]
        return (make * len(schedule.tunings))(
            *(
                make(step, value, *plant.references([name]))
                for step, name, value in schedule.tunings
            )
        )

    def _run_steps(
        self, times: NDArray[np.float64], h: float, rows: Rows, progress: Progress | None
    ) -> tuple[str, str, Exception | None]:
        """Runs all macro-steps; returns status, reason and cause of the outcome."""
        master, steps = self._master, len(times) - 1
        try:
            with interruptible():
                going = self._library.hx_master_begin(ct.byref(master))
                while going and master.step < steps:
                    going = self._run_block(min(master.step + BLOCK_ROWS, steps), rows)
                    if progress is not None and going:
                        progress(master.step * h)
                if going:
                    master.record = rows.room.ctypes.data
                    self._library.hx_master_record(ct.byref(master))
                    rows.store(1)
                    return COMPLETED, "", None
        except KeyboardInterrupt:
            return INTERRUPTED, "interrupted", None
        error = self._error(float(times[master.step]))
        return FAILED, str(error), error

    def _run_block(self, end: int, rows: Rows) -> int:
        """Runs until `end` macro-steps are done and stores their rows; 0: a call failed."""
        master = self._master
        master.record, master.recorded = rows.room.ctypes.data, 0
        try:
            return int(self._library.hx_master_run(ct.byref(master), end))
        finally:
            rows.store(master.recorded)

    def _error(self, t: float) -> FmuError:
        """Returns the error that ended the macro-step at t [s], worded as the Python master's."""
        stepper = self._master.stepper
        number = loop_header().constants
        which, what = next(call for name, call in CALLS.items() if number[name] == stepper.call)
        fmu = self._fmus[which]
        return (
            fmu.log.failure(what, stepper.status) if what else fmu.step_failure(t, stepper.status)
        )


def _ours(pairs: Pairs) -> list[str]:
    """Returns our names of connected scalars."""
    return list(chain.from_iterable(names for _, names in pairs))


def _theirs(pairs: Pairs) -> list[str]:
    """Returns the FMU's names of connected variables."""
    return [name for name, _ in pairs]
