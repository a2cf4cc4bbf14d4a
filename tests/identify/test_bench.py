"""The bench of one servo: the plant in C as its twin, readers of logs, and a fit that finds the
servo which made the logs.
"""

from __future__ import annotations

import csv
import ctypes as ct
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command import Call, assert_refused
from pendulum import GRAVITY, Rod
from plant import Plant
from test_laws_servo import tibias
from test_pendulum import bench as robot_on_wall

from benchmarks.identify.hip import real_row, rows
from hexapod_cosim.extensions.identify.bench import read_bench_log
from hexapod_cosim.extensions.identify.bench.command import motor_warnings
from hexapod_cosim.extensions.identify.bench.errors import Errors, judged
from hexapod_cosim.extensions.identify.bench.fit import NOISE, ServoFit, fit_servo
from hexapod_cosim.extensions.identify.bench.log import BenchLog
from hexapod_cosim.extensions.identify.bench.pendulum import STEP, Bench
from hexapod_cosim.extensions.identify.fitting.least_squares import huber
from hexapod_cosim.models import load_robot
from hexapod_cosim.models.dynamics import Command
from hexapod_cosim.models.records import Servo
from hexapod_cosim.models.servos.presets import measured_servo

ROD = Rod(mass=0.3, rod=0.02, length=0.1)
FIRMWARE: dict[str, dict[str, float]] = {
    "current": {"current_max": 0.9},
    "goal speed": {"goal_speed_max": 1.5},
    "overload": {"overload_time": 0.2, "overload_duty": 0.27, "overload_left": 0.15},
    "all": {
        "current_max": 1.0, "goal_speed_max": 3.0,
        "overload_time": 0.3, "overload_duty": 0.4, "overload_left": 0.3,
    },
}  # fmt: skip


def made_log(
    servo: Servo,
    goal: np.ndarray,
    *,
    gain: float = 1.15,
    step: float = STEP,
    delay: float = 0.0,
    **more: Any,
) -> BenchLog:
    """Returns the log of a bench whose readings have no errors."""
    time = 0.005 * np.arange(len(goal), dtype=np.float64)
    given: dict[str, Any] = {"mass": ROD.mass, "rod": ROD.rod, "length": ROD.length, **more}
    zero = np.zeros(len(goal))
    log = BenchLog(
        where="made", motor="xl330", gain=gain, register=100.0 * gain, trajectory="made",
        time=time, goal=goal, angle=zero, speed=zero, duty=zero,
        voltage=np.full(len(goal), servo.voltage), on=np.ones(len(goal)), **given,
    )  # fmt: skip
    swing = Bench([log], step=step).simulate(servo, 0.0, delay)
    angle, speed, duty = (own[:, 0, 0] for own in (swing.angle, swing.speed, swing.duty))
    return replace(log, angle=angle, speed=speed, duty=duty)


@pytest.mark.parametrize("what", FIRMWARE)
def test_the_plant_in_c_swings_as_the_bench_does(core: ct.CDLL, what: str) -> None:
    """Steps of the bench are of first order; the plant's setpoints ramp within its calls."""
    limits: dict[str, Any] = FIRMWARE[what]
    robot = robot_on_wall("xl330_m4", ROD, **limits)
    goal = np.repeat([0.9, -0.6, 0.3], 160)
    servo = replace(robot.servo, kp=robot.servo.kp)
    gain = measured_servo("xl330_m4").about.duty_gain
    # a held goal comes half a row after an interpolated one
    settings: Any = {"gain": gain, "step": 2.5e-4, "delay": 0.0025}
    log = made_log(servo, goal, **settings)
    bare = replace(servo, current_max=0.0, goal_speed_max=0.0, overload_time=0.0)
    without = made_log(bare, goal, **settings)
    hanging, weight = 0.5 * np.pi, robot.total_mass * GRAVITY
    plant = Plant(core, robot, angle=tibias(hanging))
    found = [0.0]
    for row in range(1, len(goal)):
        command = Command(
            angle_ref=tibias(hanging + float(goal[row - 1])),
            push_force=np.array([0.0, 0.0, weight]),
        )
        plant.step(float(log.time[row]), command)
        found.append(float(plant.output(command).angle[0, 2]) - hanging)
    assert np.abs(log.angle - without.angle).max() > 0.05
    assert np.abs(np.array(found) - log.angle).max() < 0.04
    assert np.abs(np.array(found) - log.angle).mean() < 0.004


