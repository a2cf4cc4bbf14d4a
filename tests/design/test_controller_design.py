"""The design of gains: requirements verified by python-control, files, and errors for impossible
ones.
"""

from __future__ import annotations

import re
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
    SuspensionGains,
    load_gains,
    save_gains,
)
from hexapod_cosim.controller.controller import gains_warnings
from hexapod_cosim.controller.design import StandingPlant, design_gains, plot_design
from hexapod_cosim.controller.design.closed import (
    FREE_COORDINATES,
    closed_loop,
    disturbed,
    spectral_radius,
    splay,
)
from hexapod_cosim.controller.design.laws import (
    Laws,
    delay,
    delay_response,
    delay_steps,
    sampled_slip_law,
    slip_law,
    slip_response,
)
from hexapod_cosim.controller.design.loci import (
    all_loci,
    critical_size,
    eigenloci,
    frequencies,
    loop_margins,
    quick_margins,
    response,
)
from hexapod_cosim.controller.design.standing import answers, axes_of, relieved, squeeze_matrix
from hexapod_cosim.cosim.design.gain_design import design_for, read_requirements, standing_plants
from hexapod_cosim.models import load_robot

PERIOD = 0.005  # s
ROBOTS = ("athena", "phantomx_mk4")
MARGIN_ERROR = (0.3, 1.0)  # dB, deg    between two interpolations of a frequency grid
NOMINAL = "tripod LF LR RM, load 1, gears slip"
AT_ONE = 1e-4  # 1    ninefold eigenvalues are found to 3e-6, the next are 2e-2 away
FINE = 400  # frequencies
pytestmark = pytest.mark.usefixtures("plant_build")


@cache
def plants_of(name: str) -> dict[str, StandingPlant]:
    return standing_plants(load_robot(name), PERIOD)


@cache
def designed(name: str) -> Gains:
    return design_gains(load_robot(name), PERIOD, plants=plants_of(name))


def laws_of(gains: Gains) -> Laws:
    delays = delay_steps(gains.requirements, period=gains.period)
    return Laws(slip=gains.slip, suspension=gains.suspension, period=gains.period, delays=delays)


def scaled(gains: Gains, by: float) -> Gains:
    slip = replace(gains.slip, kp=by * gains.slip.kp, ki=by * gains.slip.ki, kd=by * gains.slip.kd)
    return replace(gains, slip=slip)


@pytest.fixture(scope="module", params=ROBOTS)
def gains(request: pytest.FixtureRequest, plant_build: Path) -> Gains:
    return designed(request.param)


def test_every_loop_of_every_plant_keeps_the_margins_asked_for(gains: Gains) -> None:
    omega = frequencies(PERIOD, FINE)
    for loci, law in zip(
        all_loci(load_robot(gains.robot), plants_of(gains.robot), omega),
        laws_of(gains).responses(omega),
        strict=True,
    ):
        for locus in loci.values:
            found = quick_margins(locus * law, omega)
            assert found.gain >= gains.requirements.gain_margin
            assert found.phase >= gains.requirements.phase_margin


def test_the_quick_margins_are_python_controls(gains: Gains) -> None:
    omega = frequencies(PERIOD, FINE)
    for loci, law in zip(
        eigenloci(load_robot(gains.robot), plants_of(gains.robot)[NOMINAL], omega),
        laws_of(gains).responses(omega),
        strict=True,
    ):
        for locus in loci:
            mine, theirs = quick_margins(locus * law, omega), loop_margins(locus * law, omega)
            for name, error in zip(("gain", "phase"), MARGIN_ERROR, strict=True):
                assert (
                    getattr(mine, name) == getattr(theirs, name)
                    or abs(getattr(mine, name) - getattr(theirs, name)) < error
                )
            assert mine.crossover == pytest.approx(theirs.crossover, rel=0.02)
            assert mine.delay == pytest.approx(theirs.delay, rel=0.02)


def test_margins_of_a_loop_known_in_closed_form() -> None:
    """The loop k / s with a delay T has crossover k and phase margin 90 deg - k T.

    Its gain margin is pi / (2 k T) and its delay margin (pi/2)/k - T.
    """
    k, late, omega = 10.0, 0.02, np.geomspace(0.1, 300.0, 600)
    loop = k / (1j * omega) * np.exp(-1j * omega * late)
    for found in (quick_margins(loop, omega), loop_margins(loop, omega)):
        assert found.crossover == pytest.approx(k, rel=1e-3)
        assert found.phase == pytest.approx(90.0 - np.degrees(k * late), rel=1e-3)
        assert found.gain == pytest.approx(20.0 * np.log10(np.pi / (2.0 * k * late)), rel=1e-2)
        assert found.delay == pytest.approx(np.pi / 2.0 / k - late, rel=2e-3)


