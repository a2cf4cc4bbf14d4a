"""Makes random calls, legal and illegal, and compares the FMU with a model of the standard's state
machine.

usage: PYTHONPATH=tests/support python tests/fmi/fuzz.py LIBRARY SEED CALLS

After each call the status must be one that the model allows, a refused call must not have changed
the state, and a reset instance must equal a new one. Exits with 1 and prints the last calls
otherwise.
"""

from __future__ import annotations

import ctypes
import math
import sys
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from random import Random

from fmi_plant import ATHENA, DISCARD, ERROR, OK, WARNING, Plant

INSTANTIATED, INITIALIZATION, STEP, TERMINATED = (
    "instantiated",
    "initialization",
    "step",
    "terminated",
)
BEFORE_END = (INSTANTIATED, INITIALIZATION, STEP)
NONSENSE = (math.nan, math.inf, -math.inf, -1.0, 0.0, 1e300, -1e300, 5e-324)
FOREIGN = (
    "fmi2EnterEventMode",
    "fmi2EnterContinuousTimeMode",
    "fmi2CancelStep",
)  # functions that are not for co-simulation, or have nothing to cancel
INPUTS = [
    variable
    for variable in ATHENA.of_causality("input")
    if "push" in variable.name or "angle_ref" in variable.name
]
SAFE = (
    "torso.mass",
    "friction.mu",
    "contact.restitution",
    "servo.kp",
    "gravity[1]",
)  # parameters that are independent of each other
UNKNOWN = (999, 3999, 2**31, 2**32 - 1)
GENTLE = 0.05  # largest part of an input's range, so that most steps succeed
Statuses = tuple[int, ...]


class RuleViolationError(AssertionError):
    """The FMU violated a rule."""


@dataclass(frozen=True)
class Model:
    """The state of an instance as far as it is known."""

    mode: str = INSTANTIATED
    time: float = 0.0  # s
    stop: float = math.inf  # s


