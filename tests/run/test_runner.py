"""The runner, whose loop is C: its walks and errors are those of the Python master, bit for bit."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from gains import gains_of
from memory import resident

from hexapod_cosim.cosim.control.fmu_law import law_of_ours
from hexapod_cosim.cosim.export.plant import export_controller, export_fmu
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.master.loop import (
    COMPLETED,
    FAILED,
    INTERRUPTED,
    Outcome,
    diagnostic_columns,
    run,
)
from hexapod_cosim.cosim.master.loop_library import loop_header
from hexapod_cosim.cosim.master.native_loop import CALLS, NativeMaster
from hexapod_cosim.cosim.master.recorder import Recorder
from hexapod_cosim.cosim.master.sensors import errors_of
from hexapod_cosim.cosim.master.signals import Signals
from hexapod_cosim.cosim.results.facts import Result
from hexapod_cosim.cosim.results.summary import REFUSED, Summary, summarise
from hexapod_cosim.cosim.run.plan import make_plan
from hexapod_cosim.cosim.run.plant import initialise_plant, open_plant
from hexapod_cosim.cosim.run.runner import Runner
from hexapod_cosim.cosim.run.single_run import make_result, simulate
from hexapod_cosim.cosim.scenario.events import Fault
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.cosim.scenario.records import Command, Scenario
from hexapod_cosim.cosim.scenario.variation import STANDARD
from hexapod_cosim.models import FmuError, load_robot

SENSORS = ("sensors.foot_force_noise=0.05", "sensors.foot_force_delay=0.012")
FAULTS = (
    "events=[{time=0.5, duration=0.1, sensor='angle', leg='LM', joint='femur', fault='late', "
    "delay=0.02}, {time=0.6, duration=0.1, sensor='attitude', fault='dead'}, "
    "{time=0.7, duration=0.1, leg='RF', fault='dead'}, {time=0.8, leg='LF', fault='late', "
    "delay=0.013}, {time=0.9, duration=0.2, leg='RM', joint='tibia', fault='limp'}, "
    "{time=1.3, duration=0.2, leg='LR', joint='coxa', fault='locked'}, "
    "{time=1.4, duration=0.2, leg='LF', joint='all', fault='weak'}, "
    "{time=1.4, duration=0.2, leg='RM', fault='noisy'}, "
    "{time=1.5, parameter='friction.mu', value=0.4}, "
    "{time=1.6, duration=0.03, lost='command'}, {time=1.7, duration=0.02, lost='step'}]"
)
PUSH = "events=[{time=0.7, duration=0.103, force=[0, 12, 0], torque=[0.1, 0, 0]}]"
TURN = ("command.yaw_rate=0.2", "command.roll=0.03", "command.vy=0.01")
ENDLESS = "events=[{time=0.1, duration=0.1, force=[1e8, 1e8, 1e8], torque=[1e8, 1e8, 1e8]}]"
# relative, of figures under the C and the Python controller, whose commands agree to 1e-12 rad
CLOSE = 1e-6
GROWTH = 1_000_000  # bytes    over 20 runs: less than one recording, of 2 MB

pytestmark = pytest.mark.usefixtures("plant_build")


def planned(name: str, *changes: str, seed: int | None = None) -> Scenario:
    scenario = load_scenario(name, overrides=["duration=2.5", "gait.period=0.6", *changes])
    return scenario if seed is None else replace(scenario, seed=seed, variation=STANDARD)


def in_python(scenario: Scenario, runner: Runner) -> tuple[Outcome, Result]:
    """Runs a scenario with the plant FMU and the controller FMU in the Python master."""
    plan = make_plan(scenario, gains=gains_of(scenario))
    controller = runner._controller_for(plan)
    controller.initialise(scenario.start, scenario.start + scenario.duration)
    with open_plant(scenario) as plant:
        parameters = initialise_plant(plant, plan)
        signals = Signals(plant, errors=errors_of(scenario, plan.schedule))
        ours = law_of_ours(controller, period=scenario.macro_step)
        recorder = Recorder(
            signals, plan.schedule.times, plan.schedule.rows, extra=diagnostic_columns(ours)
        )
        outcome = run(plant, signals, ours, plan.schedule, recorder, h=scenario.macro_step)
        return outcome, make_result(plan, outcome, plant, parameters, engine="python")


def steady(summary: Summary) -> Summary:
    """Returns the summary without the realtime factor, which depends on the machine, and NaNs."""
    figures = {
        name: value
        for name, value in summary.metrics.items()
        if name != "realtime_factor" and np.isfinite(value)
    }
    return replace(summary, metrics=figures)


@pytest.fixture
def runner() -> Iterator[Runner]:
    with Runner() as one:
        yield one


# ------------------------------------------------------------------------------------------------
# the same walk


WALKS = [
    planned("walk_flat", "control=compliant", seed=3),
    planned("walk_flat", "control=kinematic", "gait.name=ripple", *TURN, seed=4),
    planned("walk_flat", "control=compliant", "gait.name=wave", PUSH),
    planned("walk_flat", "control=compliant", FAULTS, *SENSORS),
    planned("walk_flat", "gait.name=amble", "friction.law=bristle", SENSORS[1]),
    planned(
        "phantomx_walk", "control=compliant", "start=7.3", "torso.mass=1.9", "macro_step=0.004"
    ),
]


@pytest.mark.parametrize("scenario", WALKS, ids=lambda scenario: scenario.title)
def test_every_signal_of_a_walk_is_the_python_masters_bit_for_bit(scenario: Scenario) -> None:
    with Runner(everything=True) as runner:
        expected, judged = in_python(scenario, runner)
        found = runner.simulate(scenario, gains=gains_of(scenario))
    assert (found.outcome.status, found.outcome.simulated) == (expected.status, expected.simulated)
    assert expected.status == COMPLETED
    ours, theirs = found.outcome.recording, expected.recording
    assert set(ours.names) == set(theirs.names)
    np.testing.assert_array_equal(ours.columns(theirs.names), theirs.data)
    assert found.parameters == judged.parameters
    assert steady(summarise(found)) == steady(summarise(judged))
    assert found.facts.walk.distance == judged.facts.walk.distance > 0.0


def test_what_is_recorded_changes_no_figure_and_runs_do_not_depend_on_those_before(
    runner: Runner,
) -> None:
    plans = [WALKS[3], replace(WALKS[1], robot="phantomx_mk4")]
    first = [steady(runner.summary(plan, gains=gains_of(plan))) for plan in plans]
    assert all(summary.walked for summary in first)
    again = [steady(runner.summary(plan, gains=gains_of(plan))) for plan in reversed(plans)]
    assert again[::-1] == first
    for plan, summary in zip(plans, first, strict=True):
        with Runner(everything=True) as other:
            assert steady(other.summary(plan, gains=gains_of(plan))) == summary


def test_the_figures_are_those_of_the_python_controller(runner: Runner) -> None:
    for scenario in WALKS[:2]:
        found, expected = (
            runner.simulate(scenario, gains=gains_of(scenario)),
            simulate(scenario, gains=gains_of(scenario)),
        )
        for name in expected.metrics.keys() - {"realtime_factor"}:
            assert found.metrics[name] == pytest.approx(
                expected.metrics[name], rel=CLOSE, abs=1e-12, nan_ok=True
            ), name
        assert found.facts.warnings == expected.facts.warnings
        assert found.parameters == expected.parameters


def test_a_study_may_bring_its_own_fmus(tmp_path: Path) -> None:
    scenario = WALKS[0]
    setup = make_plan(scenario).controller
    plain = replace(
        setup,
        gains=None,
        gait=replace(setup.gait, period=2.0),
        parts=replace(setup.parts, paper_pid=False),
    )
    plant, controller = (
        export_fmu(load_robot("athena"), tmp_path / "a.fmu"),
        export_controller(plain, tmp_path / "c.fmu"),
    )
    with Runner(fmu=plant, controller=controller) as given, Runner() as own:
        assert steady(given.summary(scenario, gains=gains_of(scenario))) == steady(
            own.summary(scenario, gains=gains_of(scenario))
        )


# ------------------------------------------------------------------------------------------------
# what goes wrong


def test_a_refused_step_ends_the_walk_as_in_python_and_the_next_one_begins_afresh(
    runner: Runner,
) -> None:
    bad = planned("walk_flat", "solver.method=dp54", "solver.step=0.002", ENDLESS)
    good = runner.summary(WALKS[0], gains=gains_of(WALKS[0]))
    expected, _ = in_python(bad, runner)
    found = runner.simulate(bad)
    assert (found.outcome.status, found.outcome.simulated) == (FAILED, expected.simulated)
    assert found.outcome.reason == expected.reason
    assert "not finite" in expected.reason
    assert len(found.outcome.recording.time) == len(expected.recording.time)
    assert steady(runner.summary(WALKS[0], gains=gains_of(WALKS[0]))) == steady(good)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"commands": (Command(vx=10.0),)}, "do not reach"),
        ({"robot": "nowhere.toml"}, "nowhere.toml"),
        ({"parameters": {"torso.mass": float("nan")}}, "torso.mass: got nan"),
        ({"parameters": {"torso.mas": 1.0}}, "no such variable"),
        (
            {"macro_step": 0.05, "settings": {"gait": {"period": 0.08}}},
            "impossible controller period",
        ),
    ],
)
def test_a_walk_that_cannot_begin_is_refused_with_a_message(
    runner: Runner, changes: dict[str, object], said: str
) -> None:
    good = runner.summary(WALKS[1])
    summary = runner.summary(replace(WALKS[1], **changes))  # type: ignore[arg-type]
    assert summary.status == REFUSED
    assert said in summary.reason
    assert steady(runner.summary(WALKS[1])) == steady(good)


def test_fmus_that_are_missing_or_something_else_are_refused(
    tmp_path: Path, athena_fmu: Path
) -> None:
    other = export_fmu(load_robot("phantomx_mk4"), tmp_path / "p.fmu")
    missing = tmp_path / "none.fmu"
    cases = (
        (missing, None, "no such FMU"),
        (None, missing, "no such FMU"),
        (None, athena_fmu, "no such variable"),
        (other, None, "another robot"),
    )
    for fmu, controller, said in cases:
        with Runner(fmu=fmu, controller=controller) as runner:
            summary = runner.summary(WALKS[0], gains=gains_of(WALKS[0]))
        assert summary.status == REFUSED
        assert said in summary.reason
    with Fmu(athena_fmu) as plant, Runner() as runner:
        swapped = runner._controller_for(make_plan(WALKS[1])), plant
        with pytest.raises(FmuError, match="not a hexapod plant"):
            NativeMaster(*swapped)


def test_a_run_says_which_loop_it_used_and_warns_when_it_was_not_that_in_c(runner: Runner) -> None:
    compiled = runner.simulate(replace(WALKS[0], duration=0.2)).facts
    broken = Fault(time=0.05, leg="LF", fault="nan")
    other = runner.simulate(replace(WALKS[0], duration=0.2, events=(broken,))).facts
    assert (compiled.engine, other.engine) == ("compiled", "python")
    assert other.warnings[0] == (
        "the run used the loop in Python: that in C does not support sensors that read NaN"
    )
    assert not any("loop in Python" in text for text in compiled.warnings)


def test_an_interrupted_walk_keeps_its_rows(runner: Runner) -> None:
    def stop(done: float) -> None:
        if done > 4.0:
            raise KeyboardInterrupt

    scenario = replace(WALKS[1], duration=60.0)
    result = runner.simulate(scenario, progress=stop)
    assert (result.outcome.status, result.outcome.reason) == (INTERRUPTED, "interrupted")
    assert 4.0 < result.outcome.simulated < 10.0
    assert np.isfinite(result.outcome.recording.data).all()
    assert runner.summary(WALKS[1]).walked


def test_memory_does_not_grow_with_the_number_of_runs(runner: Runner) -> None:
    plans = [replace(WALKS[0], seed=seed, duration=1.0) for seed in range(20)]
    gains = gains_of(WALKS[0])
    for plan in plans[:8]:
        runner.summary(plan, gains=gains)
    before = resident()
    for plan in plans:
        runner.summary(plan, gains=gains)
    assert resident() - before < GROWTH


def test_each_call_that_can_fail_in_c_has_a_message() -> None:
    named = [name for name in loop_header().constants if name.startswith("HX_CALL_")]
    assert named == ["HX_CALL_NONE", *CALLS]
    told = {name: name.split("_")[2].lower() for name in CALLS}
    assert told == {name: fmu for name, (fmu, _) in CALLS.items()}
