"""Progress of an identification: its steps, its simulations, and what the command shows."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import pytest
from command import Call
from secret_robots import Secret, secret_robot

from hexapod_cosim.cosim.logs.mcap_writer import write_mcap
from hexapod_cosim.extensions.identify.fitting.progress import AGAIN, MOST_STEPS, Done, Reporter
from hexapod_cosim.extensions.identify.identify import identify
from hexapod_cosim.extensions.identify.log import Log
from hexapod_cosim.extensions.identify.log_plant import LogPlant
from hexapod_cosim.models import load_robot

# of the first steps of every identification
FIRST = [
    "the columns of the log",
    "linear least squares",
    "search on the first seconds, part 1 of 2",
    "search on the first seconds, part 2 of 2",
    "other starts of the contacts",
    "all rows",
    "all rows again, step 1 of at most 12",
]


@pytest.fixture(scope="module")
def secret(plant_build: Path, tmp_path_factory: pytest.TempPathFactory) -> Secret:
    folder = tmp_path_factory.mktemp("secret")
    return secret_robot(1, folder, duration=1.0, groups=("sensor",))


@pytest.fixture(scope="module")
def short(secret: Secret) -> Log:
    """Half a second of angles and one rate, of which only sensors' numbers are sought."""
    kept = (".angle", "imu.angular_velocity[1]")
    log = secret.log.without([name for name in secret.columns if not name.endswith(kept)])
    return Log(log.recording.rows(slice(0, 100)), log.where)


@pytest.mark.parametrize("workers", [1, 2])
def test_every_simulation_is_counted_and_steps_come_in_order(
    short: Log, monkeypatch: pytest.MonkeyPatch, workers: int
) -> None:
    told: list[Done] = []
    calls = 0
    simulate = LogPlant.simulate

    def counted(self: LogPlant, *given: object, **named: object) -> object:
        nonlocal calls
        found = simulate(self, *given, **named)  # type: ignore[arg-type]
        calls += 1
        return found

    monkeypatch.setattr(LogPlant, "simulate", counted)
    found = identify(
        [short], load_robot("athena"), groups=("sensor",), workers=workers, progress=told.append
    )
    texts = list(dict.fromkeys(done.text for done in told))
    assert texts[: len(FIRST)] == FIRST
    assert texts[-1] == "what the log tells"
    assert [done.step for done in told] == sorted(done.step for done in told)
    assert told[-1].step <= MOST_STEPS == 19
    counts = [done.simulations for done in told]
    assert all(0 <= b - a <= 1 for a, b in pairwise(counts))
    if workers == 1:
        assert counts[-1] == calls > 10
    else:
        assert counts[-1] > calls
    assert len(found.estimates) > 0


def test_progress_changes_no_bit(short: Log) -> None:
    robot = load_robot("athena")
    found = [
        identify([short], robot, groups=("sensor",), progress=one) for one in (None, lambda _: None)
    ]
    assert found[0].estimates == found[1].estimates


def test_a_second_fit_counts_its_steps_anew_and_simulations_on() -> None:
    told: list[Done] = []
    report = Reporter(told.append)
    for text in ("the columns of the log", "linear least squares", "all rows"):
        report.begin(text)
    report.simulated()
    report.begin(AGAIN)
    report.begin("all rows")
    assert [(done.step, done.simulations) for done in told] == [
        (1, 0), (2, 0), (3, 0), (3, 1), (2, 1), (3, 1)
    ]  # fmt: skip


def test_the_command_prints_a_line_for_each_step_and_none_with_json(
    call: Call, short: Log, tmp_path: Path
) -> None:
    write_mcap(short.recording, tmp_path / "log.mcap")
    words = ["identify", tmp_path / "log.mcap", "--find", "sensor", "--no-propose"]
    code, _, err = call(*words, "-o", tmp_path / "plain")
    assert code == 0
    lines = [line for line in err.splitlines() if line.startswith("step ")]
    assert lines[: len(FIRST)] == [f"step {k + 1}: {text}" for k, text in enumerate(FIRST)]
    code, _, err = call(*words, "-o", tmp_path / "json", "--json")
    assert code == 0
    assert "step " not in err
