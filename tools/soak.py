"""Lets one robot walk for hours in one process under random commands, pushes, faults and restores.

usage: python -m tools.soak SECONDS [SEED]      (simulated seconds; `make soak`: 24 h)

Plant FMU and controller FMU are instantiated once and never reset; the C loop of the master drives
them. The walk consists of pieces of 10 s. Each draws a body command, pushes and faults of force
sensors; every fifth piece is repeated from a saved state and must have the same bits. Where the
robot has fallen, or a run has ended early, the state at the last good start of a piece is restored,
so that time goes back. Exits with 1 after a number that is not finite, a repeated piece with other
bits, constraint errors above CONSTRAINT, an energy balance that is wrong by more than RESIDUAL, or
memory that has grown by more than GROWTH. SIGINT and SIGTERM end it early, with the figures until
then.
"""

from __future__ import annotations

import ctypes as ct
import json
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from hexapod_cosim.cosim.export.controller_export import export_controller
from hexapod_cosim.cosim.interface.controller_interface import controller_parameters
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.master.interrupts import termination_as_interrupt
from hexapod_cosim.cosim.master.loop import COMPLETED, INTERRUPTED, Outcome
from hexapod_cosim.cosim.master.native_loop import NativeMaster
from hexapod_cosim.cosim.master.sensors import errors_of
from hexapod_cosim.cosim.run.preparation import PlantFmus
from hexapod_cosim.cosim.run.single_run import (
    RunPlan,
    apply_settings,
    initialise_plant,
    make_plan,
)
from hexapod_cosim.cosim.scenario.records import FAULTS, Command, Fault, Push, Scenario
from hexapod_cosim.cosim.scenario.scenario import load_scenario
from hexapod_cosim.cosim.scenario.schedule import make_schedule
from hexapod_cosim.models import LEG_NAMES

PIECE = 10.0  # s
REPEATED = 5  # of so many pieces one is repeated from its saved state
WARM_UP = 5  # pieces before the memory is measured first
# m, m/s  largest violations of the joints' constraints; a hundred times what a minute shows
CONSTRAINT = {"position_error": 1e-4, "velocity_error": 3e-3}
RESIDUAL = 1e-3  # of the actuators' work
GROWTH = 4_000_000  # bytes
UPRIGHT = 0.7  # cosine of the torso's tilt, below which the robot has fallen
LOWEST = 0.06  # m  height of the torso, below which it has fallen
COLUMNS = (
    "LF.foot.contact",
    *(f"torso.position[{i}]" for i in (1, 2, 3)),
    *(f"torso.quaternion[{i}]" for i in (1, 2, 3, 4)),
    "constraint.position_error",
    "constraint.velocity_error",
    "energy.residual",
    "energy.actuator_work",
)
Saved = list[ct.c_void_p]


@dataclass
class Figures:
    """What a soak has seen."""

    simulated: float = 0.0  # s, of all pieces, also of repeated ones
    reached: float = 0.0  # s, of the walk's own time
    pieces: int = 0
    repeated: int = 0
    falls: int = 0
    ended_early: int = 0
    pushes: int = 0
    faults: int = 0
    position_error: float = 0.0  # m  largest
    velocity_error: float = 0.0  # m/s  largest
    last_position_error: float = 0.0  # m  largest of the last piece: drift would let it grow
    last_velocity_error: float = 0.0  # m/s
    residual: float = 0.0  # J  largest in the plant's energy balance
    work: float = 0.0  # J  of the actuators
    growth: int = 0  # bytes
    failures: list[str] = field(default_factory=list)