@dataclass
class Fuzz:
    """Holds an instance, its model, and saved states with their models."""

    plant: Plant
    random: Random
    model: Model = field(default_factory=Model)
    saved: list[tuple[ctypes.c_void_p, Model]] = field(default_factory=list)
    calls: deque[str] = field(default_factory=lambda: deque(maxlen=12))
    counts: dict[int, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.fresh = self.bytes()
        self.actions: list[Callable[[], tuple[int, Statuses]]] = [
            self.set_up,
            self.enter,
            self.enter,
            self.leave,
            self.leave,
            self.terminate,
            self.reset,
            self.read,
            self.read_unknown,
            self.set_input,
            self.set_input,
            self.set_nonsense,
            self.set_parameter,
            self.set_output,
            self.step,
            self.step,
            self.step,
            self.step,
            self.step_wrong,
            self.save,
            self.restore,
            self.restore_damaged,
            self.free,
            self.foreign,
            self.log,
        ]
        self.rare = (self.terminate, self.reset)

    def bytes(self) -> bytes:
        """Returns the whole state."""
        state = self.plant.save()
        data = self.plant.serialize(state)
        self.plant.free(state)
        return data

    def call(self, action: Callable[[], tuple[int, Statuses]]) -> None:
        """Makes a call and checks the rules after it."""
        before = self.bytes()
        self.calls.append(f"{action.__name__} in {self.model}")
        status, allowed = action()
        self.counts[status] = self.counts.get(status, 0) + 1
        if status not in allowed:
            raise RuleViolationError(
                f"status {status}, expected one of {allowed}; said {self.plant.messages[-1:]}"
            )
        if status in (ERROR, DISCARD) and self.bytes() != before:
            raise RuleViolationError(
                f"a refused call changed the state; said {self.plant.last_message}"
            )
        if status in (ERROR, DISCARD) and not self.plant.messages:
            raise RuleViolationError("a refused call without a message")
        self.plant.messages.clear()

    def allow(self, *modes: str) -> Statuses:
        """Checks the status of a call that is legal in some modes only."""
        return (OK,) if self.model.mode in modes else (ERROR,)

    def go(self, function: str, mode: str, *modes: str) -> tuple[int, Statuses]:
        """Makes a call that changes the mode."""
        allowed = self.allow(*modes)
        if allowed == (OK,):
            self.model = replace(self.model, mode=mode)
        return self.plant.call(function), allowed

    def set_up(self) -> tuple[int, Statuses]:
        start = self.random.choice((0.0, 1.5, -3.0, 1e6, *NONSENSE))
        stop = self.random.choice((2e6, math.nan, -4.0, start + 0.1))
        defined, tolerance = self.random.choice((0, 1, -1)), self.random.choice((1e-4, *NONSENSE))
        good = math.isfinite(start) and abs(start) <= 1e9 and (not defined or stop >= start)
        status = self.plant.call("fmi2SetupExperiment", defined, tolerance, start, defined, stop)
        if not good or self.model.mode != INSTANTIATED:
            return status, (ERROR,)
        self.model = replace(self.model, time=start, stop=stop if defined else math.inf)
        return status, (OK,) if not defined or 0.0 < tolerance < 1.0 else (WARNING,)

    def enter(self) -> tuple[int, Statuses]:
        return self.go("fmi2EnterInitializationMode", INITIALIZATION, INSTANTIATED)

    def leave(self) -> tuple[int, Statuses]:
        return self.go("fmi2ExitInitializationMode", STEP, INITIALIZATION)

    def terminate(self) -> tuple[int, Statuses]:
        return self.go("fmi2Terminate", TERMINATED, STEP, TERMINATED)

    def reset(self) -> tuple[int, Statuses]:
        status = self.plant.call("fmi2Reset")
        self.model = Model()
        if self.bytes() != self.fresh:
            raise RuleViolationError("a reset instance is not as a new one")
        return status, (OK,)

    def read(self) -> tuple[int, Statuses]:
        variables = [
            variable
            for variable in self.random.choices(ATHENA.variables, k=9)
            if variable.type == "Real"
        ]
        status, values = self.plant.get_references(
            "fmi2GetReal", [variable.reference for variable in variables]
        )
        if not all(map(math.isfinite, values)):
            raise RuleViolationError(f"{[variable.name for variable in variables]} are {values}")
        return status, (OK,)

    def read_unknown(self) -> tuple[int, Statuses]:
        function = self.random.choice(("fmi2GetReal", "fmi2GetInteger", "fmi2GetBoolean"))
        return self.plant.get_references(function, [self.random.choice(UNKNOWN)])[0], (ERROR,)

    def set_input(self) -> tuple[int, Statuses]:
        chosen = self.random.sample(INPUTS, 4)
        reach = [GENTLE * min(abs(variable.maximum or 0.0), 100.0) for variable in chosen]
        values = [
            (variable.start or 0.0) + self.random.uniform(-size, size)
            for variable, size in zip(chosen, reach, strict=True)
        ]
        return self.plant.set_reals(
            {v.name: value for v, value in zip(chosen, values, strict=True)}
        ), self.allow(*BEFORE_END)

    def set_nonsense(self) -> tuple[int, Statuses]:
        good, bad = self.random.sample(INPUTS, 2)
        value = self.random.choice([value for value in NONSENSE if not abs(value) <= 1.0])
        return self.plant.set_reals({good.name: good.start or 0.0, bad.name: value}), (ERROR,)

    def set_parameter(self) -> tuple[int, Statuses]:
        name = self.random.choice(SAFE)
        value = float(ATHENA.variable(name).start or 0.0) * self.random.uniform(0.7, 1.1)
        return self.plant.set_reals({name: value}), self.allow(INSTANTIATED, INITIALIZATION)

    def set_output(self) -> tuple[int, Statuses]:
        return self.plant.set_reals({"torso.roll": 0.0}), (ERROR,)

    def step(self) -> tuple[int, Statuses]:
        size = self.random.choice((1e-16, 1e-9, 1e-4, 0.001, 0.005, 1.0 / 60.0, 0.1 - 2e-17))
        status = self.plant.step(self.model.time, size)
        beyond = self.model.time + size - self.model.stop
        if self.model.mode != STEP or beyond > max(
            0.51 * size, 2e-9 * max(1.0, abs(self.model.time))
        ):
            return status, (ERROR,)
        if status == OK:
            self.model = replace(self.model, time=self.model.time + size)
        return status, (OK, DISCARD, ERROR) if beyond > 0.0 else (OK, DISCARD)

    def step_wrong(self) -> tuple[int, Statuses]:
        if self.random.random() < 0.5:
            return self.plant.step(
                self.model.time + self.random.choice((1.0, -1.0, math.nan, math.inf)), 0.01
            ), (ERROR,)
        return self.plant.step(
            self.model.time, self.random.choice((math.nan, math.inf, 0.0, -0.01, 1e300, 101.0))
        ), (ERROR,)

    def save(self) -> tuple[int, Statuses]:
        if len(self.saved) < 20:
            self.saved.append((self.plant.save(), self.model))
        return OK, (OK,)

    def restore(self) -> tuple[int, Statuses]:
        if not self.saved:
            return self.plant.call("fmi2SetFMUstate", None), (ERROR,)
        state, self.model = self.random.choice(self.saved)
        return self.plant.call("fmi2SetFMUstate", state), (OK,)

    def restore_damaged(self) -> tuple[int, Statuses]:
        data = bytearray(self.fresh)
        data[self.random.randrange(len(data))] ^= 1 << self.random.randrange(8)
        cut = bytes(data[: self.random.choice((len(data), self.random.randrange(len(data))))])
        return self.plant.deserialize(cut)[0], (ERROR,)

    def free(self) -> tuple[int, Statuses]:
        if self.saved:
            self.plant.free(self.saved.pop(self.random.randrange(len(self.saved)))[0])
        return self.plant.call("fmi2FreeFMUstate", None), (OK,)

    def foreign(self) -> tuple[int, Statuses]:
        return self.plant.call(self.random.choice(FOREIGN)), (ERROR,)

    def log(self) -> tuple[int, Statuses]:
        return self.plant.call(
            "fmi2SetDebugLogging", self.random.choice((0, 1, -1)), ctypes.c_size_t(0), None
        ), (OK,)


def run(library: Path, seed: int, calls: int) -> Fuzz:
    """Makes a number of calls on one instance. Raises RuleViolationError with the last calls."""
    with Plant(library) as plant:
        fuzz = Fuzz(plant, Random(seed))
        try:
            for _ in range(calls):
                action = fuzz.random.choice(fuzz.actions)
                if action not in fuzz.rare or fuzz.random.random() < 0.1:
                    fuzz.call(action)
        except RuleViolationError as error:
            raise RuleViolationError("\n".join([f"seed {seed}: {error}", *fuzz.calls])) from error
        for state, _ in fuzz.saved:
            plant.free(state)
        return fuzz


if __name__ == "__main__":
    print(run(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])).counts)