def test_a_fit_finds_the_servo_that_made_the_logs() -> None:
    """From numbers that are 10 to 30 % off; the error on an unseen mass is below 0.05 degrees."""
    rng = np.random.default_rng(4)
    time = 0.005 * np.arange(500)
    goals = [
        np.sin(a * time) + 0.6 * np.sin(b * time) for a, b in ((2.0, 5.0), (3.0, 8.0), (1.5, 11.0))
    ]
    true = replace(measured_servo("xl330_m3").servo, current_max=0.9)
    logs = [made_log(true, goal, gain=gain) for goal in goals for gain in (0.6, 2.4)]
    noisy = [
        replace(log, angle=log.angle + 1e-3 * rng.standard_normal(len(log.angle))) for log in logs
    ]
    start = replace(true, torque_constant=0.9 * true.torque_constant, current_max=1.1,
                    resistance=1.3 * true.resistance, coulomb_friction=0.02)  # fmt: skip
    found = fit_servo(noisy, replace(load_robot("athena"), servo=start), "m3", seeds=1)
    for key in ("torque_constant", "resistance", "current_max", "rotor_inertia"):
        low, high = found.interval(f"servo.{key}")
        assert found.values[f"servo.{key}"] == pytest.approx(getattr(true, key), rel=0.03), key
        assert low < high < 1.2 * low, key
    unseen = judged(found, [made_log(true, goals[0], mass=0.4)])
    assert Errors.mean(unseen).angle < 0.05
    assert Errors.mean(unseen).torque < 0.05


def test_a_richer_model_follows_the_logs_that_it_sees_at_least_as_well() -> None:
    """The logs are those of M1, so that a search of M4 alone would end beside it."""
    rng = np.random.default_rng(5)
    time = 0.005 * np.arange(300)
    goals = [np.sin(a * time) + 0.6 * np.sin(b * time) for a, b in ((2.0, 5.0), (3.0, 8.0))]
    true = replace(measured_servo("xl330_m1").servo, current_max=0.9)
    logs = [made_log(true, goal) for goal in goals]
    logs = [
        replace(log, angle=log.angle + 1e-3 * rng.standard_normal(len(log.angle))) for log in logs
    ]
    robot = replace(load_robot("athena"), servo=replace(true, resistance=1.2 * true.resistance))
    known: dict[str | None, ServoFit] = {}
    fit_servo(logs, robot, "m4", seeds=1, known=known)
    bench, costs = Bench(logs), []
    for model in ("m1", "m3", "m4"):
        error = known[model].swing(bench).angle[:, 0] - bench.measured
        costs.append(huber(error / NOISE))
    # a number that is a prior away from its start costs 0.5
    assert costs[1] < costs[0] + 1.0
    assert costs[2] < costs[1] + 2.0


ENTRY = {"timestamp": 1.0, "goal_position": 0.5, "position": 0.4, "speed": 0.1, "input_volts": 12.0,
         "torque_enable": True}  # fmt: skip