class StateCalls:
    """Saves and restores the states of plant and controller through FMI."""

    def __init__(self, *fmus: Fmu) -> None:
        self._fmus = fmus

    def _call(self, fmu: Fmu, name: str, argument: object) -> None:
        function = ct.CFUNCTYPE(ct.c_int, ct.c_void_p, ct.c_void_p)(fmu.address(name))
        status = function(fmu.component, argument)
        if status != 0:
            raise RuntimeError(f"{name} of {fmu.path.name} returned {status}, expected 0")

    def save(self, states: Saved | None = None) -> Saved:
        """Returns the states; writes them over earlier ones if given."""
        states = [ct.c_void_p() for _ in self._fmus] if states is None else states
        for fmu, state in zip(self._fmus, states, strict=True):
            self._call(fmu, "fmi2GetFMUstate", ct.addressof(state))
        return states

    def restore(self, states: Saved) -> None:
        for fmu, state in zip(self._fmus, states, strict=True):
            self._call(fmu, "fmi2SetFMUstate", state)

    def free(self, states: Saved) -> None:
        for fmu, state in zip(self._fmus, states, strict=True):
            self._call(fmu, "fmi2FreeFMUstate", ct.addressof(state))


@contextmanager
def opened(seconds: float) -> Iterator[tuple[RunPlan, Fmu, Fmu]]:
    """Opens and initialises plant and compliant controller for a long walk."""
    scenario = load_scenario("walk_flat", overrides=["control=compliant"])
    plan = make_plan(scenario)
    with (
        TemporaryDirectory(prefix="hexapod-soak-") as name,
        Fmu(PlantFmus(Path(name)).fmu(scenario.robot)) as plant,
        Fmu(export_controller(plan.controller, Path(name) / "c.fmu"), name="controller") as control,
    ):
        apply_settings(plant, plan.robot)
        initialise_plant(plant, replace(plan, scenario=replace(scenario, duration=seconds + PIECE)))
        control.set_blocks(control.parameter_blocks(controller_parameters(plan.controller)))
        control.initialise(0.0, seconds + PIECE)
        yield plan, plant, control


def drawn(scenario: Scenario, start: float, rng: np.random.Generator) -> Scenario:
    """Returns a random piece of the walk from `start` [s] on."""
    command = Command(
        vx=float(rng.uniform(-0.04, 0.1)),
        vy=float(rng.uniform(-0.03, 0.03)),
        yaw_rate=float(rng.uniform(-0.2, 0.2)),
    )
    pushes = [
        Push(
            time=float(rng.uniform(0.0, PIECE)),
            duration=float(rng.uniform(0.05, 0.3)),
            force=tuple(float(force) for force in rng.normal(0.0, 15.0, 3)),
        )
        for _ in range(rng.integers(0, 3))
    ]
    faults = [
        Fault(
            time=float(rng.uniform(0.0, PIECE)),
            leg=str(rng.choice(LEG_NAMES)),
            fault=str(rng.choice(FAULTS[:2])),
            duration=float(rng.uniform(0.1, 1.0)),
        )
        for _ in range(rng.integers(0, 2))
    ]
    return replace(
        scenario, start=start, duration=PIECE, commands=(command,), events=(*pushes, *faults)
    )


def walked(master: NativeMaster, piece: Scenario) -> Outcome:
    """Runs a piece; the FMUs stand at its start. Raises KeyboardInterrupt."""
    schedule = make_schedule(piece)
    outcome = master.run(schedule, h=piece.macro_step, errors=errors_of(piece, schedule))
    if outcome.status == INTERRUPTED:
        raise KeyboardInterrupt
    return outcome


def has_fallen(outcome: Outcome) -> bool:
    """Returns whether the robot has fallen at the end of a piece."""
    rows = outcome.recording
    x, y = (rows.column(f"torso.quaternion[{i}]")[-1] for i in (2, 3))
    upright = 1.0 - 2.0 * (x * x + y * y)
    return bool(upright < UPRIGHT or rows.column("torso.position[3]")[-1] < LOWEST)


