"""The design of gains: requirements verified by python-control, files, and errors for impossible
ones.
"""

from __future__ import annotations

from dataclasses import asdict, replace
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
from hexapod_cosim.controller.controller import gains_warnings
from hexapod_cosim.controller.design import StandingPlant, design_gains, plot_design
from hexapod_cosim.controller.design.closed import disturbed, spectral_radius
from hexapod_cosim.controller.design.loci import critical_size, loop_margins, response
from hexapod_cosim.controller.design.paper import (
    PaperLoops,
    closed_loop,
    delay_steps,
    late_filter,
    law_matrix,
    scaled,
    shifted,
)
from hexapod_cosim.controller.parts import Parts
from hexapod_cosim.cosim.design.gain_design import design_for, read_requirements, standing_plants
from hexapod_cosim.models import load_robot

PERIOD = 0.005  # s
ROBOTS = ("athena", "phantomx_mk4")
NOMINAL = "tripod LF LR RM, load 1, gears slip"
AT_ONE = 1e-5  # 1    the next eigenvalues are 1e-3 away
pytestmark = pytest.mark.usefixtures("plant_build")


@cache
def plants_of(name: str) -> dict[str, StandingPlant]:
    return standing_plants(load_robot(name), PERIOD)


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


def test_all_feet_together_are_stable(gains: Gains) -> None:
    robot, delays = load_robot(gains.robot), loops_of(gains).delays
    for name, plant in plants_of(gains.robot).items():
        loop = closed_loop(robot, plant, gains.paper, delays=delays)
        assert spectral_radius(loop) < 1.0, name
        # the position on the ground is held by nothing, and all else is
        assert (np.abs(np.linalg.eigvals(loop.A) - 1.0) < AT_ONE).sum() == 3, name


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


def test_the_static_margin_is_that_of_the_share_beside_ground_that_yields(gains: Gains) -> None:
    """A share of 1 would be the edge on hard ground; ground in series with the leg adds to it."""
    hard = -20.0 * np.log10(gains.paper.share_limit)
    assert hard < gains.margins.paper_static_margin < hard + 1.0  # dB


def test_gains_scaled_by_a_factor_scale_the_law_and_the_loci(gains: Gains) -> None:
    robot, plant, loops = load_robot(gains.robot), plants_of(gains.robot)[NOMINAL], loops_of(gains)
    twice = scaled(gains.paper, 2.0)
    np.testing.assert_allclose(
        law_matrix(robot, plant, twice), 2.0 * law_matrix(robot, plant, gains.paper), rtol=1e-12
    )
    assert loops.worst(gains.paper)[0].gain - loops.worst(twice)[0].gain == pytest.approx(
        20.0 * np.log10(2.0), abs=0.01
    )


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


def test_a_response_is_python_controls() -> None:
    omega = np.array([1.0, 30.0, 200.0])
    system = shifted(load_robot("athena"), plants_of("athena")[NOMINAL])
    for w, found in zip(omega, response(system, omega), strict=True):
        expected = control.evalfr(system, np.exp(1j * w * PERIOD))
        np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max())


def test_delays_count_whole_periods() -> None:
    assert delay_steps(Requirements(delay_periods=1.0, force_delay=0.01), period=0.005) == 3
    assert delay_steps(Requirements(delay_periods=0.2, force_delay=0.011), period=0.005) == 4
    assert delay_steps(Requirements(delay_periods=0.0, force_delay=0.0), period=0.005) == 0


def test_sections_that_need_no_design_come_from_the_requirements(gains: Gains) -> None:
    needs, robot = gains.requirements, load_robot(gains.robot)
    assert gains.hold.attitude_rate == needs.attitude_rate
    assert gains.support.handover_time == needs.handover_time
    assert gains.limits.torque == needs.torque_share * robot.servo.torque_max
    assert gains.support.load_time == needs.load_time
    assert gains.paper.limit == needs.deflection_limit
    assert gains.paper.damping == pytest.approx(robot.weight / 6.0 / 0.9)


def test_gains_are_for_their_robot(gains: Gains) -> None:
    robot = load_robot(gains.robot)
    assert gains.mismatch(robot, period=PERIOD) is None
    heavier = replace(robot, torso=replace(robot.torso, mass=robot.torso.mass + 2.0))
    assert gains.mismatch(heavier, period=PERIOD) is not None


def test_a_stiffer_robot_gets_gains_of_its_own() -> None:
    robot = load_robot("athena")
    stiffer = replace(robot, servo=replace(robot.servo, kp=2.0 * robot.servo.kp))
    found = design_for(stiffer, PERIOD)
    assert found.robot_hash == stiffer.hash
    usual = designed("athena").margins
    assert found.margins.paper_gain_margin != usual.paper_gain_margin


def test_saved_gains_are_loaded_to_the_last_bit(gains: Gains, tmp_path: Path) -> None:
    assert load_gains(save_gains(gains, tmp_path / "gains.toml")) == gains
    assert [path.name for path in tmp_path.iterdir()] == ["gains.toml"]


def test_the_facts_of_gains_are_all_their_fields(gains: Gains) -> None:
    assert gains.as_facts() == asdict(gains)


def test_caveats_are_kept_and_warned_about(tmp_path: Path) -> None:
    gains = replace(designed("athena"), caveats=("the design leaves out a: b", 'and "c"'))
    path = save_gains(gains, tmp_path / "gains.toml")
    assert load_gains(path) == gains
    assert gains_warnings(load_robot("athena"), gains, PERIOD) == (
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
    assert len(written) == 8
    assert all(path.stat().st_size > 5000 for path in written)
    with pytest.raises(GainsError, match="not the robot of these gains"):
        plot_design(load_robot("phantomx_mk4"), gains, plants, tmp_path)
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(GainsError, match="cannot write the design's figures"):
        plot_design(load_robot("athena"), gains, plants, tmp_path / "file")


def test_a_disturbance_rises_and_stays() -> None:
    time, outputs = disturbed(control.ss([], [], [], [[2.0]], 0.01), np.array([3.0]), duration=0.2)
    assert len(time) == 20
    assert np.all(np.diff(outputs[0]) >= 0.0)
    assert outputs[0, -1] == 6.0
