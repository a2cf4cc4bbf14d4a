"""Identification: secret robots are found within their intervals, a log tells nothing of what it
does not show, dead and wrong columns are named, and the robot file is the identified robot.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomlkit
from command import Call, assert_refused
from secret_robots import NOISE, Secret, secret_robot, with_column

from benchmarks.identification import GOAL_COVERED, GOAL_RATIO, summary, table_row
from benchmarks.identification import score as score_of
from hexapod_cosim.cosim.export.plant_export import export_fmu
from hexapod_cosim.cosim.logs.mcap_writer import write_mcap
from hexapod_cosim.extensions.identify import excitation
from hexapod_cosim.extensions.identify.channel_screening import screened
from hexapod_cosim.extensions.identify.excitation import Proposal, propose, scenario_text
from hexapod_cosim.extensions.identify.experiment import Experiment, of_point
from hexapod_cosim.extensions.identify.fitting.judging import Fit
from hexapod_cosim.extensions.identify.fitting.last_search import remaining_step
from hexapod_cosim.extensions.identify.fitting.misfit import read_noise
from hexapod_cosim.extensions.identify.fitting.output_error import _tried
from hexapod_cosim.extensions.identify.fitting.problem import Problem
from hexapod_cosim.extensions.identify.fitting.workers import simulating_workers
from hexapod_cosim.extensions.identify.identified import Identified
from hexapod_cosim.extensions.identify.identify import identify, make_experiment
from hexapod_cosim.extensions.identify.log_plant import LogPlant
from hexapod_cosim.extensions.identify.robot_file import write_robot
from hexapod_cosim.extensions.identify.screening import BadColumn, left_out
from hexapod_cosim.extensions.identify.start import initial_state
from hexapod_cosim.extensions.identify.unknowns import ROBOT, chosen_unknowns
from hexapod_cosim.models import LEG_NAMES, load_robot
from hexapod_cosim.models.robot import robot_path

DURATION = 1.8  # s
GROUPS = ("servo", "contact")


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
    assert figures["told"] == 16
    assert figures["covered"] >= GOAL_COVERED


def test_the_held_out_errors_of_torque_and_attitude_fall_to_a_tenth(
    secrets: list[Secret], found: list[Identified]
) -> None:
    """A second of walking shows little of the position, which the campaign judges."""
    for pair in zip(secrets, found, strict=True):
        gains = score_of(*pair, 0.0).ratios
        assert gains["torque"] > GOAL_RATIO
        assert gains["attitude"] > GOAL_RATIO


def test_the_noise_of_the_sensors_is_found(found: list[Identified]) -> None:
    for key, value in found[0].fit.noise.items():
        assert value == pytest.approx(NOISE[key], rel=0.2), key


def test_a_log_tells_nothing_of_limits_that_the_servos_do_not_reach(
    found: list[Identified],
) -> None:
    for one in found:
        limits = {each.key: each for each in one.estimates if each.key.endswith("_max")}
        assert set(limits) == {"servo.torque_max", "servo.speed_max"}
        assert not any(each.told for each in limits.values())
        assert [each.deviation for each in limits.values()] == pytest.approx([1.0, 1.0], abs=0.01)
        assert [each.value for each in limits.values()] == [6.0, 6.6]
        assert one.rank == 11  # all but the limits, and three of the start
        assert one.robot.servo.torque_max == 6.0


def test_the_robot_file_is_the_identified_robot(found: list[Identified], tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    write_robot(found[0], "athena", path, ["out/log.mcap"])
    again, source = load_robot(path), tomllib.loads(path.read_text(encoding="utf-8"))["source"]
    assert again.servo == found[0].robot.servo
    assert (again.name, source["identified"]) == ("athena-identified", "hexapod identify log.mcap")
    assert source["servo.kp"].startswith("identified from log.mcap: 95 % interval")
    assert source["servo.torque_max"] == "not told by log.mcap: as before"
    lines = path.read_text(encoding="utf-8").splitlines()
    kp = next(one for one in found[0].estimates if one.key == "servo.kp")
    (line,) = [line for line in lines if line.startswith("kp = ")]
    assert line.startswith(f"kp = {kp.value!r} ")
    assert line.endswith(f"# N m/rad    identified from log.mcap, 95 % interval {kp.interval}")
    assert "torque_max = 6.0" in [each.partition("#")[0].strip() for each in lines]
    before = robot_path("athena").read_text(encoding="utf-8").splitlines()
    kept = [each for each in before if each.startswith(("mass =", "length =", "speed_max ="))]
    assert kept
    assert set(kept) <= set(lines)  # comments of other numbers stay


def test_masses_of_all_bodies_are_written_and_read_back(
    found: list[Identified], tmp_path: Path
) -> None:
    robot = load_robot("athena")
    changed = robot
    for row in ROBOT:
        if row.group == "mass" and row.write is not None and row.read is not None:
            changed = row.write(changed, 1.1 * row.read(changed) + 0.001 * (not row.positive))
    write_robot(replace(found[0], robot=changed), "athena", tmp_path / "robot.toml", ["x.csv"])
    assert load_robot(tmp_path / "robot.toml").legs == changed.legs
    assert changed.torso.mass == pytest.approx(2.86, rel=1e-12)
    assert changed.legs[4].links[1].com[0] == pytest.approx(0.0725, rel=1e-12)


def test_a_model_that_explains_the_log_leaves_the_noise_of_the_readings(
    found: list[Identified],
) -> None:
    """Second differences of readings show their noise; the mean square is 1 within a third."""
    for one in found:
        assert one.fit.unexplained == {}
        assert max(each.value for each in one.fit.misfit.values()) < 1.33


def test_a_channel_that_the_model_does_not_explain_is_named(
    secrets: list[Secret], found: list[Identified], athena_fmu: Path
) -> None:
    """A slow error of 0.05 N m adds 0.00125 (N m)^2 to a noise of 0.0009 (N m)^2."""
    log = secrets[0].log
    for name in log.measured:
        if name.endswith(".torque"):
            log = with_column(log, name, lambda y: y + 0.05 * np.sin(2e-2 * np.arange(len(y))))
    robot, one = load_robot("athena"), found[0]
    with LogPlant(athena_fmu) as plant:
        problem = Problem(plant, robot, [make_experiment(log, 0, 0.25)], one.fit.rows)
        noise = read_noise(problem.experiments)
        misfit = problem.misfit(one.fit.z, noise, "fitted")
    assert noise["torque"] == pytest.approx(NOISE["torque"], rel=0.1)
    assert misfit["torque"].value == pytest.approx(1.0 + 0.00125 / 0.0009, rel=0.2)
    assert set(replace(one.fit, misfit=misfit).unexplained) == {"torque"}
    assert misfit["angle"].value < 1.2


class Valleys:
    """Stands for a problem whose sum of squares has two valleys, the deeper one at 1.9."""

    rows = tuple(row for row in ROBOT if row.key in ("servo.kp", "contact.restitution"))
    counted: tuple[()] = ()

    def all_known(self) -> tuple[()]:
        return ()

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        return np.full(2, -8.0), np.full(2, 8.0)

    def residuals(self, z: np.ndarray) -> np.ndarray:
        return np.array([min(abs(z[1]) + 1.0, 2.0 * abs(z[1] - 1.9)), z[0]])


def test_another_start_of_a_contact_leads_out_of_a_wrong_valley() -> None:
    problem: Any = Valleys()
    assert _tried(problem, np.zeros(2)).tolist() == [0.0, 2.0]
    assert _tried(problem, np.array([0.0, 2.0])).tolist() == [0.0, 1.9]


def test_worker_processes_give_the_same_derivatives(
    secrets: list[Secret], athena_fmu: Path, tmp_path: Path
) -> None:
    robot, log = load_robot("athena"), secrets[0].log.part(slice(0, 130))
    rows = chosen_unknowns(robot, [log], ("contact", "sensor"))
    experiment = make_experiment(log, 0, 0.0)
    found = []
    with (
        LogPlant(athena_fmu) as plant,
        simulating_workers(2, athena_fmu, robot, {}, tmp_path) as workers,
    ):
        for own in (None, workers):
            problem = Problem(plant, robot, [experiment], rows, own)
            z = np.zeros(len(rows))
            problem.set_noise(problem.errors(z))
            found.append(problem.jacobian(z))
    assert np.abs(found[0]).max() > 0.1
    assert np.array_equal(found[0], found[1])


MEASURED = "mx64_m4"  # a servo with a model of its motor


def measured_robot(folder: Path) -> Path:
    """Writes athena with a measured servo."""
    document = tomlkit.parse(robot_path("athena").read_text(encoding="utf-8"))
    document["servo"] = {"model": MEASURED}
    path = folder / "measured.toml"
    path.write_text(tomlkit.dumps(document), encoding="utf-8")
    return path


def test_currents_of_a_measured_servo_are_those_of_its_motor(
    plant_build: Path, tmp_path: Path
) -> None:
    """The plant's motor predicts them: torque over the torque constant that is tried (eq. 48)."""
    file = load_robot(measured_robot(tmp_path))
    seen = ("angle", "torque", "current", "attitude")
    one = secret_robot(3, tmp_path, duration=0.6, groups=("servo",), file=file, seen=seen)
    rows = chosen_unknowns(file, [one.log], ("servo", "sensor"))
    keys = [row.key for row in rows]
    assert "sensor.torque_constant" not in keys
    assert "servo.torque_max" not in keys
    place = keys.index("servo.torque_constant")
    experiment = make_experiment(one.log, 0, 0.0)
    with LogPlant(export_fmu(file, tmp_path / "file.fmu")) as plant:
        problem = Problem(plant, file, [experiment], rows)
        z = np.zeros(len(rows))
        z[place] = rows[place].distance(
            1.1 * file.servo.torque_constant, problem.before[keys[place]]
        )
        (readings,) = problem.predictions(z)
    channels = np.array(experiment.channels)
    current, torque = readings[:, channels == "current"], readings[:, channels == "torque"]
    assert np.abs(current).max() > 0.1
    assert current * 1.1 * file.servo.torque_constant == pytest.approx(torque, rel=1e-9, abs=1e-12)