def measure(outcome: Outcome, figures: Figures) -> None:
    """Adds a piece to the figures."""
    rows = outcome.recording
    figures.pieces += 1
    figures.simulated += outcome.simulated
    if not np.isfinite(rows.data).all():
        figures.failures.append(f"a number is not finite in the piece at {rows.time[0]:.0f} s")
    for name, column in (
        ("position_error", "constraint.position_error"),
        ("velocity_error", "constraint.velocity_error"),
        ("residual", "energy.residual"),
    ):
        largest = float(np.max(np.abs(rows.column(column))))
        setattr(figures, name, max(getattr(figures, name), largest))
        if name in CONSTRAINT:
            setattr(figures, f"last_{name}", largest)
    figures.work = float(rows.column("energy.actuator_work")[-1])


def resident() -> int:
    """Returns the resident memory of this process [bytes]; 0 where the system does not tell."""
    status = Path("/proc/self/statm")
    return int(status.read_text(encoding="ascii").split()[1]) * 4096 if status.exists() else 0


def soak(seconds: float, seed: int) -> Figures:
    """Walks for a time [s of simulation], or until an interrupt; returns what it saw."""
    figures = Figures()
    with opened(seconds) as (plan, plant, control):
        master = NativeMaster(plant, control, columns=COLUMNS)
        calls, memory = StateCalls(plant, control), 0
        good = calls.save()
        with suppress(KeyboardInterrupt), termination_as_interrupt():
            for piece in pieces(plan.scenario, seconds, np.random.default_rng(seed), figures):
                walk(master, calls, good, piece, figures)
                if figures.pieces == WARM_UP:
                    memory = resident()
        calls.free(good)
        figures.growth = resident() - memory if memory else 0
    judge(figures)
    return figures


def pieces(
    scenario: Scenario, seconds: float, rng: np.random.Generator, figures: Figures
) -> Iterator[Scenario]:
    """Yields random pieces until the time [s of simulation] is over or something has failed."""
    while figures.simulated < seconds and not figures.failures:
        yield drawn(scenario, figures.reached, rng)


def walk(
    master: NativeMaster, calls: StateCalls, good: Saved, piece: Scenario, figures: Figures
) -> None:
    """Walks a piece; repeats some; restores the state at its start when the robot has fallen."""
    outcome = walked(master, piece)
    measure(outcome, figures)
    figures.pushes += len(piece.pushes)
    figures.faults += len(piece.faults)
    if figures.pieces % REPEATED == 0:
        repeat(master, calls, good, piece, outcome, figures)
    fell, early = has_fallen(outcome), outcome.status != COMPLETED
    figures.falls += fell
    figures.ended_early += early
    if fell or early:
        calls.restore(good)
    else:
        figures.reached += PIECE
        calls.save(good)


def repeat(
    master: NativeMaster,
    calls: StateCalls,
    good: Saved,
    piece: Scenario,
    first: Outcome,
    figures: Figures,
) -> None:
    """Repeats a piece from the state at its start and compares the bits."""
    calls.restore(good)
    again = walked(master, piece)
    figures.repeated += 1
    figures.simulated += again.simulated
    if again.recording.data.tobytes() != first.recording.data.tobytes():
        figures.failures.append(f"the repeated piece at {piece.start:.0f} s has other bits")


def judge(figures: Figures) -> None:
    """Adds what exceeds the limits to the failures."""
    for name, most in CONSTRAINT.items():
        if not getattr(figures, name) <= most:
            figures.failures.append(f"{name}: got {getattr(figures, name):.3g}, expected <= {most}")
    if not figures.residual <= RESIDUAL * figures.work:
        figures.failures.append(f"energy: got {figures.residual:.3g} J of {figures.work:.3g} J")
    if figures.growth > GROWTH:
        figures.failures.append(f"memory: got {figures.growth} B more, expected <= {GROWTH} B")


def main() -> int:
    """Runs the soak of the command line and prints its figures as JSON."""
    if len(sys.argv) not in (2, 3):
        print("usage: python -m tools.soak SECONDS [SEED]", file=sys.stderr)
        return 2
    begin = time.perf_counter()
    figures = soak(float(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) == 3 else 1)
    print(json.dumps({**vars(figures), "wall": time.perf_counter() - begin}, indent=1))
    return 1 if figures.failures else 0


if __name__ == "__main__":
    sys.exit(main())
