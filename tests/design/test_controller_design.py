"""The design of gains: requirements verified by python-control, files, and errors for impossible
ones.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import control
import numpy as np
import pytest

from hexapod_cosim.controller import (
    Gains,
    GainsError,
    LegSolver,
    Requirements,
    load_gains,
    make_gait,
    save_gains,
)
from hexapod_cosim.controller.comply.paper import Paper, Step
from hexapod_cosim.controller.design import StandingPlant, design_gains, plot_design
from hexapod_cosim.controller.design.loci import critical_size, loop_margins
from hexapod_cosim.controller.design.paper import (
    PaperLoops,
    late_filter,
    law_matrix,
    scaled,
    shifted,
)
from hexapod_cosim.controller.gains import Parts
from hexapod_cosim.cosim.design.gains import design_for, examine_stances, read_requirements
from hexapod_cosim.models import load_robot

PERIOD = 0.005  # s
ROBOTS = ("athena", "phantomx_mk4")
NOMINAL = "tripod LF LR RM, load 1, gears slip"
pytestmark = pytest.mark.usefixtures("plant_build")


@cache
def plants_of(name: str) -> dict[str, StandingPlant]:
    return examine_stances(load_robot(name), PERIOD)[0]


@cache
def designed(name: str) -> Gains:
    return design_gains(load_robot(name), PERIOD, plants=plants_of(name))


def redesigned(**given: float) -> Gains:
    """Returns gains of athena with other requirements."""
    needs = Requirements(**given)
    return design_gains(
        load_robot("athena"), PERIOD, plants=plants_of("athena"), requirements=needs
    )


def loops_of(gains: Gains, **given: float) -> PaperLoops:
    needs = replace(gains.requirements, **given)
    return PaperLoops(load_robot(gains.robot), plants_of(gains.robot), needs, period=PERIOD)


@pytest.fixture(scope="module", params=ROBOTS)
def gains(request: pytest.FixtureRequest, plant_build: Path) -> Gains:
    return designed(request.param)


def test_every_loop_of_every_plant_keeps_the_margins_asked_for(gains: Gains) -> None:
    loops = loops_of(gains)
    for name in plants_of(gains.robot):
        for locus in loops.loci(name, gains.paper):
            found = loop_margins(locus, loops.omega)
            assert found.gain >= gains.requirements.gain_margin
            assert found.phase >= gains.requirements.phase_margin


def test_margins_of_a_loop_known_in_closed_form() -> None:
    """The loop k / s with a delay T has phase margin 90 deg - k T and gain margin pi / (2 k T)."""
    k, late, omega = 10.0, 0.02, np.geomspace(0.1, 300.0, 600)
    loop = k / (1j * omega) * np.exp(-1j * omega * late)
    found = loop_margins(loop, omega)
    assert found.phase == pytest.approx(90.0 - np.degrees(k * late), rel=1e-3)
    assert found.gain == pytest.approx(20.0 * np.log10(np.pi / (2.0 * k * late)), rel=1e-2)
    assert critical_size(loop[None])[0] == pytest.approx(2.0 * k * late / np.pi, rel=1e-2)


def test_the_eigenloci_are_the_characteristic_function_of_all_feet(gains: Gains) -> None:
    """det(1 - P M F) over all feet, with law matrix M and filter F, is the product of 1 + locus."""
    robot, plant, loops = load_robot(gains.robot), plants_of(gains.robot)[NOMINAL], loops_of(gains)
    matrix = law_matrix(robot, plant, gains.paper)
    late = late_filter(gains.paper, period=PERIOD, delays=loops.delays)
    loci = loops.loci(NOMINAL, gains.paper)
    for k in (0, 80, 150):
        z = np.exp(1j * loops.omega[k] * PERIOD)
        whole = control.evalfr(shifted(robot, plant), z) @ matrix * control.evalfr(late, z)
        expected = np.linalg.det(np.eye(9) - whole)
        assert np.prod(1.0 + loci[:, k]) == pytest.approx(expected, rel=1e-6)


def test_the_law_of_the_design_is_the_one_that_runs(gains: Gains) -> None:
    """A change of steady forces shifts the standing feet as the design's matrix says."""
    robot, plant = load_robot(gains.robot), plants_of(gains.robot)[NOMINAL]
    legs, gait = LegSolver(robot), replace(make_gait(robot), duty=0.5)
    planned = legs.forward(plant.angle)
    pose = legs.pose(planned[:, 0] + 1j * planned[:, 1], planned[:, 2])
    # N    no foot carries half of the weight
    change = 0.1 * np.random.default_rng(1).standard_normal((6, 3)) * plant.standing[:, None]

    def shifts(force: np.ndarray) -> np.ndarray:
        law = Paper(robot, gait, gains, Parts(), legs=legs, period=PERIOD)
        step = Step(pose, planned, np.zeros(6), np.zeros(6), ~plant.standing, plant.angle, force)
        for _ in range(40):
            law.step(step)
        return np.column_stack([law.shift.real, law.shift.imag, law.lift])[plant.standing]

    found = shifts(plant.force + change) - shifts(plant.force)
    expected = law_matrix(robot, plant, gains.paper) @ change[plant.standing].reshape(-1)
    np.testing.assert_allclose(found.reshape(-1), expected, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("kind", ["gain", "static"])
def test_a_margin_is_where_the_closed_loops_become_unstable(gains: Gains, kind: str) -> None:
    """The eigenvalues of the whole loops agree with the margin on their frequency responses.

    On three feet there is no static loop, since statics determine their forces.
    """
    feet = {"gain": 3, "static": 6}[kind]
    plants = {n: p for n, p in plants_of(gains.robot).items() if p.standing.sum() == feet}
    loops = PaperLoops(load_robot(gains.robot), plants, gains.requirements, period=PERIOD)
    critical = 10.0 ** (getattr(loops.worst(gains.paper)[0], kind) / 20.0)
    assert loops.radius(scaled(gains.paper, 0.98 * critical)) < 1.0
    assert loops.radius(scaled(gains.paper, 1.02 * critical)) > 1.0


def test_a_larger_margin_makes_the_shares_smaller_and_a_smaller_one_no_larger_than_asked() -> None:
    usual, wide = designed("athena"), redesigned(gain_margin=12.0)
    assert wide.margins.binding.startswith("the margins (")
    factor = wide.paper.share / usual.paper.share
    assert wide.paper.share_limit == pytest.approx(factor * usual.paper.share_limit)
    assert wide.paper.return_rate == usual.paper.return_rate
    gained = wide.margins.paper_gain_margin - usual.margins.paper_gain_margin
    assert gained == pytest.approx(-20.0 * np.log10(factor), abs=0.01)
    assert 12.0 <= wide.margins.paper_gain_margin < 12.5  # dB    it is reduced by 5 % at a time
    narrow = redesigned(gain_margin=3.0)
    assert narrow.paper == usual.paper
    assert narrow.margins.binding == "the shares asked for"


def test_forces_delayed_by_30_ms_keep_the_loops_stable(gains: Gains) -> None:
    late = loops_of(gains, force_delay=0.030)
    assert late.delays == 7
    assert 4.0 < late.worst(gains.paper)[0].gain < gains.margins.paper_gain_margin
    assert late.radius(gains.paper) < 1.0


def test_the_late_filter_smooths_a_delayed_force_as_the_controller_does() -> None:
    gains = designed("athena").paper
    force = np.random.default_rng(2).standard_normal(80)
    kept, smooth, expected = np.exp(-PERIOD / gains.filter_time), 0.0, []
    for f in np.concatenate([np.zeros(3), force[:-3]]):
        smooth += (1.0 - kept) * (f - smooth)
        expected.append(smooth)
    system = late_filter(gains, period=PERIOD, delays=3)
    found = control.forced_response(system, np.arange(80) * PERIOD, force).outputs
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)