def test_the_eigenloci_are_the_characteristic_function_of_all_feet(gains: Gains) -> None:
    """det(1 - l S P W) over all feet is the product of all 1 + l locus, for any l."""
    robot, plant, omega = (
        load_robot(gains.robot),
        plants_of(gains.robot)[NOMINAL],
        np.array([1.0, 30.0, 200.0]),
    )
    loads, _ = answers(robot, plant)
    flat, _ = axes_of(3)
    whole = (
        squeeze_matrix(robot, plant)
        @ response(relieved(robot, plant), omega)[:, flat][:, :, flat]
        * np.repeat(loads, 2)
    )
    for law in (1.0, 2.0 - 3.0j):
        expected = np.linalg.det(np.eye(6) - law * whole)
        np.testing.assert_allclose(
            np.prod(1.0 + law * eigenloci(robot, plant, omega)[0], axis=0), expected, rtol=1e-9
        )


@pytest.mark.parametrize(("name", "feet"), [(NOMINAL, 3), ("six legs, load 1, gears slip", 6)])
def test_the_common_push_and_twist_of_all_feet_are_no_squeeze_and_have_no_locus(
    name: str, feet: int
) -> None:
    robot, plant = load_robot("athena"), plants_of("athena")[name]
    normal, matrix = plant.force[plant.standing, 2], squeeze_matrix(robot, plant)
    places = LegSolver(robot).forward(plant.angle)[plant.standing, :2]
    turned = (places - normal @ places / normal.sum()) @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    for common in (np.outer(normal, [0.3, -2.0]), normal[:, None] * turned):
        np.testing.assert_allclose(matrix @ common.reshape(-1), 0.0, atol=1e-12)
    left = (matrix @ np.arange(2.0 * feet)).reshape(feet, 2)
    np.testing.assert_allclose(left.sum(axis=0), 0.0, atol=1e-12)
    assert abs((places[:, 0] * left[:, 1] - places[:, 1] * left[:, 0]).sum()) < 1e-12
    assert (
        np.linalg.matrix_rank(matrix)
        == 2 * feet - 3
        == len(eigenloci(robot, plant, np.array([1.0]))[0])
    )


def test_all_feet_and_both_laws_together_are_stable(gains: Gains) -> None:
    robot, laws = load_robot(gains.robot), laws_of(gains)
    for name, plant in plants_of(gains.robot).items():
        feet = int(plant.standing.sum())
        loop = closed_loop(robot, plant, laws)
        assert spectral_radius(loop, feet=feet) < 1.0, name
        held = np.abs(np.linalg.eigvals(loop.A) - 1.0) < AT_ONE
        # what nothing holds is exactly 1, and nothing else is
        assert held.sum() == FREE_COORDINATES + 2 * feet


def test_the_gain_margin_is_where_the_closed_loop_becomes_unstable(gains: Gains) -> None:
    """Compares the generalised Nyquist criterion with the eigenvalues of the loop without the
    suspension.
    """
    robot, name = load_robot(gains.robot), "six legs, load 2, gears slip"
    plant, omega = plants_of(gains.robot)[name], frequencies(PERIOD, FINE)
    critical = (
        1.0
        / critical_size(
            eigenloci(robot, plant, omega)[0] * laws_of(gains).responses(omega)[0]
        ).max()
    )
    spring = gains.suspension
    rigid = replace(
        gains,
        suspension=SuspensionGains(
            limit=1.0,
            **{key: 1e6 * getattr(spring, key) for key in ("mass", "damping", "stiffness")},
        ),
    )
    for by, stable in ((0.97 * critical, True), (1.03 * critical, False)):
        radius = spectral_radius(closed_loop(robot, plant, laws_of(scaled(rigid, by))), feet=6)
        assert (radius < 1.0) is stable


def test_the_design_uses_the_margin_it_has(gains: Gains) -> None:
    """A gain larger by a tenth violates the margin that is reported as binding."""
    omega = frequencies(PERIOD, FINE)
    law, needs = laws_of(scaled(gains, 1.1)).responses(omega)[0], gains.requirements
    margin, name = gains.margins.binding.removesuffix(")").split(" (", 1)
    found = [
        quick_margins(locus * law, omega)
        for locus in eigenloci(load_robot(gains.robot), plants_of(gains.robot)[name], omega)[0]
    ]
    least = min(m.gain for m in found) if margin == "gain_margin" else min(m.phase for m in found)
    assert least < getattr(needs, margin)


def test_less_delay_or_less_margin_allows_more_integral_action() -> None:
    robot, plants = load_robot("athena"), plants_of("athena")
    for needs in (
        Requirements(force_delay=0.0),
        Requirements(delay_periods=0.0),
        Requirements(phase_margin=40.0, gain_margin=5.0),
    ):
        assert (
            design_gains(robot, PERIOD, plants=plants, requirements=needs).slip.ki
            > 1.1 * designed("athena").slip.ki
        )


def test_the_steady_slip_is_what_a_steady_drag_is_left_with() -> None:
    """The targets of the feet splay at a constant rate.

    The force with the law is compared with that without it, after the transients.
    """
    robot, plant, gains = (
        load_robot("athena"),
        plants_of("athena")["six legs, load 1, gears slip"],
        designed("athena"),
    )
    ramp = np.arange(600) * PERIOD
    forces = [
        control.forced_response(system, ramp, np.outer(splay(robot, plant), ramp)).outputs[:, -1]
        @ splay(robot, plant)
        for system in (closed_loop(robot, plant, laws_of(gains)), relieved(robot, plant))
    ]
    assert forces[0] / forces[1] < 1.1 * gains.margins.slip_rejection


