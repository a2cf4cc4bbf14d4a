"""The co-simulation loop in Python.

At each macro-step t_k = start + k h: read outputs -> controller -> set inputs -> record -> step
the plant to t_k + h.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime
from time import perf_counter
from typing import Any, Protocol

from numpy.typing import NDArray

from hexapod_cosim.controller import BodyCommand, Diagnostics, JointCommand, Measurement
from hexapod_cosim.cosim.interface.names import vector_names
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.master.interrupts import interruptible
from hexapod_cosim.cosim.master.recorder import Recorder, Recording, Rows
from hexapod_cosim.cosim.master.signals import Signals
from hexapod_cosim.cosim.scenario.schedule import Schedule
from hexapod_cosim.models import JOINT_NAMES, LEG_NAMES, HexapodError

COMPLETED, FAILED, INTERRUPTED = "completed", "failed", "interrupted"
FAULTY = tuple(f"controller.{leg}.{j}.faulty" for j in JOINT_NAMES for leg in LEG_NAMES)
PROGRESS_STEPS = 20  # macro-steps between two calls of the progress function

Progress = Callable[[float], None]  # simulated time since the start [s]


class JointController(Protocol):
    """Interface of a controller that the master needs."""

    def step(self, t: float, command: BodyCommand, measurement: Measurement) -> JointCommand:
        """Returns the joint commands that hold from t [s] for one macro-step."""


@dataclass(frozen=True)
class Outcome:
    """Outcome of a run. A run that did not complete keeps the rows recorded until then."""

    status: str  # COMPLETED, FAILED or INTERRUPTED
    reason: str  # a sentence; "" when completed
    simulated: float  # s
    wall: float  # s, of the whole loop
    recording: Recording
    cause: Exception | None = None  # of a failure
    every_step: Recording | None = None  # metric columns of all steps; None: recording has them
    finished: datetime = field(default_factory=lambda: datetime.now(UTC), compare=False)

    @property
    def judged(self) -> Recording:
        """The recording that metrics are computed from: one row per macro-step."""
        return self.recording if self.every_step is None else self.every_step

    @property
    def realtime_factor(self) -> float:
        """Simulated time over wall time."""
        return self.simulated / self.wall if self.wall > 0.0 else 0.0


def run(
    plant: Fmu,
    signals: Signals,
    controller: JointController,
    schedule: Schedule,
    recorder: Recorder,
    *,
    h: float,
    progress: Progress | None = None,
) -> Outcome:
    """Runs an initialised plant under a controller over the whole schedule in macro-steps of h [s].

    A refused step, any exception of the controller and an interrupt end the run; the outcome says
    which.
    """
    status, reason, begin, cause = COMPLETED, "", perf_counter(), None
    try:
        with interruptible():
            _loop(plant, signals, controller, schedule, recorder, h=h, progress=progress)
    except KeyboardInterrupt:
        status, reason = INTERRUPTED, "interrupted"
    except Exception as error:  # a controller may raise anything; the recorded rows are kept
        status, cause = FAILED, error
        reason = str(error)
        if not isinstance(error, HexapodError):
            reason = f"{type(error).__name__}: {error}"
    wall = perf_counter() - begin
    recorder.finish()
    return outcome_of(recorder, status, reason, cause, wall=wall)


def outcome_of(
    rows: Rows, status: str, reason: str, cause: Exception | None, *, wall: float
) -> Outcome:
    """Returns the outcome of a run with the rows that it has recorded; wall time in s."""
    time = rows.judged.time
    simulated = float(time[-1] - time[0]) if len(time) else 0.0
    return Outcome(status, reason, simulated, wall, rows.recording, cause, rows.judged)


def diagnostic_columns(controller: JointController) -> dict[tuple[str, ...], NDArray[Any]]:
    """Returns the arrays of the controller's diagnostics by the names of their columns.

    Returns {} for a controller whose `diagnostics` are not ours. Corrections are in m.
    """
    shown = getattr(controller, "diagnostics", None)
    if not isinstance(shown, Diagnostics):
        return {}
    columns: dict[tuple[str, ...], NDArray[Any]] = {
        tuple(f"controller.{leg}.{key}" for leg in LEG_NAMES): getattr(shown, key)
        for key in ("swinging", "unreachable", "lift", "fallback", "absent", "outrun", "doubted")
    }
    # the columns are the controller's own arrays, which change with every call; a complex number
    # lies in memory as x, y
    columns[_leg_vectors("shift", 2)] = shown.shift.view(float)
    columns[_leg_vectors("planned", 3)] = shown.planned
    columns[FAULTY] = shown.faulty
    return columns


def _leg_vectors(quantity: str, size: int) -> tuple[str, ...]:
    """Returns the column names of a vector quantity of the controller, leg by leg."""
    stems = [f"controller.{leg}.{quantity}" for leg in LEG_NAMES]
    return tuple(name for stem in stems for name in vector_names(stem, size))


def _loop(
    plant: Fmu,
    signals: Signals,
    controller: JointController,
    schedule: Schedule,
    recorder: Recorder,
    *,
    h: float,
    progress: Progress | None,
) -> None:
    """Runs all macro-steps; the last row, at the end of the run, is followed by no step."""
    pushes, lost, measurement = schedule.pushes, schedule.lost, signals.measurement
    servos, tunings = schedule.servos, list(reversed(schedule.tunings))
    signals.read()
    for k, (t, command) in enumerate(zip(schedule.times.tolist(), schedule.commands, strict=False)):
        if pushes is not None:
            signals.push[:] = pushes[k]
        if servos is not None:
            signals.set_servos(servos[k])
        while tunings and tunings[-1][0] == k:
            _, name, value = tunings.pop()
            plant.set_parameters({name: value})
        joints = controller.step(t, command, measurement)
        is_lost = lost is not None and lost[k]
        macro_step(plant.step, signals, None if is_lost else joints, t, h, recorder.record)
        if progress is not None and k % PROGRESS_STEPS == 0:
            progress((k + 1) * h)
    recorder.record()
    if progress is not None:
        progress(len(schedule.commands) * h)


def macro_step(
    step: Callable[[float, float], None],
    signals: Signals,
    joints: JointCommand | None,
    t: float,
    h: float,
    record: Callable[[], None] = lambda: None,
) -> None:
    """Makes the macro-step from t to t + h [s] and reads the plant's outputs.

    Every loop in Python calls it; cosim/master/src/macro_step.c, its equal in C, also calls the
    controller.

    Args:
        step: steps the plant from t by h.
        signals: of the plant; the push in them is set as well.
        joints: commands of the controller; None: the last ones again.
        record: is called before the plant steps, so that a recording shows the values that led to a
            failed step.

    Raises FmuError for refused inputs and StepError for a refused step.
    """
    if joints is None:
        signals.hold()
    else:
        signals.write(joints)
    record()
    step(t, h)
    signals.read()