def test_saved_gains_are_loaded_to_the_last_bit(gains: Gains, tmp_path: Path) -> None:
    assert load_gains(save_gains(gains, tmp_path / "gains.toml")) == gains
    assert [path.name for path in tmp_path.iterdir()] == ["gains.toml"]


def test_caveats_are_kept_and_warned_about(tmp_path: Path) -> None:
    gains = replace(designed("athena"), caveats=("the design leaves out a: b", 'and "c"'))
    path = save_gains(gains, tmp_path / "gains.toml")
    assert load_gains(path) == gains
    assert gains.warnings(load_robot("athena"), period=PERIOD) == (
        "the design leaves out a: b",
        'and "c"',
    )


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "height_share = ",
            "hight_share = ",
            "unknown key.*hight_share.*did you mean 'height_share'",
        ),
        ("\n[hold]", "\n[hald]", "\\[hold\\]: wrong type.*expected a table"),
        ("damping = ", "damping = -", "damping: value not allowed"),
        ("format = 5", "format = 4", "unknown format"),
        ("caveats = []", "caveats = [1.0]", "caveats: wrong type"),
        ("\nlimit = ", "\nlimit = true # ", "limit: wrong type"),
        ("format = 5", "format = ", "not a TOML file"),
    ],
)
def test_a_damaged_gains_file_is_refused(old: str, new: str, message: str, tmp_path: Path) -> None:
    path = save_gains(designed("athena"), tmp_path / "gains.toml")
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(GainsError, match=message):
        load_gains(path)


def test_a_missing_file_or_folder_is_reported(gains: Gains, tmp_path: Path) -> None:
    with pytest.raises(GainsError, match="cannot read the gains file"):
        load_gains(tmp_path / "none.toml")
    with pytest.raises(GainsError, match="cannot write the gains file"):
        save_gains(gains, tmp_path / "no" / "gains.toml")


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("filter_time=0", "filter_time: value not allowed: got 0.0, expected a finite number > 0"),
        (
            "force_delay=-1",
            "force_delay: value not allowed: got -1.0, expected a finite number >= 0",
        ),
        ("phase_margn=50", "unknown requirement.*did you mean 'phase_margin'"),
        ("phase_margin=steep", "not a number: got 'steep'"),
    ],
)
def test_impossible_requirements_are_reported_by_name(setting: str, message: str) -> None:
    robot = load_robot("athena")
    with pytest.raises(GainsError, match=message):
        design_gains(
            robot,
            PERIOD,
            plants=plants_of("athena"),
            requirements=read_requirements([setting], robot),
        )


def test_a_robot_a_period_or_plants_that_do_not_fit_are_refused() -> None:
    robot, plants = load_robot("athena"), plants_of("athena")
    limp = replace(robot, servo=replace(robot.servo, mode="torque"))
    with pytest.raises(GainsError, match="compliant control shifts the servos' targets"):
        design_for(limp, PERIOD)
    with pytest.raises(GainsError, match="compliant control shifts the servos' targets"):
        design_gains(limp, PERIOD, plants=plants)
    with pytest.raises(GainsError, match="impossible controller period"):
        design_for(robot, -0.1)
    with pytest.raises(GainsError, match="a plant sampled with another period"):
        design_gains(robot, 0.004, plants=plants)


def test_the_design_is_drawn(tmp_path: Path) -> None:
    gains, plants = (
        designed("athena"),
        {name: plant for name, plant in plants_of("athena").items() if "load 1" in name},
    )
    written = plot_design(load_robot("athena"), gains, plants, tmp_path)
    assert len(written) == 6
    assert all(path.stat().st_size > 5000 for path in written)