def test_both_kinds_of_logs_are_read(tmp_path: Path) -> None:
    """Speeds are late by 20 ms; readings of 0 of K-Scale's failed."""
    head = {"mass": 0.5, "length": 0.15, "kp": 32, "trajectory": "sin_sin"}
    rows = [{**ENTRY, "timestamp": 1.0 + 0.01 * k, "speed": 0.1 * k} for k in range(12)]
    bam = {**head, "motor": "xl330", "entries": [{**one, "load": 65447} for one in rows]}
    own = [{**one, "torque": 10.54} for one in rows]
    own[1]["position"], own[2]["torque"], own[3]["input_volts"] = -3.14005, 0.0, 0.0
    kscale = {**head, "motor": "sts3215", "actuator_id": 1, "entries": own}
    logs = []
    for name, table in (("bam", bam), ("kscale", kscale)):
        (tmp_path / f"{name}.json").write_text(json.dumps(table), encoding="utf-8")
        logs.append(read_bench_log(tmp_path / f"{name}.json"))
    assert [log.rod for log in logs] == [0.0, 0.05]
    assert [log.duty[0] for log in logs] == pytest.approx([-89 / 885, 0.03])
    assert [log.gain for log in logs] == pytest.approx([0.0920760, 5.2765088], rel=1e-6)
    assert [log.time[0] for log in logs] == pytest.approx([0.9986, 1.0])
    assert logs[0].speed[:2] == pytest.approx([0.193, 0.293], abs=1e-9)
    assert logs[1].speed[:2] == pytest.approx([0.2, 0.3], abs=1e-9)
    assert logs[1].angle == pytest.approx(0.4)
    assert logs[1].duty == pytest.approx(0.03)
    assert logs[1].voltage == pytest.approx(12.0)


@pytest.mark.parametrize(
    ("content", "got"),
    [
        ({"mass": 1.0}, "got 'a file without entries'"),
        ({"actuator_id": 1}, "got 'a file without entries'"),
        ({"entries": []}, "got 'a file without motor'"),
        ({"entries": [{}]}, "got 'a file without timestamp'"),
        ({"entries": [3]}, "got 'a file that is no such log'"),
        ([1, 2], "got 'a file that is no such log'"),
        ("{", "got 'a file that is no such log'"),
        (b"\xff\xfe", "got 'a file that is no such log'"),
        (None, "got 'No such file or directory'"),
    ],
)
def test_a_file_that_is_no_bench_log_is_refused(
    call: Call, tmp_path: Path, content: Any, got: str
) -> None:
    path = tmp_path / "x.json"
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif content is not None:
        path.write_text(content if isinstance(content, str) else json.dumps(content))
    outcome = call("identify", "servo", path, "-o", tmp_path / "out")
    assert_refused(outcome, "no log of a servo bench", got, "BAM or K-Scale")
    assert not (tmp_path / "out").exists()


HEAD = {"mass": 0.5, "length": 0.1, "kp": 200, "trajectory": "ramp", "motor": "xl330"}


def written_log(path: Path, *, rows: int = 40, row: int = 0, **more: Any) -> Path:
    """Writes the log of a ramp; keys of entries are changed in one row, others in the head."""
    entries = [
        {**ENTRY, "timestamp": 0.02 * k, "goal_position": 0.01 * k, "position": 0.01 * k,
         "load": 0, "torque": 1.0}
        for k in range(rows)
    ]  # fmt: skip
    entries[row] |= {key: more.pop(key) for key in tuple(more) if key in entries[row]}
    path.write_text(json.dumps({**HEAD, **more, "entries": entries}), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("changed", "parts"),
    [
        ({"motor": "mx64"}, ["an unknown motor", "got 'mx64'", "expected xl330"]),
        ({"motor": "sts3032", "actuator_id": 1}, ["got 'sts3032'", "expected sts3215, sts3250"]),
        (
            {"motor": "sts3250", "actuator_id": 1, "length": 0.2},
            ["an unknown length", "got 0.2", "expected 0.1, 0.15"],
        ),
        ({"mass": 0.0}, ["unusable mass", "got 0.0", "expected a number > 0"]),
        ({"length": -0.1}, ["unusable length", "got -0.1", "expected a number > 0"]),
        ({"kp": 0}, ["unusable kp", "got 0", "expected a number > 0"]),
        ({"rows": 9}, ["unusable entries", "got 9", "expected at least 10"]),
        ({"row": 7, "position": np.nan}, ["unusable angle", "nan in row 8", "finite numbers"]),
        ({"row": 7, "timestamp": 0.12}, ["unusable time", "0.1186, 0.1186 in rows 7, 8", "rise"]),
    ],
)
def test_a_bench_log_that_cannot_be_simulated_is_refused(
    call: Call, tmp_path: Path, changed: Any, parts: list[str]
) -> None:
    path = written_log(tmp_path / "x.json", **changed)
    assert_refused(call("replay", path, "-o", tmp_path / "out"), *parts, "x.json: ")


