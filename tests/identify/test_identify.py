"""Identification: secret robots are found within their intervals, a log says nothing of what it
does not show, and the robot file is the identified robot.
"""

from __future__ import annotations

import json
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command import Call, assert_refused
from secret_robots import NOISE, Secret, secret_robot, with_column

from benchmarks.identify.robots import GOAL_COVERED, GOAL_RATIO, summary, table_row
from benchmarks.identify.robots import score as score_of
from hexapod_cosim.cosim.logs.mcap_writer import write_mcap
from hexapod_cosim.extensions.identify.experiment import of_point
from hexapod_cosim.extensions.identify.fitting.misfit import misfits, read_noise
from hexapod_cosim.extensions.identify.fitting.problem import Problem
from hexapod_cosim.extensions.identify.identification import (
    TOLERANCE,
    Identified,
    identify,
    make_experiment,
)
from hexapod_cosim.extensions.identify.plant import LogPlant
from hexapod_cosim.extensions.identify.results import warnings
from hexapod_cosim.extensions.identify.robot_file import write_robot
from hexapod_cosim.extensions.identify.start import initial_state
from hexapod_cosim.extensions.identify.unknowns import ROBOT, chosen_unknowns
from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.kinematics import axis_rotation, inertia_matrix
from hexapod_cosim.models.robot import robot_path
from hexapod_cosim.models.urdf.legs import inertia_entries

DURATION = 1.8  # s
GROUPS = ("servo", "contact")
STEPS = [
    "the columns of the log",
    "search on the first seconds, part 1 of 2",
    "search on the first seconds, part 2 of 2",
    "all rows",
    "all rows again, step 1 of at most 12",
]


@pytest.fixture(scope="module")
def secrets(plant_build: Path, tmp_path_factory: pytest.TempPathFactory) -> list[Secret]:
    folder = tmp_path_factory.mktemp("secret")
    return [secret_robot(seed, folder, duration=DURATION, groups=GROUPS) for seed in (1, 2)]


@pytest.fixture(scope="module")
def found(secrets: list[Secret]) -> list[Identified]:
    robot = load_robot("athena")
    return [identify([secret.log], robot, groups=GROUPS) for secret in secrets]


def test_numbers_of_secret_robots_lie_within_their_intervals(
    secrets: list[Secret], found: list[Identified]
) -> None:
    """The campaign of 20 robots and all numbers is `make identify-campaign`."""
    scores = [score_of(*pair, 0.0) for pair in zip(secrets, found, strict=True)]
    figures = summary([table_row(k, one, DURATION) for k, one in enumerate(scores)])
    assert figures["determined"] == 16
    assert figures["covered"] >= GOAL_COVERED
    for one in scores:  # a second of walking shows little of the position
        assert one.ratios["torque"] > GOAL_RATIO
        assert one.ratios["attitude"] > GOAL_RATIO


def test_the_noise_of_the_sensors_is_found_and_nothing_is_warned_of(
    found: list[Identified],
) -> None:
    """The mean square of residuals over the readings' own noise is 1 within a third."""
    for key, value in found[0].fit.noise.items():
        assert value == pytest.approx(NOISE[key], rel=0.2), key
    for one in found:
        assert warnings(one) == []
        assert max(each.value for each in one.fit.misfit.values()) < 1.33


def test_a_log_says_nothing_of_limits_that_the_servos_do_not_reach(found: list[Identified]) -> None:
    for one in found:
        limits = {each.key: each for each in one.estimates if each.key.endswith("_max")}
        assert set(limits) == {"servo.torque_max", "servo.speed_max"}
        assert not any(each.determined for each in limits.values())
        assert [each.deviation for each in limits.values()] == pytest.approx([1.0, 1.0], abs=0.01)
        assert [each.value for each in limits.values()] == [6.0, 6.6]
        assert one.fit.rank == 11  # all but the limits, and three of the start
        assert one.robot.servo.torque_max == 6.0


