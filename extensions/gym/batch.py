"""Runs many environments in C (loop/src/environments.c), over threads.

`Batch` owns the plant's FMU, the memory that is exchanged with C and the threads. An action array
goes in, arrays of observations, rewards and flags come out; all of them are views of the memory
that C reads and writes.
"""

from __future__ import annotations

import ctypes as ct
import weakref
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.common.temporary import Closing, TemporaryFolder
from hexapod_cosim.cosim.export.plant import export_fmu
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.master.native_loop import step_functions
from hexapod_cosim.cosim.master.signals import JOINT_COMMANDS, PUSH
from hexapod_cosim.cosim.run.worker_pool import processor_count
from hexapod_cosim.extensions.gym.checks import check_count, check_names, check_seeds, checked_mask
from hexapod_cosim.extensions.gym.native import (
    ARRAYS,
    AUTORESET,
    CALLS,
    OUTPUTS,
    NativeArrays,
    NativeDraws,
    NativeFmu,
    NativeSettings,
    Owned,
    environments_library,
)
from hexapod_cosim.extensions.gym.settings import BLOCKS, JOINTS, RATE, REASONS, TERMS, EnvSettings
from hexapod_cosim.models import FmuError, HexapodError, Robot, load_robot
from hexapod_cosim.models.ground.faces import surface_of
from hexapod_cosim.models.ground.surface import Surface
from hexapod_cosim.models.ground.table import merged_terrain
from hexapod_cosim.models.statics import settled
from hexapod_cosim.models.validation.bodies import check_settings

FAILED = REASONS.index("failed")
MESSAGE_SIZE = 512
STARTS = 20  # episodes in a row that a plant may refuse to start before a reset is an error
GROUND = "terrain.grid"  # the parameter that chooses one of several grounds, from 1
Array = NDArray[Any]


def grounds(settings: EnvSettings) -> tuple[Robot, ...]:
    """Returns the robot on each of the environment's grounds. Raises HexapodError."""
    own = load_robot(settings.robot)
    foot = replace(own.foot, pad_radius=settings.pad_radius or own.foot.pad_radius)
    solver = replace(
        own.solver, method=settings.solver, tolerance=settings.tolerance, step_max=settings.step_max
    )
    found = []
    for seed in range(1, settings.terrain_seeds + 1):
        given = dict(settings.terrain) | ({"seed": seed} if settings.terrain_seeds > 1 else {})
        terrain = merged_terrain(own.terrain, given, "terrain")
        robot = replace(own, foot=foot, solver=solver, terrain=terrain)
        check_settings(robot, where="environment")
        found.append(robot)
    return tuple(found)


def surfaces(robots: Sequence[Robot]) -> list[Surface]:
    """Returns the different surfaces of robots, in the order of their numbers in the FMU."""
    given = [surface_of(robot.terrain) for robot in robots]
    return list(dict.fromkeys(one for one in given if one is not None))


