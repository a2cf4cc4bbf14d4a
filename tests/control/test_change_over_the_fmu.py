"""Control and gait change in the controller's FMU with a step that succeeds, and with nothing else:
not with a refused step, and not when outputs are read.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import pytest
from controller_fmus import outputs

from hexapod_cosim.controller import make_gait
from hexapod_cosim.cosim.export.plant import export_controller
from hexapod_cosim.cosim.interface.controller import ControllerSetup, controller_parameters
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.master.fmu_block import StepError
from hexapod_cosim.models import LEG_NAMES, load_robot

STEP = 0.005  # s
ROBOT = load_robot("athena")
KINEMATIC, COMPLIANT, PAPER = 1.0, 2.0, 3.0


def gait_of(name: str) -> dict[str, float]:
    """Returns the FMU's parameters of a gait."""
    setup = ControllerSetup(robot=ROBOT, gait=make_gait(ROBOT, name), period=STEP)
    found = controller_parameters(setup)
    return {name: value for name, value in found.items() if name.startswith("gait.")}


BEFORE = {"control": KINEMATIC, **gait_of("tripod")}
CHANGES = {
    "compliant": {"control": COMPLIANT},
    "paper": {"control": PAPER},
    "amble": gait_of("amble"),
    "both": {"control": COMPLIANT, **gait_of("amble")},
}
# The swing of 1 ms is shorter than the period of the controller; each value is in its range.
TOO_FAST = {"control": COMPLIANT, "gait.duty": 0.999, "gait.period": 1.0}


@pytest.fixture(scope="module")
def packed(plant_build: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    setup = ControllerSetup(robot=ROBOT, gait=make_gait(ROBOT, "tripod"), period=STEP)
    return export_controller(setup, tmp_path_factory.mktemp("controller") / "controller.fmu")


@pytest.fixture
def fmu(packed: Path) -> Iterator[Fmu]:
    """Returns the FMU of a robot commanded to walk, on feet that feel a force."""
    with Fmu(packed, name="controller") as instance:
        begin(instance)
        yield instance


def begin(fmu: Fmu) -> None:
    """Initializes the FMU and sets its inputs, which stay."""
    fmu.initialise(0.0, 60.0)
    inputs = fmu.block(["command.vx", *(f"{leg}.foot.force[3]" for leg in LEG_NAMES)])
    inputs.values[:] = [0.05, *(8.0 + k for k in range(6))]
    inputs.set()


def go(fmu: Fmu, first: int, end: int) -> None:
    for k in range(first, end):
        fmu.step(k * STEP, STEP)


def state_of(fmu: Fmu) -> bytes:
    """Returns the bytes of the FMU's state."""
    state = fmu._slave.getFMUState()
    found = bytes(fmu._slave.serializeFMUState(state))
    fmu._slave.freeFMUState(state)
    return found


def restore(fmu: Fmu, data: bytes) -> None:
    state = fmu._slave.deSerializeFMUstate(data)
    fmu._slave.setFMUState(state)
    fmu._slave.freeFMUState(state)


def test_a_step_that_is_refused_for_its_gait_keeps_the_control_too(fmu: Fmu) -> None:
    go(fmu, 0, 330)
    present, start = outputs(fmu), state_of(fmu)
    go(fmu, 330, 400)
    expected = state_of(fmu)
    restore(fmu, start)
    fmu.set_parameters(TOO_FAST)
    before = state_of(fmu)
    with pytest.raises(StepError, match="gait's shorter phase; the state is unchanged"):
        fmu.step(330 * STEP, STEP)
    assert state_of(fmu) == before
    np.testing.assert_array_equal(outputs(fmu), present)  # those of the walk that goes on
    fmu.set_parameters(BEFORE)
    go(fmu, 330, 400)
    assert state_of(fmu) == expected


@pytest.mark.parametrize("steps", [0, 330])
@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_a_saved_state_does_not_depend_on_outputs_that_were_read_after_a_change(
    fmu: Fmu, change: Mapping[str, float], steps: int
) -> None:
    go(fmu, 0, steps)
    fmu.set_parameters(change)
    before = state_of(fmu)
    outputs(fmu)
    assert state_of(fmu) == before
    go(fmu, steps, steps + 60)
    expected = state_of(fmu)
    restore(fmu, before)
    go(fmu, steps, steps + 60)
    assert state_of(fmu) == expected


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_a_change_that_is_taken_back_before_the_step_was_never_made(
    fmu: Fmu, change: Mapping[str, float]
) -> None:
    steps = 330
    go(fmu, 0, steps)
    start, present = state_of(fmu), outputs(fmu)
    go(fmu, steps, steps + 60)
    expected = state_of(fmu)
    restore(fmu, start)
    fmu.set_parameters(change)
    outputs(fmu)
    fmu.set_parameters(BEFORE)
    np.testing.assert_array_equal(outputs(fmu), present)
    go(fmu, steps, steps + 60)
    assert state_of(fmu) == expected


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_outputs_that_are_read_after_a_change_are_those_of_the_step_that_makes_it(
    fmu: Fmu, change: Mapping[str, float]
) -> None:
    go(fmu, 0, 371)
    present = outputs(fmu)
    fmu.set_parameters(change)
    read = outputs(fmu)
    assert ("control" not in change) or (read != present).any()
    fmu.step(371 * STEP, 0.4 * STEP)  # with the tick at its begin
    np.testing.assert_array_equal(outputs(fmu), read)


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_a_change_before_the_first_tick_keeps_the_clock(
    fmu: Fmu, change: Mapping[str, float]
) -> None:
    """The first tick is due at 0 s; a step that is shorter than 0.01 periods leaves it open."""
    fmu.step(0.0, 2e-5)
    fmu.set_parameters(change)
    outputs(fmu)
    fmu.step(2e-5, 1e-5)
    outputs(fmu)
    fmu.step(3e-5, STEP - 3e-5)
    go(fmu, 1, 60)
    expected = outputs(fmu)
    fmu.reset()
    fmu.set_parameters(change)
    begin(fmu)
    go(fmu, 0, 60)
    np.testing.assert_array_equal(outputs(fmu), expected)
