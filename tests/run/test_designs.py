"""Gains, stances and FMUs that runs share: each is made once for everything it depends on."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from gains import make_gains

from hexapod_cosim.controller import Gains, Gait, make_gait
from hexapod_cosim.cosim.design.stance import StanceChange, find_stance
from hexapod_cosim.cosim.export.plant import export_fmu
from hexapod_cosim.cosim.run import gait_selection, plant
from hexapod_cosim.cosim.run.designs import designed_gains, kept_gains, kept_stance
from hexapod_cosim.cosim.run.plan import chosen_gains
from hexapod_cosim.cosim.run.plant import PlantFmus
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.models import HexapodError, Robot, load_robot

Design = tuple[Robot, float]  # robot and period [s]


def scenario(*changes: str) -> Scenario:
    return load_scenario("walk_flat", overrides=["control=compliant", *changes])


@pytest.fixture
def designs(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[list[Design]]:
    """Replaces the design of gains, with a cache of its own; returns the list of what it is called
    for.
    """
    calls: list[Design] = []

    def design(robot: Robot, period: float) -> Gains:
        calls.append((robot, period))
        return make_gains(load_robot("athena"), period=period)

    monkeypatch.setattr("hexapod_cosim.cosim.design.gains.design_for", design)
    monkeypatch.setattr("hexapod_cosim.cosim.run.designs.user_cache", lambda: tmp_path)
    designed_gains.cache_clear()
    yield calls
    designed_gains.cache_clear()


def test_gains_are_designed_once_for_robot_and_macro_step(designs: list[Design]) -> None:
    first = chosen_gains(scenario("friction.mu=0.3"))
    assert chosen_gains(replace(scenario("friction.mu=0.9"), seed=4)) is first
    assert len(designs) == 1
    assert chosen_gains(scenario("macro_step=0.004")) is not first
    assert chosen_gains(scenario("servo.torque_max=3.0")) is not first
    assert len(designs) == 3


def test_kept_gains_have_the_bits_of_designed_ones(tmp_path: Path) -> None:
    robot = load_robot("athena")
    gains = replace(make_gains(robot, period=0.005), caveats=('a "text"',))
    assert kept_gains(robot, 0.005, lambda _robot, _period: gains, tmp_path) is gains
    assert kept_gains(robot, 0.005, _no_design, tmp_path) == gains


def _no_design(robot: Robot, period: float) -> Gains:
    raise AssertionError("gains that are kept are not designed again")


def test_gains_from_the_cache_do_not_import_python_control(
    designs: list[Design], monkeypatch: pytest.MonkeyPatch
) -> None:
    first = chosen_gains(scenario())
    designed_gains.cache_clear()
    monkeypatch.setitem(sys.modules, "hexapod_cosim.cosim.design.gains", None)  # refuses an import
    assert chosen_gains(scenario()) == first


def test_a_damaged_file_of_the_cache_is_replaced(designs: list[Design], tmp_path: Path) -> None:
    first = chosen_gains(scenario())
    (path,) = tmp_path.glob("gains/*.toml")
    path.write_text("period = ", encoding="utf-8")
    designed_gains.cache_clear()
    assert chosen_gains(scenario()) == first
    designed_gains.cache_clear()
    assert chosen_gains(scenario()) == first
    assert len(designs) == 2


def test_kinematic_control_has_no_gains_and_given_ones_are_kept() -> None:
    given = make_gains(load_robot("athena"))
    assert chosen_gains(scenario(), given) is given
    assert chosen_gains(replace(scenario(), control="kinematic"), given) is None


def test_an_fmu_is_exported_once_for_a_robot(plant_build: Path, tmp_path: Path) -> None:
    robot = tmp_path / "copy.toml"
    robot.write_text((Path(load_robot.__code__.co_filename).parent / "athena.toml").read_text())
    fmus = PlantFmus(tmp_path)
    first = fmus.fmu("athena")
    assert first.is_file()
    assert fmus.fmu("athena") == first
    assert fmus.fmu(str(robot)) == first
    assert fmus.fmu("phantomx_mk4") != first
    assert PlantFmus(tmp_path, given=first).fmu("phantomx_mk4") == first
    with pytest.raises(HexapodError, match=r"nowhere\.toml"):
        fmus.fmu("nowhere.toml")


def test_a_process_packs_the_fmu_of_a_robot_once_and_a_new_binary_anew(
    plant_build: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    packed: list[str] = []

    def export(robot: Robot, path: Path, *, bare: bool) -> Path:
        packed.append(robot.name)
        return export_fmu(robot, path, bare=bare)

    monkeypatch.setattr(plant, "export_fmu", export)
    plant._content.cache_clear()
    first, second = (PlantFmus(tmp_path / name).fmu("athena") for name in ("a", "b"))
    assert packed == ["athena"]
    fresh = export_fmu(load_robot("athena"), tmp_path / "athena.fmu", bare=True).read_bytes()
    assert first.read_bytes() == second.read_bytes() == fresh
    library = tmp_path / "hexapod.so"
    library.write_bytes(b"built later")
    monkeypatch.setattr(plant, "binary", lambda *_: library)
    PlantFmus(tmp_path / "c").fmu("athena")
    assert packed == ["athena", "athena"]


def test_a_kept_stance_has_the_bits_of_the_designed_one(tmp_path: Path) -> None:
    robot, gait = load_robot("athena"), make_gait(load_robot("athena"), "amble")
    stance = StanceChange(-1.0 / 3.0, 0.1 + 0.2)
    found = [kept_stance(robot, gait, lambda *_: stance, tmp_path)]
    found.append(kept_stance(robot, gait, lambda *_: StanceChange(0.0, 0.0), tmp_path))
    assert found == [stance, stance]


@pytest.mark.parametrize("damage", ["{", '{"outward": 1e999, "deeper": 0}', "{}"])
def test_a_damaged_stance_of_the_cache_is_replaced(tmp_path: Path, damage: str) -> None:
    robot, gait = load_robot("athena"), make_gait(load_robot("athena"), "amble")
    stance = StanceChange(0.01, -0.02)
    kept_stance(robot, gait, lambda *_: StanceChange(0.0, 0.0), tmp_path)
    (path,) = tmp_path.glob("stances/*.json")
    path.write_text(damage, encoding="utf-8")
    assert kept_stance(robot, gait, lambda *_: stance, tmp_path) == stance
    assert kept_stance(robot, gait, lambda *_: StanceChange(0.0, 0.0), tmp_path) == stance


def test_a_walk_of_an_earlier_process_is_not_designed_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    designs: list[str] = []

    def find(robot: Robot, gait: Gait) -> StanceChange:
        designs.append(gait.name)
        return find_stance(robot, gait)

    monkeypatch.setattr(gait_selection, "find_stance", find)
    monkeypatch.setattr("hexapod_cosim.cosim.run.designs.user_cache", lambda: tmp_path)
    plan = load_scenario("stand", overrides=["control=compliant"])
    walks = []
    for _ in range(2):
        gait_selection._design.cache_clear()
        walks.append(gait_selection.select_gait(plan))
    gait_selection._design.cache_clear()
    assert designs == ["amble"]
    assert walks[0] == walks[1]
    assert walks[0].outward < 0.0