def test_the_robot_file_is_the_identified_robot(found: list[Identified], tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    write_robot(found[0], "athena", path, ["out/log.mcap"])
    again, source = load_robot(path), tomllib.loads(path.read_text(encoding="utf-8"))["source"]
    assert again.servo == found[0].robot.servo
    assert (again.name, source["identified"]) == ("athena-identified", "hexapod identify log.mcap")
    assert source["servo.torque_max"] == "not determined by log.mcap: as before"
    lines = path.read_text(encoding="utf-8").splitlines()
    kp = next(one for one in found[0].estimates if one.key == "servo.kp")
    said = f"identified from log.mcap: 95 % interval {kp.interval} N m/rad; before 40"
    assert source["servo.kp"] == said
    (line,) = [line for line in lines if line.startswith("kp = ")]
    assert line.startswith(f"kp = {kp.value!r} ")
    before = robot_path("athena").read_text(encoding="utf-8").splitlines()
    others = [each for each in before if each.startswith(("mass =", "length =", "speed_max ="))]
    assert others
    assert set(others) <= set(lines)  # comments of other numbers stay


def test_bodies_of_all_legs_are_written_and_read_back(
    found: list[Identified], tmp_path: Path
) -> None:
    robot = load_robot("athena")
    changed = robot
    for row in ROBOT:
        if row.group == "mass":
            changed = row.write(changed, 1.1 * row.read(changed) + 0.001 * (not row.positive))
    write_robot(replace(found[0], robot=changed), "athena", tmp_path / "robot.toml", ["x.csv"])
    again = load_robot(tmp_path / "robot.toml")
    assert (again.torso, again.legs) == (changed.torso, changed.legs)
    assert changed.torso.mass == pytest.approx(2.86, rel=1e-12)
    # 1.1 for the mass and the radius of gyration each
    assert changed.torso.inertia[0] == pytest.approx(1.1**3 * robot.torso.inertia[0], rel=1e-12)
    femur, old = changed.legs[4].links[1], robot.legs[4].links[1]
    assert femur.com[0] == pytest.approx(0.0725, rel=1e-12)
    assert femur.inertia == pytest.approx([1.1 * one for one in old.inertia], rel=1e-12)


def test_the_centre_of_mass_of_a_link_stays_along_it() -> None:
    """From a quarter of the length before its joint to a quarter beyond the next: 0.10 m long."""
    rows = {row.key: row for row in chosen_unknowns(load_robot("athena"), [], ("mass",))}
    row = rows["links.femur.com_along"]
    assert row.value(-100.0, 0.065) == pytest.approx(-0.025, abs=1e-15)
    assert row.value(100.0, 0.065) == pytest.approx(0.125, abs=1e-15)
    assert row.bounds(0.065) == pytest.approx((-8.0, 6.0), abs=1e-12)


def with_zeros(robot: Robot, zeros: Array) -> Robot:
    """Returns the same robot with other poses at angle 0. zeros: the angles there (6, 3) [rad]."""
    legs: list[Any] = []
    for leg, own in zip(robot.legs, zeros.tolist(), strict=True):
        turn = np.eye(3)
        links: Any = []
        for link, zero in zip(leg.links, own, strict=True):
            axis = turn @ link.axis
            turn = turn @ axis_rotation(np.array(link.axis), zero)
            length, y, z = (turn @ link.tip).tolist()
            own_inertia = turn @ inertia_matrix(link.inertia) @ turn.T
            inertia: Any = tuple(inertia_entries(own_inertia))
            links.append(
                replace(
                    link, axis=tuple(axis.tolist()), length=length, offset_y=y, offset_z=z,
                    com=tuple((turn @ link.com).tolist()), inertia=inertia,
                    angle_min=link.angle_min - zero, angle_max=link.angle_max - zero,
                )
            )  # fmt: skip
        legs.append(replace(leg, links=tuple(links)))
    return replace(robot, legs=tuple(legs))


@pytest.mark.parametrize("seed", range(20))
def test_numbers_of_bodies_do_not_depend_on_the_zeros_of_the_joints(seed: int) -> None:
    robot = load_robot("athena")
    zeros = np.random.default_rng(seed).uniform(-3.0, 3.0, (6, 3))
    if seed == 0:  # the tibia points straight down
        zeros = np.tile([0.0, 0.0, 0.5 * np.pi], (6, 1))
        assert with_zeros(robot, zeros).legs[0].links[2].length == pytest.approx(0.0, abs=1e-15)
    turned = with_zeros(robot, zeros)
    rows, own = (chosen_unknowns(one, [], ("mass",)) for one in (robot, turned))
    assert [row.key for row in own] == [row.key for row in rows]
    for row, other in zip(rows, own, strict=True):
        before = row.read(robot)
        assert other.read(turned) == pytest.approx(before, rel=1e-12, abs=1e-15)
        assert other.bounds(before) == pytest.approx(row.bounds(before), abs=1e-10)
        robot, turned = (
            one.write(each, 1.1 * before) for one, each in ((row, robot), (other, turned))
        )
    back, expected = turned.legs[3].links[1], with_zeros(robot, zeros).legs[3].links[1]
    assert back.com == pytest.approx(expected.com, abs=1e-14)
    assert back.inertia == pytest.approx(expected.inertia, abs=1e-14)


def test_a_channel_that_the_model_does_not_explain_is_named(
    secrets: list[Secret], found: list[Identified]
) -> None:
    """A slow error of 0.05 N m adds 0.00125 (N m)^2 to a noise of 0.0009 (N m)^2."""
    log, one = secrets[0].log, found[0]
    for name in log.measured:
        if name.endswith(".torque"):
            log = with_column(log, name, lambda y: y + 0.05 * np.sin(2e-2 * np.arange(len(y))))
    experiments = [make_experiment(log, 0, 0.25)]
    noise = read_noise(experiments)
    misfit = misfits(experiments, one.fit.predictions, noise, "fitted")
    assert noise["torque"] == pytest.approx(NOISE["torque"], rel=0.1)
    assert misfit["torque"].value == pytest.approx(1.0 + 0.00125 / 0.0009, rel=0.2)
    wrong = replace(one, fit=replace(one.fit, misfit=misfit))
    assert set(wrong.fit.unexplained) == {"torque"}
    assert "too large in servo torques" in warnings(wrong)[0]
    stopped = replace(one, fit=replace(one.fit, decrement=3.0))
    assert "ended 3.0 deviations before the optimum" in warnings(stopped)[0]


def test_simulations_at_a_time_give_the_same_derivatives(
    secrets: list[Secret], athena_fmu: Path
) -> None:
    robot, log = load_robot("athena"), secrets[0].log.part(slice(0, 130))
    rows = chosen_unknowns(robot, [log], ("contact", "sensor"))
    experiments = [make_experiment(log, 0, 0.0)]
    found = []
    with LogPlant(athena_fmu, TOLERANCE) as plant, LogPlant(athena_fmu, TOLERANCE) as other:
        for plants in ([plant], [plant, other]):
            problem = Problem(plants, robot, experiments, rows)
            z = np.zeros(len(rows))
            problem.set_noise(problem.errors(z))
            found.append(problem.jacobian(z))
    assert np.abs(found[0]).max() > 0.1
    assert np.array_equal(found[0], found[1])


def test_a_delay_of_whole_rows_shifts_the_readings(secrets: list[Secret], athena_fmu: Path) -> None:
    log, names = secrets[0].log, ["LF.femur.angle", "RR.tibia.speed"]
    start = initial_state(log, load_robot("athena"))
    with LogPlant(athena_fmu) as plant:
        now = plant.simulate(log, names, start)
        later = plant.simulate(log, names, start, delay=0.01)
        each = plant.simulate(log, [*names, names[0]], start, delay=[0.0, 0.01, 0.0025])
    assert later[2:] == pytest.approx(now[:-2], abs=1e-12)
    assert each[:, :2] == pytest.approx(np.column_stack([now[:, 0], later[:, 1]]), abs=1e-3)
    # half a row later an angle is half-way to the row before, but for its curvature
    middle = 0.5 * (now[1:, 0] + now[:-1, 0])
    assert each[1:, 2] == pytest.approx(middle, abs=1e-3)
    assert np.abs(each[1:, 2] - now[1:, 0]).max() > 5e-3


def test_the_position_of_another_point_turns_with_the_torso() -> None:
    columns, quarter = ("torso.position[1]", "torso.position[2]", "torso.position[3]"), np.pi / 2
    attitude = np.array([[0.0, 0.0, quarter], [quarter, 0.0, 0.0], [0.0, quarter, 0.0]])
    places = of_point(columns, np.zeros((3, 3)), attitude, np.array([0.1, 0.2, 0.3]))
    assert places == pytest.approx(
        np.array([[-0.2, 0.1, 0.3], [0.1, -0.3, 0.2], [0.3, 0.2, -0.1]]), abs=1e-15
    )


def test_two_logs_have_one_robot_and_two_starts(secrets: list[Secret], athena_fmu: Path) -> None:
    robot, logs = load_robot("athena"), [secrets[0].log.part(slice(0, 120))] * 2
    rows = chosen_unknowns(robot, logs, GROUPS)
    keys = [row.key for row in rows]
    assert [key for key in keys if key.startswith("start.x")] == ["start.x[1]", "start.x[2]"]
    both = [make_experiment(log, number, 0.25) for number, log in enumerate(logs)]
    with LogPlant(athena_fmu) as plant:
        problem = Problem([plant], robot, both, rows)
        z = np.zeros(len(rows))
        z[keys.index("start.x[2]")] = 1.0
        first, second = problem.predictions(z)
    place = both[0].columns.index("torso.position[1]")
    assert second[:, place] - first[:, place] == pytest.approx(0.005, abs=1e-6)


def test_the_command_writes_robot_sensors_and_report(
    call: Call, secrets: list[Secret], tmp_path: Path
) -> None:
    """Of half a second: what is found there is not judged."""
    log = with_column(secrets[0].log, "LF.femur.angle", lambda y: np.full_like(y, 0.3))
    kept = (".angle", "imu.angular_velocity[1]")
    short = log.without([name for name in secrets[0].columns if not name.endswith(kept)])
    write_mcap(short.recording.rows(slice(0, 160)), tmp_path / "log.mcap")
    words, place = ("identify", tmp_path / "log.mcap", "--find", "sensor", "-o"), tmp_path / "out"
    code, out, err = call(*words, place, "--json")
    assert code == 0
    assert "LF.femur.angle is left out: dead: 0.3 in every row" in err
    assert not set(STEPS) & set(err.splitlines())
    assert {path.name for path in place.iterdir()} == {
        "robot.toml", "sensors.toml", "identify.json", "run.json"
    }  # fmt: skip
    result = json.loads(out)
    assert [one["key"] for one in result["estimates"]][:3] == [
        "delay.joints", "delay.imu", "bias.imu.angular_velocity[1]"
    ]  # fmt: skip
    assert result["bad_columns"][0]["name"] == "LF.femur.angle"
    sensors = tomllib.loads((place / "sensors.toml").read_text(encoding="utf-8"))
    assert sensors["delay.joints"]["unit"] == "s"
    code, out, err = call(*words, tmp_path / "again", "--workers", "2")
    assert code == 0
    assert err.splitlines()[: len(STEPS)] == STEPS
    assert "95 % interval" in out
    first, second = (path / "sensors.toml" for path in (place, tmp_path / "again"))
    assert first.read_bytes() == second.read_bytes()


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (("x.csv", "--find", "servos"), ("servos", "servo", "--find")),
        (("examples/log.mcap",), ("python examples/05_robot_log.py examples/log.mcap",)),
        (("x.csv", "--friction", "m7"), ("m7", "m6", "--friction")),
        (("x.csv", "--friction", "m4"), ("friction models are those of measured servos",)),
        (("x.bag",), ("not a log", ".mcap")),
        (("x.csv", "--held-out", "2"), ("less than or equal to 0.9", "--held-out")),
    ],
)
def test_misuse_is_refused_and_leaves_nothing(
    call: Call, tmp_path: Path, words: tuple[str, ...], parts: tuple[str, ...]
) -> None:
    assert_refused(call("identify", *words, "-o", tmp_path / "out"), *parts)
    assert not (tmp_path / "out").exists()