class Batch(Closing):
    """A number of environments with the same settings; a context manager that frees them.

    Args:
        settings: of all environments.
        count: number of environments.
        threads: that step them; None: one for each core, at most one for each environment.
        autoreset: "next_step", "same_step" or "disabled", as in Gymnasium.

    Attributes, which `reset` and `step` read and write: `action` (count, 18), float32;
    `observation` and `last` (count, size), float32; `reward` (count,); `term` (count, 13), the
    weighted terms of the reward; `terminated`, `truncated` and `refused` (count,), bool; `reason`
    (count,), an index of REASONS.

    Raises HexapodError for settings that describe no possible robot or ground.
    """

    def __init__(
        self,
        settings: EnvSettings,
        count: int,
        *,
        threads: int | None = None,
        autoreset: str = "next_step",
    ) -> None:
        check_count("number of environments", count)
        self.threads = min(processor_count(), count) if threads is None else threads
        check_count("number of threads", self.threads)
        check_names([autoreset], "autoreset mode", AUTORESET)
        self.settings, self.count, self.autoreset = settings, count, autoreset
        self._owned = Owned()
        self._end = weakref.finalize(self, self._owned.free)  # for those who do not close
        self._kept: list[Any] = []
        try:
            self._open()
        except BaseException:
            self.close()
            raise

    def _open(self) -> None:
        """Exports and loads the plant, creates the environments and starts the threads."""
        robots = grounds(self.settings)
        self.robot = robots[0]
        with TemporaryFolder("gym") as folder:
            path = export_fmu(robots[0], folder / "plant.fmu", terrains=surfaces(robots), bare=True)
            plant = self._owned.plant = Fmu(path)
        self._allocate()
        native = self._native_settings(robots, plant)
        arrays = NativeArrays(**{name: getattr(self, name).ctypes.data for name in ARRAYS})
        message = ct.create_string_buffer(MESSAGE_SIZE)
        self._library = environments_library()
        self._owned.handle = self._library.hx_environments_create(
            ct.byref(native), ct.byref(arrays), self.count, message
        )
        if not self._owned.handle:
            got = message.value.decode(errors="replace")
            raise FmuError("the environments cannot be created", got=got, fix="use fewer")
        if self.threads > 1:
            self._owned.pool = ThreadPoolExecutor(self.threads - 1)

    def _allocate(self) -> None:
        """Allocates the arrays that are exchanged with C."""
        count, size = self.count, self.settings.size
        self.action: NDArray[np.float32] = np.zeros((count, JOINTS), np.float32)
        self.observation: NDArray[np.float32] = np.zeros((count, size), np.float32)
        self.last: NDArray[np.float32] = np.zeros((count, size), np.float32)
        self.reward: NDArray[np.float64] = np.zeros(count)
        self.term: NDArray[np.float64] = np.zeros((count, len(TERMS)))
        self.terminated: NDArray[np.bool_] = np.zeros(count, bool)
        self.truncated: NDArray[np.bool_] = np.zeros(count, bool)
        self.refused: NDArray[np.bool_] = np.zeros(count, bool)
        self.reason: NDArray[np.int32] = np.zeros(count, np.int32)

    def _keep(self, values: Sequence[Any] | Array, dtype: type) -> int:
        """Returns the address of values that live as long as this object."""
        array: Array = np.array(values, dtype=dtype)
        self._kept.append(array)
        return int(array.ctypes.data)

    def _references(self, fmu: Fmu, names: Sequence[str]) -> int:
        return self._keep(fmu.references(names), np.uint32)

    def _fmu(self, fmu: Fmu) -> Any:
        """Returns the functions of an FMU and what its instances are made with."""
        calls: dict[str, Any] = {name: fmu.address(call) for name, call in CALLS.items()}
        resources = fmu.resources.resolve().as_uri().encode()
        texts = {"guid": fmu.description.guid.encode(), "resources": resources}
        self._kept.append(texts)
        return NativeFmu(**calls, step=step_functions(fmu, None), **texts)

    def _native_settings(self, robots: Sequence[Robot], plant: Fmu) -> Any:
        """Returns the settings as C reads them."""
        given = self.settings
        stance = np.array([leg.stance for leg in self.robot.legs])
        commands = (given.command_vx, given.command_vy, given.command_yaw_rate)
        native = NativeSettings(
            plant=self._fmu(plant),
            plant_output=self._references(plant, OUTPUTS),
            plant_input=self._references(plant, [*JOINT_COMMANDS, *PUSH[:3]]),
            draws=self._draws(robots, plant),
            h=1.0 / RATE,
            length=given.steps,
            stance=(ct.c_double * JOINTS)(*stance.ravel()),
            action_scale=(ct.c_double * JOINTS)(*[given.action_scale] * JOINTS),
            clock=given.clock,
            command_low=tuple(low for low, _ in commands),
            command_high=tuple(high for _, high in commands),
            push_interval=round(given.push_interval * RATE) if given.push_force else 0,
            push_length=max(round(given.push_duration * RATE), 1),
            push_force=given.push_force,
            upright=float(np.cos(given.max_tilt)),
            belly_force=given.belly_force,
            weight=tuple(given.rewards.get(name, 0.0) for name in TERMS),
            width=given.tracking_width,
            autoreset=AUTORESET.index(self.autoreset),
        )
        for place, name in enumerate(BLOCKS):
            native.observed[place][:] = np.broadcast_to(given.observation.get(name, 0.0), 3)
        return native

    def _draws(self, robots: Sequence[Robot], plant: Fmu) -> Any:
        """Returns the parameters that are drawn for each episode, as C reads them."""
        drawn: dict[str, tuple[float, float, bool]] = {
            name: (low, high, False) for name, (low, high) in self.settings.randomise.items()
        }
        count = len(surfaces(robots))
        if count > 1:
            # m    of the torso, so that no foot is deep in any of the grounds
            height = max(float(settled(robot)[0][2]) for robot in robots)
            drawn |= {"initial.position[3]": (height, height, False)}
            drawn |= {GROUND: (1.0, float(count), True)}
        self.drawn_names = tuple(drawn)
        for name, ends in self.settings.randomise.items():
            for value in ends:  # refused at once, not at the start of an episode
                plant.set_parameters({name: float(value)})
        low, high, whole = ([ends[place] for ends in drawn.values()] for place in range(3))
        return NativeDraws(
            reference=self._references(plant, self.drawn_names),
            low=self._keep(low, float),
            high=self._keep(high, float),
            whole=self._keep(whole, np.int32),
            count=len(drawn),
        )

    def reset(
        self, *, seeds: Sequence[int] | None = None, mask: NDArray[np.bool_] | None = None
    ) -> None:
        """Starts an episode in all environments, or in those of a mask (count,).

        An episode whose start the plant refuses is followed by the next one.

        seeds: one for each environment, from which its episodes begin again; None: the next
        episodes. Raises FmuError when a plant refuses STARTS episodes in a row.
        """
        if seeds is not None:
            check_seeds(seeds, self.count)
        numbers = None if seeds is None else np.array(seeds, dtype=np.uint64)
        starting = np.ones(self.count, np.uint8) if mask is None else checked_mask(mask, self.count)
        for _ in range(STARTS):
            self._in_threads(
                self._library.hx_environments_reset,
                starting.ctypes.data,
                None if numbers is None else numbers.ctypes.data,
            )
            starting = np.where(self.reason == FAILED, starting, np.uint8(0))
            if not starting.any():
                return
            numbers = None
        failed = int(np.flatnonzero(starting)[0])
        what, expected = f"environment {failed} cannot start", f"a start in {STARTS} episodes"
        fix = "narrow the ranges from which parameters are drawn"
        raise FmuError(what, got=self.message(failed), expected=expected, fix=fix)

    def step(self) -> None:
        """Steps all environments under `action`.

        An environment whose action is not finite does not step: it is `refused`.
        """
        self._in_threads(self._library.hx_environments_step)

    def _in_threads(self, call: Callable[..., None], *given: int | None) -> None:
        """Calls a function of the library in all threads, each with a share of the robots."""
        handle, pool = self._handle(), self._owned.pool
        if pool is None or self._owned.is_inherited:
            call(handle, 0, self.count, *given)
            return
        ends = [self.count * share // self.threads for share in range(self.threads + 1)]
        others = [pool.submit(call, handle, *share, *given) for share in pairwise(ends[1:])]
        call(handle, 0, ends[1], *given)
        for other in others:
            other.result()

    def message(self, index: int) -> str:
        """Returns the last message of an environment's FMUs."""
        text: bytes = self._library.hx_environments_message(self._handle(), index)
        return text.decode(errors="replace")

    def drawn(self, index: int) -> dict[str, float]:
        """Returns the parameters drawn for the present episode of an environment."""
        values = np.zeros(len(self.drawn_names))
        self._library.hx_environments_drawn(self._handle(), index, values.ctypes.data)
        return dict(zip(self.drawn_names, values.tolist(), strict=True))

    def values(self, index: int) -> Mapping[str, float]:
        """Returns the outputs of the plant of an environment, by name."""
        values = np.zeros(len(OUTPUTS))
        self._library.hx_environments_values(self._handle(), index, values.ctypes.data)
        return dict(zip(OUTPUTS, values.tolist(), strict=True))

    def _handle(self) -> int:
        if self._owned.handle is None:
            raise HexapodError(
                "the environments are closed", got="a call after close()", fix="create new ones"
            )
        return self._owned.handle

    def close(self) -> None:
        """Ends the threads and frees the environments; may be called twice."""
        self._end()
