"""Gains and FMUs that runs share: each is made once for everything it depends on."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from gains import make_gains

from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.run import preparation as preparation_module
from hexapod_cosim.cosim.run.preparation import Preparation, preparation_key
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.cosim.scenario.scenario import load_scenario
from hexapod_cosim.models import HexapodError, load_robot


def scenario(*changes: str) -> Scenario:
    return load_scenario("walk_flat", overrides=["control=compliant", *changes])


@pytest.fixture
def designed(monkeypatch: pytest.MonkeyPatch) -> list[Scenario]:
    """Replaces the design of gains; returns the list of scenarios it is called for."""
    calls: list[Scenario] = []

    def design(plan: Scenario, _given: Gains | None = None) -> Gains:
        calls.append(plan)
        return make_gains(load_robot("athena"), period=plan.macro_step)

    monkeypatch.setattr(preparation_module, "chosen_gains", design)
    return calls


def test_gains_are_designed_once_for_robot_and_macro_step(
    designed: list[Scenario], tmp_path: Path
) -> None:
    preparation = Preparation(tmp_path)
    first = preparation.gains(scenario("friction.mu=0.3"))
    assert preparation.gains(replace(scenario("friction.mu=0.9"), seed=4)) is first
    assert len(designed) == 1
    assert preparation.gains(scenario("macro_step=0.004")) is not first
    assert preparation.gains(scenario("servo.torque_max=3.0")) is not first
    assert len(designed) == 3


def test_the_least_recently_used_gains_go_first(
    designed: list[Scenario], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(preparation_module, "MAX_DESIGNS", 2)
    preparation = Preparation(tmp_path)
    a, b, c = (scenario(f"macro_step={step}") for step in (0.002, 0.004, 0.005))
    for plan in (a, b, a, c, a):
        preparation.gains(plan)
    assert designed == [a, b, c]
    preparation.gains(b)
    assert designed == [a, b, c, b]


def test_kinematic_control_has_no_gains_and_given_ones_are_kept(tmp_path: Path) -> None:
    given = make_gains(load_robot("athena"))
    preparation = Preparation(tmp_path, gains=given)
    assert preparation.gains(scenario()) is given
    assert preparation.gains(replace(scenario(), control="kinematic")) is None


def test_keys_are_equal_for_scenarios_that_share_gains() -> None:
    assert preparation_key(scenario("torso.mass=3")) == preparation_key(scenario())
    assert preparation_key(scenario("robot=phantomx_mk4")) != preparation_key(scenario())


def test_an_fmu_is_exported_once_for_a_robot(plant_build: Path, tmp_path: Path) -> None:
    robot = tmp_path / "copy.toml"
    robot.write_text((Path(load_robot.__code__.co_filename).parent / "athena.toml").read_text())
    preparation = Preparation(tmp_path)
    first = preparation.fmu("athena")
    assert first.is_file()
    assert preparation.fmu("athena") == first
    assert preparation.fmu(str(robot)) == first
    assert preparation.fmu("phantomx_mk4") != first
    assert Preparation(tmp_path, fmu=first).fmu("phantomx_mk4") == first
    with pytest.raises(HexapodError, match=r"nowhere\.toml"):
        preparation.fmu("nowhere.toml")