def test_words_that_do_not_fit_bench_logs_are_refused(call: Call, tmp_path: Path) -> None:
    own = written_log(tmp_path / "x.json")
    other = written_log(tmp_path / "y.json", motor="sts3250", actuator_id=1)
    servo = ("identify", "servo", own)
    assert_refused(call(*servo, other), "several motors", "sts3250, xl330", "its own logs")
    assert_refused(call(*servo, "--find", "mass"), "does nothing", "--find", "use --hold-out")
    assert_refused(call(*servo, "--held-out", "0.5"), "does nothing", "got '--held-out'")
    assert_refused(call("replay", own, "--fmu", "x.fmu"), "does nothing", "--fmu", "leave it out")
    assert_refused(call("identify", own), f"hexapod identify servo {own}")
    assert_refused(call(*servo, own), "gain 200 in each log", "name further logs")
    longer = written_log(tmp_path / "z.json", length=0.15)
    assert_refused(call(*servo, longer), "differ in their gain", "give --hold-out length")
    assert_refused(call("identify", "servo", "-o", tmp_path / "none"), "no bench logs", "JSON")


def test_a_replayed_bench_log_is_drawn_beside_its_simulation(call: Call, tmp_path: Path) -> None:
    path = written_log(tmp_path / "x.json")
    call("replay", path, "-o", tmp_path / "out")
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "data:image/svg+xml" in page
    assert "<dd>xl330_fitted</dd>" in page
    facts = json.loads((tmp_path / "out" / "run.json").read_text(encoding="utf-8"))
    assert (facts["servo"], list(facts["bench"])) == (
        "xl330_fitted", ["bench.offset", "bench.delay"],
    )  # fmt: skip
    assert facts["warnings"] == []


def test_a_servo_of_another_motor_than_the_log_is_warned_of() -> None:
    athena = load_robot("athena")
    robot = replace(athena, servo=measured_servo("mx64_m4").servo)
    assert motor_warnings(athena, "xl330") == []
    assert motor_warnings(robot, "mx64") == []
    assert motor_warnings(robot, "xl330") == [
        "the log is of a xl330, but the servo of robot athena is mx64_m4."
    ]


ROOT = Path(__file__).parents[2]
ON_PAGE = ("servo", "judged_on", "logs", "angle_deg", "speed_rad_s", "torque", "bam_angle_deg")


def test_the_page_has_the_rows_that_the_benchmark_wrote() -> None:
    with (ROOT / "benchmarks" / "results" / "servos.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    written = ["| " + " | ".join(row[key] for key in ON_PAGE) + " |" for row in rows]
    page = (ROOT / "docs" / "reality.md").read_text(encoding="utf-8").splitlines()
    rows_of_page = [line for line in page if line.startswith("| ")]
    assert rows_of_page[1 : len(written) + 1] == written
    assert len(written) > 20


def test_the_page_has_the_hysteresis_that_its_script_measures() -> None:
    page = (ROOT / "docs" / "reality.md").read_text(encoding="utf-8").splitlines()
    written = [real_row(), *rows("sts3215_12v", measured_servo("sts3215_12v").servo)]
    start = page.index("| real hip | 1 | | 0.50 | 0.44 | -0.06 | 4.4 |")
    assert page[start : start + 4] == written
