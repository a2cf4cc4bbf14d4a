"""Every metric on synthetic walks whose figures are known in closed form."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from hexapod_cosim.cosim.files import to_json
from hexapod_cosim.cosim.interface import load_interface
from hexapod_cosim.cosim.metrics import METRICS, View, commanded_path, compute_metrics, loading_rates, robot_weight
from hexapod_cosim.cosim.recorder import COMMAND_COLUMNS, Recording
from hexapod_cosim.cosim.signals import foot_names, joint_names, vector_names
from hexapod_cosim.cosim.support import centre_of_mass, polygon_margins, stability_margins
from hexapod_cosim.models import LEG_NAMES, Robot, load_robot
from hexapod_cosim.models import energy as twin
from hexapod_cosim.models.kinematics import body_states

Array = NDArray[np.float64]
Numbers = NDArray[np.floating[Any]] | NDArray[np.bool_]

H, PERIOD, CYCLES = 0.005, 1.0, 10
SPEED = 0.08  # m/s
ROBOT = load_robot("athena")
PARAMETERS = {entry.name: float(entry.start or 0.0) for entry in load_interface(ROBOT).variables if entry.causality == "parameter"}
WEIGHT = robot_weight(PARAMETERS)
DISTANCE = SPEED * PERIOD * (CYCLES - 2)  # m    in the judged cycles


class Walk:
    """A synthetic recording: everything zero until a test says otherwise; the torso moves along x at the commanded speed."""

    def __init__(self, *, cycles: int = CYCLES, speed: float = SPEED) -> None:
        outputs = [entry.name for entry in load_interface(ROBOT).variables if entry.causality == "output"]
        self.names = ("time", *outputs, *COMMAND_COLUMNS)
        self.time = H * np.arange(round(cycles * PERIOD / H) + 1)
        self.data = np.zeros((len(self.time), len(self.names)))
        self.set("time", self.time)
        self.set("torso.quaternion[1]", 1.0)
        self.set("torso.position[1]", speed * self.time)
        self.set("command.vx", SPEED)

    def set(self, name: str, values: Numbers | float) -> None:
        self.data[:, self.names.index(name)] = values

    @property
    def recording(self) -> Recording:
        return Recording(self.names, self.data)

    def metrics(self, **changes: float) -> dict[str, float]:
        parameters = PARAMETERS | {name.replace("__", "."): value for name, value in changes.items()}
        return compute_metrics(View(self.recording, parameters, PERIOD), realtime_factor=42.0)


def test_the_metrics_are_those_of_the_contract_in_its_order() -> None:
    assert list(METRICS) == [
        "slip_per_metre", "slip_net_per_metre", "path_error", "yaw_drift", "height_rms", "roll_rms", "pitch_rms", "peak_force", "force_p95",
        "loading_rate", "torque_rms", "cost_of_transport", "stability_margin", "realtime_factor",
    ]  # fmt: skip
    assert list(Walk().metrics()) == list(METRICS)


def test_weight_is_that_of_all_bodies() -> None:
    assert pytest.approx(ROBOT.total_mass * 9.81) == WEIGHT


def test_slip_counts_loaded_feet_per_metre_walked() -> None:
    walk = Walk()
    walk.set("LF.foot.slip_speed", 0.010)
    walk.set("LF.foot.normal_force", 0.3 * WEIGHT)
    walk.set("RM.foot.slip_speed", 0.005)
    walk.set("RM.foot.normal_force", 0.3 * WEIGHT)
    walk.set("LR.foot.slip_speed", 5.0)  # in the air
    walk.set("RR.foot.slip_speed", 5.0)  # touching, but not standing
    walk.set("RR.foot.normal_force", 0.009 * WEIGHT)
    assert walk.metrics()["slip_per_metre"] == pytest.approx(0.015 * (CYCLES - 2) * PERIOD / DISTANCE)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_the_creep_of_the_tanh_law_is_no_net_slip(share: float) -> None:
    mu, slope, normal = 0.7, 100.0, 0.3 * WEIGHT
    walk = Walk()
    walk.set("LF.foot.normal_force", normal)
    walk.set("LF.foot.tangential_force", share * mu * normal)
    walk.set("LF.foot.slip_speed", math.atanh(share) / slope)
    metrics = walk.metrics(friction__mu=mu, friction__slope=slope)
    assert metrics["slip_per_metre"] > 0.0
    assert metrics["slip_net_per_metre"] == pytest.approx(0.0, abs=1e-12)


def test_net_slip_is_what_exceeds_the_largest_creep() -> None:
    mu, slope, normal = 0.7, 100.0, 0.3 * WEIGHT
    walk = Walk()
    walk.set("LF.foot.normal_force", normal)
    walk.set("LF.foot.tangential_force", mu * normal)
    walk.set("LF.foot.slip_speed", 0.5)
    net = 0.5 - math.atanh(0.999) / slope
    assert walk.metrics(friction__mu=mu, friction__slope=slope)["slip_net_per_metre"] == pytest.approx(net / SPEED)


def test_a_walk_ten_percent_short_has_a_path_error_of_a_ninth() -> None:
    assert Walk(speed=0.9 * SPEED).metrics()["path_error"] == pytest.approx(0.1 / 0.9)
    assert Walk().metrics()["path_error"] == pytest.approx(0.0, abs=1e-12)


def test_the_commanded_path_sets_out_along_the_robots_own_heading() -> None:
    walk = Walk(speed=0.0)
    for angle in (0.3, -2.0):
        walk.set("torso.yaw", angle)
        walk.set("torso.position[1]", SPEED * math.cos(angle) * walk.time)
        walk.set("torso.position[2]", SPEED * math.sin(angle) * walk.time)
        assert walk.metrics()["path_error"] == pytest.approx(0.0, abs=1e-12)


def test_a_commanded_circle_is_followed_without_error() -> None:
    rate = 0.3
    walk = Walk()
    yaw = rate * walk.time
    walk.set("command.yaw_rate", rate)
    walk.set("torso.yaw", np.angle(np.exp(1j * yaw)))  # wraps at pi
    walk.set("torso.position[1]", SPEED / rate * np.sin(yaw))
    walk.set("torso.position[2]", SPEED / rate * (1.0 - np.cos(yaw)))
    metrics = walk.metrics()
    assert metrics["path_error"] == pytest.approx(0.0, abs=rate * H)  # the held command turns in steps
    assert metrics["yaw_drift"] == pytest.approx(0.0, abs=1e-12)


def test_yaw_drift_is_the_heading_lost_per_metre() -> None:
    walk = Walk()
    walk.set("torso.yaw", -0.01 * walk.time)
    assert walk.metrics()["yaw_drift"] == pytest.approx(0.01 / SPEED)


def test_the_torso_bobbing_within_a_cycle_walks_no_metre() -> None:
    walk = Walk()
    walk.set("LF.foot.normal_force", WEIGHT)
    walk.set("LF.foot.slip_speed", 0.01)
    walk.set("torso.position[3]", 0.05 * np.sin(2.0 * np.pi * walk.time / PERIOD))
    assert walk.metrics()["slip_per_metre"] == pytest.approx(0.01 / SPEED)


@pytest.mark.parametrize(
    ("column", "metric"), [("torso.position[3]", "height_rms"), ("torso.roll", "roll_rms"), ("torso.pitch", "pitch_rms")]
)
def test_an_oscillation_has_the_rms_of_a_sine_whatever_its_mean(column: str, metric: str) -> None:
    walk = Walk()
    walk.set(column, 0.2 + 0.01 * np.sin(2.0 * np.pi * walk.time / PERIOD))
    metrics = walk.metrics()
    assert metrics[metric] == pytest.approx(0.01 / math.sqrt(2.0), rel=1e-3)  # one row more than whole cycles
    assert all(metrics[other] == 0.0 for other in ("height_rms", "roll_rms", "pitch_rms") if other != metric)


def test_height_is_above_the_ground_that_rises() -> None:
    walk = Walk()
    walk.set("torso.position[3]", 0.13 + math.tan(0.1) * SPEED * walk.time)
    assert walk.metrics(terrain__kind=2, terrain__incline=0.1)["height_rms"] == pytest.approx(0.0, abs=1e-12)
    assert walk.metrics(terrain__kind=1, terrain__incline=0.1)["height_rms"] > 0.01


def test_forces_are_in_body_weights_and_the_percentile_is_of_loaded_feet() -> None:
    walk = Walk()
    force = np.linspace(0.0, 1.0, len(walk.time)) * WEIGHT
    walk.set("LF.foot.normal_force", force)
    judged = force[walk.time >= 2.0 * PERIOD] / WEIGHT
    metrics = walk.metrics()
    assert metrics["peak_force"] == pytest.approx(1.0)
    assert metrics["force_p95"] == pytest.approx(np.percentile(judged, 95))


def test_loading_rate_looks_at_twenty_milliseconds_after_touch_down_only() -> None:
    time: Array = H * np.arange(41.0)
    force, contact = np.zeros((41, 1)), np.zeros((41, 1), dtype=bool)
    contact[10:30] = True
    force[10:30, 0] = np.minimum(np.arange(1, 21), 5) * 2.0  # 2 per row until 10
    force[25, 0] = 1000.0  # long after
    rates = loading_rates(time, force, contact)
    assert rates == pytest.approx([400.0] * 5)  # the rise from the last free row, then the next 20 ms


def test_loading_rate_of_a_walk_is_its_percentile_in_body_weights_per_second() -> None:
    walk = Walk()
    phase = walk.time % PERIOD
    walk.set("LF.foot.contact", phase < 0.5)
    walk.set("LF.foot.normal_force", np.where(phase < 0.5, np.minimum(50.0 * (phase + H), 0.5), 0.0) * WEIGHT)
    assert walk.metrics()["loading_rate"] == pytest.approx(50.0, rel=1e-6)


def test_torque_rms_is_over_all_joints_and_time() -> None:
    walk = Walk()
    walk.set("LF.femur.torque", 3.0)
    assert walk.metrics()["torque_rms"] == pytest.approx(3.0 / math.sqrt(18.0))


def test_cost_of_transport_counts_positive_work_joint_by_joint() -> None:
    walk = Walk()
    walk.set("LF.femur.torque", 2.0)
    walk.set("LF.femur.speed", 0.5)
    walk.set("RF.femur.torque", -2.0)  # gives energy back: servos do not store it
    walk.set("RF.femur.speed", 0.5)
    assert walk.metrics()["cost_of_transport"] == pytest.approx(1.0 * (CYCLES - 2) * PERIOD / (WEIGHT * DISTANCE))


def test_the_first_two_cycles_do_not_count() -> None:
    clean, dirty = Walk(), Walk()
    early = dirty.time < 2.0 * PERIOD - H / 2
    for name in (*foot_names("normal_force"), *foot_names("slip_speed"), *joint_names("torque"), "torso.roll", "torso.position[3]"):
        dirty.set(name, np.where(early, 7.0, 0.0))
    assert dirty.metrics() == pytest.approx(clean.metrics(), nan_ok=True)


def test_a_cycle_begun_does_not_count() -> None:
    walk = Walk()
    walk.set("torso.roll", np.where(walk.time > 9.0 + 1e-9, 0.5, 0.0))
    shorter = Recording(walk.names, walk.data[walk.time < 9.7])
    assert compute_metrics(View(shorter, PARAMETERS, PERIOD), realtime_factor=1.0)["roll_rms"] == 0.0


def test_a_standing_robot_has_no_figures_per_metre_and_json_says_null() -> None:
    metrics = Walk(speed=0.0).metrics()
    per_metre = ("slip_per_metre", "slip_net_per_metre", "path_error", "yaw_drift", "cost_of_transport")
    assert all(math.isnan(metrics[name]) for name in per_metre)
    assert metrics["height_rms"] == 0.0
    assert json.loads(to_json(metrics))["slip_per_metre"] is None


@pytest.mark.parametrize("cycles", [0, 1, 2])
def test_fewer_than_three_cycles_have_no_figures_but_the_speed(cycles: int) -> None:
    metrics = Walk(cycles=cycles).metrics()
    assert metrics.pop("realtime_factor") == 42.0
    assert all(math.isnan(value) for value in metrics.values())


def test_the_commanded_path_turns_with_the_command() -> None:
    walk = Walk()
    walk.set("command.vx", np.where(walk.time < 5.0 - H / 2, 0.1, 0.0))
    walk.set("command.vy", np.where(walk.time < 5.0 - H / 2, 0.0, 0.1))
    path = commanded_path(walk.recording)
    assert path[-1] == pytest.approx([0.5, 0.5])


# ------------------------------------------------------------------------------------------------- support

SQUARE = np.array([[1.0, 1.0], [0.0, 1.0], [-1.0, 1.0], [1.0, -1.0], [0.0, -1.0], [-1.0, -1.0]])
ALL = [True] * 6


@pytest.mark.parametrize(
    ("standing", "centre", "margin"),
    [
        (ALL, (0.0, 0.0), 1.0),
        (ALL, (0.4, 0.1), 0.6),
        (ALL, (0.0, -0.75), 0.25),
        (ALL, (1.2, 0.0), -0.2),
        ([True, False, True, False, True, False], (0.0, 0.0), 1.0 / math.sqrt(5.0)),  # a tripod
        ([True, False, True, False, False, False], (0.0, 0.7), -0.3),  # a line
        ([True, False, False, False, False, False], (1.0, 1.0), math.nan),
        ([False] * 6, (0.0, 0.0), math.nan),
    ],
)
def test_the_margin_is_the_distance_to_the_nearest_edge(standing: list[bool], centre: tuple[float, float], margin: float) -> None:
    got = polygon_margins(SQUARE[None], np.array([standing]), np.array([centre]))
    assert got == pytest.approx([margin], nan_ok=True)


def test_the_margin_does_not_depend_on_the_order_of_the_feet() -> None:
    generator = np.random.default_rng(5)
    feet = generator.normal(size=(50, 6, 2))
    centre, standing = 0.3 * generator.normal(size=(50, 2)), generator.random((50, 6)) < 0.7
    order = generator.permutation(6)
    first, second = polygon_margins(feet, standing, centre), polygon_margins(feet[:, order], standing[:, order], centre)
    np.testing.assert_allclose(first, second, atol=1e-12)


def poses(robot: Robot, rows: int) -> tuple[Recording, list[Array]]:
    """Random poses as a recording, and the twin's body states of them."""
    generator = np.random.default_rng(7)
    names = ("time", *joint_names("angle"), *vector_names("torso.position"), *vector_names("torso.quaternion", 4))
    angle, position = 0.5 * generator.normal(size=(rows, 6, 3)), generator.normal(size=(rows, 3))
    quaternion = generator.normal(size=(rows, 4))
    quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
    zero = np.zeros(3)
    bodies = [
        body_states(robot, r, p, zero, zero, joints, np.zeros((6, 3))) for r, p, joints in zip(position, quaternion, angle, strict=True)
    ]
    return Recording(names, np.column_stack([np.arange(rows), angle.reshape(rows, -1), position, quaternion])), bodies


