"""A log without speed commands is that of servos whose derivative acts on the angle's error."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from secret_robots import Secret, secret_robot

from hexapod_cosim.cosim.interface.names import joint_names
from hexapod_cosim.extensions.identify.commands.speed_references import with_speed_references
from hexapod_cosim.extensions.identify.identify import screen
from hexapod_cosim.extensions.identify.log import Log
from hexapod_cosim.extensions.identify.log_plant import LogPlant
from hexapod_cosim.extensions.identify.replay import Replay, replay
from hexapod_cosim.models import load_robot

SPEEDS = tuple(joint_names("speed_ref"))


@pytest.fixture(scope="module")
def secret(plant_build: Path, tmp_path_factory: pytest.TempPathFactory) -> Secret:
    return secret_robot(2, tmp_path_factory.mktemp("speeds"), duration=1.6, groups=("contact",))


@pytest.fixture(scope="module")
def lacking(secret: Secret) -> Log:
    return secret.log.without(SPEEDS)


def angle_error(done: Replay) -> float:
    return next(one.rms for one in done.channels if one.channel == "angle")


def test_the_replay_of_a_log_without_speed_commands_is_that_with_them(
    secret: Secret, lacking: Log, athena_fmu: Path
) -> None:
    """Within a tenth of the angles' error; speed commands of 0 make it more than twice as large."""
    robot = load_robot("athena")
    whole = angle_error(replay(secret.log, robot, fmu=athena_fmu))
    derived = replay(lacking, robot, fmu=athena_fmu)
    assert angle_error(derived) == pytest.approx(whole, rel=0.1)
    (text,) = derived.warnings
    assert "has no speed commands (LF.coxa.speed_ref [rad/s], ...)" in text
    assert "0 in each row is right where the servo damps the measured speed alone" in text
    still = secret.log.recording
    data = still.data.copy()
    data[:, [still.names.index(name) for name in SPEEDS]] = 0.0
    zero = replace(secret.log, recording=replace(still, data=data))
    assert angle_error(replay(zero, robot, fmu=athena_fmu)) > 2.0 * whole


def test_an_identification_takes_the_rates_of_the_angles(lacking: Log, athena_fmu: Path) -> None:
    with LogPlant(athena_fmu) as plant:
        (one,), _ = screen(plant, load_robot("athena"), [lacking], groups=("contact",))
    angles = one.log.recording.columns(joint_names("angle_ref"))
    rates = one.log.recording.columns(SPEEDS)
    assert rates == pytest.approx(np.gradient(angles, one.log.time, axis=0), abs=1e-12)
    assert one.log.derived
    assert one.without(["LF.coxa.angle"]).log.part(slice(0, 50)).derived == one.log.derived


def test_only_missing_columns_are_derived_and_only_where_kd_needs_them(secret: Secret) -> None:
    robot = load_robot("athena")
    assert with_speed_references(secret.log, robot) is secret.log
    some = secret.log.without(SPEEDS[:2])
    found = with_speed_references(some, robot)
    kept = secret.log.recording.column(SPEEDS[2])
    assert np.array_equal(found.recording.column(SPEEDS[2]), kept)
    assert "speed commands of 2 joints" in found.derived
    free = replace(robot, servo=replace(robot.servo, kd=0.0))
    assert with_speed_references(some, free) is some