def test_numbers_of_a_measured_servo_are_written_and_read_back(
    found: list[Identified], tmp_path: Path
) -> None:
    path = measured_robot(tmp_path)
    file = load_robot(path)
    changed = file
    for row in ROBOT:
        if row.group == "servo" and row.applies(file) and row.write and row.read:
            changed = row.write(changed, 1.1 * row.read(changed))
    assert changed.servo.torque_max == pytest.approx(file.servo.torque_max, rel=1e-12)
    write_robot(
        replace(found[0], file=file, robot=changed), str(path), tmp_path / "robot.toml", ["x.csv"]
    )
    again = load_robot(tmp_path / "robot.toml").servo
    assert again == changed.servo
    assert again.torque_constant == pytest.approx(1.1 * file.servo.torque_constant, rel=1e-12)


WRONG: dict[str, tuple[Callable[[np.ndarray], np.ndarray], str]] = {
    "LF.femur.angle": (lambda y: np.full_like(y, 0.3), "dead: 0.3 in every row"),
    "RM.tibia.torque": (lambda y: -y, "wrong sign"),
    "LR.coxa.angle": (np.degrees, "in degrees: 57 times"),
    "RR.tibia.angle": (lambda y: np.where(np.arange(len(y)) < 110, np.nan, y), "no number in 110"),
    "RF.femur.speed": (lambda y: y[::-1].copy(), "does not follow|looks like|wrong sign"),
    "LM.foot.normal_force": (
        lambda y: np.where(np.arange(len(y)) > 250, y[250], y),
        "stuck at",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_dead_or_wrong_column_is_named_and_no_other(name: str, secrets: list[Secret]) -> None:
    change, why = WRONG[name]
    experiment = Experiment(
        log=with_column(secrets[0].log, name, change),
        number=0,
        columns=secrets[0].columns,
        fitted=slice(0, 100),
        held_out=slice(100, 110),
    )
    (bad,) = screened(experiment, secrets[0].clean)
    assert bad.name == name
    assert re.search(why, bad.why), bad.why


def test_a_channel_that_is_dead_as_a_whole_is_one_sentence() -> None:
    """Ideal servos report no currents."""
    joints = [f"{leg}.{joint}" for leg in LEG_NAMES for joint in ("coxa", "femur", "tibia")]
    bad = [BadColumn(f"{joint}.current", "dead: 0 in every row") for joint in joints]
    own = BadColumn("LF.coxa.angle", "wrong sign")
    assert left_out([*bad, own]) == [
        "All 18 columns of 'Servo currents' are left out: dead: 0 in every row.",
        "LF.coxa.angle is left out: wrong sign.",
    ]
    assert len(left_out(bad[:17])) == 17


def test_the_columns_of_a_good_log_are_all_kept(found: list[Identified]) -> None:
    assert [one.bad for one in found] == [(), ()]


def test_a_delay_of_whole_rows_shifts_the_readings(secrets: list[Secret], athena_fmu: Path) -> None:
    log, names = secrets[0].log, ["LF.femur.angle", "RR.tibia.speed"]
    start = initial_state(log, load_robot("athena"))
    with LogPlant(athena_fmu) as plant:
        now = plant.simulate(log, names, start)
        later = plant.simulate(log, names, start, delay=0.01)
        between = plant.simulate(log, names, start, delay=0.0025)
        each = plant.simulate(log, [*names, names[0]], start, delay=[0.0, 0.01, 0.0025])
    assert later[2:] == pytest.approx(now[:-2], abs=1e-12)
    expected = np.column_stack([now[:, 0], later[:, 1], between[:, 0]])
    assert each == pytest.approx(expected, abs=1e-3)  # the integrator stops at other times
    # half a row later an angle is half-way to the row before, but for its curvature
    middle = 0.5 * (now[1:, 0] + now[:-1, 0])
    assert between[1:, 0] == pytest.approx(middle, abs=1e-3)
    assert np.abs(between[1:, 0] - now[1:, 0]).max() > 5e-3


def test_a_walk_is_proposed_for_what_it_would_tell(
    found: list[Identified], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A walk tells at least what it adds; the limits of the servos need a fast one."""
    only = excitation.walks(found[0].robot)[:1]
    monkeypatch.setattr(excitation, "walks", lambda _robot: only)
    monkeypatch.setattr(excitation, "DURATION", 1.0)
    (one,) = propose(found[0], "athena")
    assert (one.title, one.tells) == ("A walk straight ahead", ())
    before = found[0].fit.deviations
    assert all(one.deviations[key] <= before[key] for key in one.deviations)
    assert one.deviations["servo.kp"] < 0.99 * before["servo.kp"]


def test_no_step_is_left_at_the_optimum_of_a_linear_problem() -> None:
    rng = np.random.default_rng(1)
    jacobian, readings = rng.normal(size=(200, 4)), 0.1 * rng.normal(size=200)
    best = np.linalg.lstsq(jacobian, readings, rcond=None)[0]
    at_best = jacobian @ best - readings
    assert remaining_step(jacobian, at_best) == pytest.approx(np.zeros(4), abs=1e-12)
    away = np.array([0.01, -0.02, 0.03, 0.0])
    beside = jacobian @ (best + away) - readings
    assert remaining_step(jacobian, beside) == pytest.approx(-away, abs=1e-12)


def test_the_position_of_another_point_turns_with_the_torso() -> None:
    columns, quarter = ("torso.position[1]", "torso.position[2]", "torso.position[3]"), np.pi / 2
    attitude = np.array([[0.0, 0.0, quarter], [quarter, 0.0, 0.0], [0.0, quarter, 0.0]])
    places = of_point(columns, np.zeros((3, 3)), attitude, np.array([0.1, 0.2, 0.3]))
    assert places == pytest.approx(
        np.array([[-0.2, 0.1, 0.3], [0.1, -0.3, 0.2], [0.3, 0.2, -0.1]]), abs=1e-15
    )


def test_two_logs_have_one_robot_and_two_starts(secrets: list[Secret], athena_fmu: Path) -> None:
    robot, logs = load_robot("athena"), [secrets[0].log, secrets[0].log]
    rows = chosen_unknowns(robot, logs, GROUPS)
    assert [row.key for row in rows if row.key.startswith("start.x")] == [
        "start.x[1]",
        "start.x[2]",
    ]
    both = [make_experiment(log, number, 0.25) for number, log in enumerate(logs)]
    with LogPlant(athena_fmu) as plant:
        problem = Problem(plant, robot, both, rows)
        z = np.zeros(len(rows))
        z[[row.key for row in rows].index("start.x[2]")] = 1.0
        first, second = problem.errors(z)
    place = both[0].columns.index("torso.position[1]")
    assert second[:, place] - first[:, place] == pytest.approx(0.005, abs=1e-6)


def test_a_proposed_walk_is_a_scenario_for_the_identified_robot() -> None:
    text = scenario_text(Proposal("A walk", {"command": [{"vy": 0.05}]}, (), {}, 0.5), "robot.toml")
    table = tomllib.loads(text)
    assert table["command"] == [{"vy": 0.05}]
    assert (table["robot"], table["duration"]) == ("robot.toml", 20.0)


def test_without_open_numbers_no_walk_is_proposed(found: list[Identified]) -> None:
    assert propose(replace(found[0], fit=all_told(found[0])), "athena") == []


def all_told(one: Identified) -> Fit:
    """Returns the fit with a small covariance."""
    count = len(one.fit.rows)
    alone, stay = np.ones(count, dtype=np.bool_), np.zeros(count, dtype=np.bool_)
    return replace(one.fit, covariance=1e-6 * np.eye(count), alone=alone, stay=stay)


def test_the_command_writes_robot_sensors_and_report(
    call: Call, secrets: list[Secret], tmp_path: Path
) -> None:
    """Of half a second: what is found there is not judged."""
    log = with_column(secrets[0].log, "LF.femur.angle", lambda y: np.full_like(y, 0.3))
    kept = (".angle", "imu.angular_velocity[1]")
    short = log.without([name for name in secrets[0].columns if not name.endswith(kept)])
    write_mcap(short.recording.rows(slice(0, 160)), tmp_path / "log.mcap")
    place = tmp_path / "out"
    code, out, err = call(
        "identify", tmp_path / "log.mcap", "-o", place, "--find", "sensor", "--no-propose", "--json"
    )
    assert code == 0
    assert "LF.femur.angle is left out: dead: 0.3 in every row" in err
    assert {path.name for path in place.iterdir()} == {
        "robot.toml", "sensors.toml", "identify.json", "report.html", "run.json"
    }  # fmt: skip
    result = json.loads(out)
    assert [one["key"] for one in result["estimates"]][:3] == [
        "delay.joints", "delay.imu", "bias.imu.angular_velocity[1]"
    ]  # fmt: skip
    assert result["bad_columns"][0]["name"] == "LF.femur.angle"
    assert "LF.femur.angle is left out" in (place / "report.html").read_text(encoding="utf-8")
    sensors = tomllib.loads((place / "sensors.toml").read_text(encoding="utf-8"))
    assert sensors["delay.joints"]["unit"] == "s"


def test_misuse_is_refused_and_leaves_nothing(call: Call, tmp_path: Path) -> None:
    place = tmp_path / "out"
    assert_refused(
        call("identify", "x.csv", "-o", place, "--find", "servos"), "servos", "servo", "--find"
    )
    assert_refused(call("identify", "x.csv", "-o", place), "no recording", "x.csv")
    assert_refused(
        call("identify", "examples/log.mcap", "-o", place),
        "does not exist", "python examples/05_robot_log.py examples/log.mcap",
    )  # fmt: skip
    assert_refused(
        call("identify", "x.csv", "-o", place, "--friction", "m7"), "m7", "m6", "--friction"
    )
    assert_refused(call("identify", "x.bag", "-o", place), "not a log", ".mcap")
    assert_refused(
        call("identify", "x.csv", "-o", place, "--held-out", "2"), "not a share", "--held-out"
    )
    assert not place.exists()
