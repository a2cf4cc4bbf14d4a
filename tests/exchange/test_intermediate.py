"""Tests intermediate updates of FMI 3: at steps of the solver, with the bits of a run without."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from fmi3_plant import Plant3
from fmi_plant import DISCARD, ERROR, OK

H, STEPS, DROP = 0.005, 16, 0.15  # s, 1, m: feet touch down after about 50 ms
FINE = 1e-4  # s


def dropped(plant: Plant3) -> Plant3:
    assert plant.set({"initial.position": [0.0, 0.0, DROP]}) == OK
    return plant.initialize()


def height(plant: Plant3) -> float:
    return float(plant.get("torso.position")[0][2])


def test_outputs_at_the_solvers_steps_are_those_of_the_motion_and_reading_changes_no_bit(
    plant_library: Path,
) -> None:
    seen: list[tuple[float, float]] = []
    with (
        Plant3(plant_library, intermediate=lambda t: seen.append((t, height(watched)))) as watched,
        Plant3(plant_library) as alone,
        Plant3(plant_library) as fine,
    ):
        for plant in (watched, alone, fine):
            dropped(plant)
        for k in range(STEPS):
            for plant in (watched, alone):
                assert plant.step(k * H, H).status == OK
        assert watched.everything().tolist() == alone.everything().tolist()
        times, heights = np.array(seen).T
        assert len(times) > STEPS
        assert np.all(np.diff(times) > 0.0)
        assert np.all(
            np.abs(times / H - np.round(times / H)) > 1e-9
        )  # none at communication points
        every = []
        for k in range(round(STEPS * H / FINE)):
            every.append(height(fine))
            assert fine.step(k * FINE, FINE).status == OK
    curve = np.interp(times, FINE * np.arange(len(every)), every)
    np.testing.assert_allclose(heights, curve, rtol=0.0, atol=2e-7)  # (0.1 ms)^2 g/8 is 1e-8 m


def test_a_step_that_returns_early_on_request_goes_on_bit_for_bit(plant_library: Path) -> None:
    asked: list[float] = []

    def first(time: float) -> float | None:
        asked.append(time)
        return time if len(asked) == 1 else None

    with (
        Plant3(plant_library, early=True, intermediate=first) as plant,
        Plant3(plant_library) as other,
    ):
        dropped(plant)
        dropped(other)
        step = plant.step(0.0, H)
        assert (step.status, step.early, step.event) == (OK, True, False)
        assert step.time == asked[0] < H
        assert plant.step(step.time, H - step.time).time == H
        assert other.step(0.0, H).status == OK
        assert plant.everything().tolist() == other.everything().tolist()


def test_inputs_may_be_set_in_an_update_and_nothing_else(plant_library: Path) -> None:
    refused: list[int] = []
    texts: list[str] = []

    def push(_: float) -> None:
        assert plant.set({"torso.push_force": [30.0, 0.0, 0.0]}) == OK
        refused.append(plant.set({"torso.mass": 3.0}))
        texts.append(plant.last_message)
        refused.append(plant.step(0.0, H).status)
        refused.append(plant.call("fmi3Terminate"))

    with Plant3(plant_library, intermediate=push) as plant:
        dropped(plant)
        for k in range(STEPS // 2):
            assert plant.step(k * H, H).status == OK
        assert set(refused) == {ERROR}
        assert "torso.mass: got a value within a step, expected it between steps" in texts[0]
        assert plant.get("torso.velocity")[0][0] > 0.1


def test_a_step_that_fails_after_updates_changes_nothing(plant_library: Path) -> None:
    seen: list[float] = []
    with Plant3(plant_library, intermediate=seen.append) as plant:
        dropped(plant)
        assert plant.step(0.0, H).status == OK
        assert plant.set({"torso.push_force": 3 * [1e9], "torso.push_torque": 3 * [1e8]}) == OK
        saved = plant.serialize(plant.save())
        seen.clear()
        step = plant.step(H, 0.02)
        assert step.status == DISCARD
        assert step.time == H
        assert seen
        assert plant.serialize(plant.save()) == saved
