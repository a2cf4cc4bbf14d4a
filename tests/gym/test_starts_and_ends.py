"""Starts that a plant refuses, and the end of environments: abandoned, in forked processes."""

from __future__ import annotations

import gc
import importlib
import os
import signal
import sys
import threading
import weakref

import numpy as np
import pytest

import hexapod_cosim.extensions.gym.envs
from hexapod_cosim.extensions.gym.batch import Batch
from hexapod_cosim.extensions.gym.environment import HexapodEnv
from hexapod_cosim.extensions.gym.settings import REASONS, EnvSettings
from hexapod_cosim.models import HexapodError

pytestmark = pytest.mark.usefixtures("plant_build")
# half of the heights are so low that the plant refuses to start with feet deep in the ground
LOW = EnvSettings(duration=0.04, max_tilt=3.0, randomise={"initial.position[3]": (0.02, 0.2)})
REFUSED, ACCEPTED = 2, 0  # seeds
CHILD_SECONDS = 60  # after which a forked process that hangs ends itself


def test_a_refused_start_is_followed_by_the_next_episode_and_costs_the_others_nothing() -> None:
    with (
        Batch(LOW, 3, threads=1, autoreset="disabled") as batch,
        Batch(LOW, 1, threads=1, autoreset="disabled") as alone,
    ):
        batch.reset(seeds=(ACCEPTED, REFUSED, ACCEPTED))
        alone.reset(seeds=[REFUSED])
        assert [REASONS[reason] for reason in batch.reason] == ["", "", ""]
        assert alone.observation[0].tobytes() == batch.observation[1].tobytes()
        assert alone.drawn(0) == batch.drawn(1)
        assert batch.drawn(0) == batch.drawn(2) != batch.drawn(1)
        batch.step()
        assert batch.terminated.tolist() == [False, False, False]


def test_a_masked_reset_does_not_look_at_the_robots_beside_the_mask() -> None:
    # commanded angles beyond those that the plant accepts: its step fails
    settings = EnvSettings(action_scale=100.0, duration=0.2)
    with Batch(settings, 2, threads=1, autoreset="disabled") as batch:
        batch.reset(seeds=(1, 2))
        batch.action[0] = 1.0
        batch.step()
        assert [REASONS[reason] for reason in batch.reason] == ["failed", ""]
        batch.reset(mask=np.array([False, True]))
        assert [REASONS[reason] for reason in batch.reason] == ["failed", ""]


def test_environments_without_a_seed_differ_though_their_generator_was_used_before() -> None:
    first, second = HexapodEnv(), HexapodEnv()
    try:
        assert first.np_random is not second.np_random
        assert first.reset()[0].tobytes() != second.reset()[0].tobytes()
    finally:
        first.close()
        second.close()


@pytest.mark.parametrize(("name", "value"), [("rewards", ["alive"]), ("terrain", "sand")])
def test_settings_that_are_no_tables_are_refused_by_name(name: str, value: object) -> None:
    with pytest.raises(HexapodError, match=f"{name}: .*expected a table"):
        HexapodEnv(**{name: value})  # type: ignore[arg-type]


def test_an_abandoned_batch_is_freed_with_its_threads() -> None:
    before = set(threading.enumerate())  # some of which may end meanwhile
    batch = Batch(EnvSettings(), 2, threads=3)
    batch.reset(seeds=(1, 2))
    own = set(threading.enumerate()) - before
    assert 1 <= len(own) <= 2  # the pool starts no thread while one of its own is idle
    gone = weakref.ref(batch)
    del batch
    gc.collect()
    assert gone() is None
    for thread in own:
        thread.join(timeout=60.0)
        assert not thread.is_alive()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the system has no fork")
@pytest.mark.filterwarnings("ignore:.*multi-threaded, use of fork.*")
def test_a_forked_process_steps_and_closes_what_it_inherited() -> None:
    with Batch(EnvSettings(), 4, threads=3) as batch:
        batch.reset(seeds=(1, 2, 3, 4))
        child = os.fork()
        if child == 0:
            signal.alarm(CHILD_SECONDS)
            batch.step()
            batch.close()
            os._exit(7)
        _, status = os.waitpid(child, 0)
        assert os.waitstatus_to_exitcode(status) == 7
        batch.step()  # the first process still has its threads and files


def test_without_gymnasium_the_import_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    with pytest.raises(ModuleNotFoundError, match=r"needs gymnasium.*WHEEL\.whl\[gym\]"):
        importlib.reload(hexapod_cosim.extensions.gym.envs)