def test_the_laws_closed_form_response_is_its_systems(gains: Gains) -> None:
    omega = frequencies(PERIOD, FINE)
    system = sampled_slip_law(gains.slip, period=PERIOD)
    np.testing.assert_allclose(
        slip_response(gains.slip, omega, period=PERIOD), response(system, omega)[:, 0, 0], rtol=1e-6
    )
    assert response(system, omega)[40, 0, 0] == pytest.approx(
        control.evalfr(system, np.exp(1j * omega[40] * PERIOD)), rel=1e-9
    )
    late = delay(3, period=PERIOD)
    np.testing.assert_allclose(
        delay_response(3, omega, period=PERIOD), response(late, omega)[:, 0, 0], rtol=1e-9
    )
    slow = np.array([1.0, 3.0])
    s = [slip_law(gains.slip)(1j * w) for w in slow]
    # at 1 % of the Nyquist frequency
    np.testing.assert_allclose(slip_response(gains.slip, slow, period=PERIOD), s, rtol=1e-3)


def test_the_law_is_the_difference_equations_that_run() -> None:
    """Filter, integral and derivative are discretised by Tustin, each with its own last value."""
    gains, h = replace(designed("athena").slip, kp=0.7, kd=0.003), PERIOD
    force = np.random.default_rng(2).standard_normal(80)
    e, smooth, total, slope, expected = 0.0, 0.0, 0.0, 0.0, []
    for f in force:
        new = (h * (f + e) + (2.0 * gains.filter_time - h) * smooth) / (2.0 * gains.filter_time + h)
        total += 0.5 * gains.ki * h * (new + smooth)
        slope = (2.0 * gains.kd * (new - smooth) + (2.0 * gains.derivative_time - h) * slope) / (
            2.0 * gains.derivative_time + h
        )
        e, smooth = f, new
        expected.append(gains.kp * smooth + total + slope)
    found = control.forced_response(
        sampled_slip_law(gains, period=h), np.arange(80) * h, force
    ).outputs
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_delays_count_whole_periods() -> None:
    assert delay_steps(Requirements(delay_periods=1.0, force_delay=0.01), period=0.005) == 3
    assert delay_steps(Requirements(delay_periods=0.2, force_delay=0.011), period=0.005) == 4
    assert delay_steps(Requirements(delay_periods=0.0, force_delay=0.0), period=0.005) == 0


def test_sections_that_need_no_design_come_from_the_requirements(gains: Gains) -> None:
    needs, robot = gains.requirements, load_robot(gains.robot)
    assert gains.hold.attitude_rate == needs.attitude_rate
    assert gains.support.handover_time == needs.handover_time
    assert gains.limits.torque == needs.torque_share * robot.servo.torque_max
    assert gains.slip.limit == needs.slip_limit
    assert gains.slip.derivative_time == 0.010  # s    two periods
    share = robot.total_mass * 9.81 / 3.0
    assert share / gains.suspension.stiffness == pytest.approx(needs.deflection)


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
    assert found.slip.ki != designed("athena").slip.ki


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
    path.write_text(
        path.read_text(encoding="utf-8").replace("caveats = [", "caveats = [1.0, "),
        encoding="utf-8",
    )
    with pytest.raises(GainsError, match=r"caveats: wrong type: got 1\.0, expected a text"):
        load_gains(path)
    path.write_text(
        re.sub("caveats = .*", 'caveats = "a"', path.read_text(encoding="utf-8")), encoding="utf-8"
    )
    with pytest.raises(GainsError, match="caveats: wrong type: got 'a', expected a list of texts"):
        load_gains(path)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "tracking_time = ",
            "traking_time = ",
            "unknown key.*traking_time.*did you mean 'tracking_time'",
        ),
        ("\n[slip]", "\n[slop]", "missing section.*\\[slip\\]"),
        ("stiffness = ", "stiffness = -", "suspension.stiffness: impossible value"),
        ("format = 3", "format = 2", "unknown format"),
        ("limit = ", "limit = true # ", "requirements.slip_limit: wrong type"),
        ("format = 3", "format = ", "not a TOML file"),
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
        (
            "deflection=0.2",
            "misses its phase_margin of the suspension: got .*, expected at least 60",
        ),
        ("slip_rejection=0.05", "misses its slip_rejection: got 0.09., expected at most 0.05"),
        ("bandwidth=40", "misses its bandwidth: got 27.4.., expected at least 40"),
        ("frequency=0", "frequency: impossible requirement"),
        ("force_delay=-1", "force_delay: impossible requirement: got -1.0, expected a number >= 0"),
        ("phase_margn=50", "unknown requirement.*did you mean 'phase_margin'"),
        ("phase_margin=steep", "not a number: got 'steep'"),
    ],
)
def test_requirements_that_cannot_be_met_are_reported_by_name(setting: str, message: str) -> None:
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