@pytest.mark.parametrize("name", ["athena", "phantomx_mk4"])
def test_the_centre_of_mass_is_the_twins(name: str) -> None:
    robot = load_robot(name)
    parameters = {entry.name: float(entry.start or 0.0) for entry in load_interface(robot).variables if entry.causality == "parameter"}
    recording, bodies = poses(robot, 5)
    expected = [twin.centre_of_mass(robot, body) for body in bodies]
    np.testing.assert_allclose(centre_of_mass(recording, parameters), expected, atol=1e-12)


def test_a_robot_on_a_slope_is_judged_along_gravity() -> None:
    walk = Walk(cycles=0)
    for leg, (x, y) in zip(LEG_NAMES, SQUARE, strict=True):
        walk.set(f"{leg}.foot.position[1]", x)
        walk.set(f"{leg}.foot.position[2]", y)
        walk.set(f"{leg}.foot.contact", 1.0)
    walk.set("torso.position[3]", 1.0)
    massless = PARAMETERS | {name: 0.0 for name in PARAMETERS if name.endswith(".mass")} | {"torso.mass": 1.0}
    tilted = massless | {"gravity[1]": 9.81 * math.sin(0.1), "gravity[3]": -9.81 * math.cos(0.1)}
    assert stability_margins(walk.recording, massless) == pytest.approx([1.0])
    # the projection falls tan(0.1) ahead of the torso, and the square is seen foreshortened
    assert stability_margins(walk.recording, tilted) == pytest.approx([(1.0 - math.tan(0.1)) * math.cos(0.1)])
