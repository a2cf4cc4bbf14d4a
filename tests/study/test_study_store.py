"""The store of a study: no run is lost or damaged by kills, and results have the same bytes."""

from __future__ import annotations

import errno
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from command import COMMAND
from studies import FAKE, KINEMATIC, SLOW, SMALL, digest, quiet, rows, run_quietly, study_of

from hexapod_cosim.cosim.study.execute.study import Options, run_study
from hexapod_cosim.cosim.study.plan.reading import load_study
from hexapod_cosim.cosim.study.plan.records import StudyError
from hexapod_cosim.cosim.study.store import store as store_module
from hexapod_cosim.cosim.study.store.columns import FIGURES, result_schema, schema_of
from hexapod_cosim.cosim.study.store.manifest import MANIFEST, RUNS, locked
from hexapod_cosim.cosim.study.store.results import read_results
from hexapod_cosim.cosim.study.store.store import MERGE_COUNT, Store, write_durably, write_whole

ROOT = Path(__file__).resolve().parents[2]
TIMEOUT = 180.0  # s    for what takes some seconds on an idle machine
MANY_RUNS: dict[str, Any] = {
    **KINEMATIC,
    "seeds": 10,
    "factors": {"friction.mu": {"linspace": [0.3, 0.9, 20]}},
}


@pytest.fixture
def small(athena_fmu: Path, tmp_path: Path) -> Callable[..., list[dict[str, Any]]]:
    """A function that runs a small study under kinematic control into a folder of the test."""

    def run(
        name: str = "out", table: dict[str, Any] = SMALL, **options: Any
    ) -> list[dict[str, Any]]:
        return run_quietly(
            study_of({**table, **KINEMATIC}), tmp_path / name, **{"fmu": athena_fmu, **options}
        )

    return run


def test_a_finished_study_is_left_as_it_is_when_started_again(
    small: Callable[..., Any], tmp_path: Path
) -> None:
    small()
    before = {path: path.stat().st_mtime_ns for path in (tmp_path / "out" / RUNS).iterdir()}
    first = digest(tmp_path / "out")
    small()
    assert {path: path.stat().st_mtime_ns for path in (tmp_path / "out" / RUNS).iterdir()} == before
    assert digest(tmp_path / "out") == first


def test_results_do_not_depend_on_workers_or_chunks(
    small: Callable[..., Any], tmp_path: Path
) -> None:
    small("none", MANY_RUNS, workers=0)
    small("one", MANY_RUNS, workers=1)
    small("two", MANY_RUNS, workers=2)
    small("slow", MANY_RUNS, workers=2, engine=SLOW)
    assert digest(tmp_path / "none") == digest(tmp_path / "one") == digest(tmp_path / "two")
    # the bytes differ by the name of the engine in the metadata
    assert rows(tmp_path / "one") == rows(tmp_path / "slow")


def test_rows_hold_the_settings_the_figures_and_how_a_run_ended(small: Callable[..., Any]) -> None:
    table = {
        **SMALL,
        "seeds": 1,
        "factors": {"friction.mu": [0.17, 0.19, 0.5], "gait.name": ["tripod"]},
    }
    refused, fallen, walked = small(table=table)
    assert (refused["status"], refused["reason"], refused["walked"]) == (
        "refused",
        "no walk with 0",
        False,
    )
    assert refused["slip_per_metre"] is None
    assert (fallen["status"], fallen["upright"], fallen["walked"]) == ("completed", False, False)
    assert (
        walked["friction.mu"],
        walked["gait.name"],
        walked["foot_error_stance"],
        walked["walked"],
    ) == (0.5, "tripod", 1.25, True)
    assert len({row["identity"] for row in (refused, fallen, walked)}) == 3
    assert not {"wall", "realtime_factor"} & set(walked)


REAL = """
controls = ["kinematic"]
seeds = 35
[set]
duration = 0.4
[factors]
friction.mu = {linspace = [0.3, 0.9, 20]}
"""
REAL_RUNS = 700


def command(folder: Path, fmu: Path, *more: str, study: Path) -> subprocess.Popen[str]:
    words = [
        *COMMAND,
        "study",
        str(study),
        "-o",
        str(folder),
        "--fmu",
        str(fmu),
        "--workers",
        "2",
        *more,
    ]
    return subprocess.Popen(
        words,
        cwd=ROOT,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def stored_runs(folder: Path) -> int:
    return sum(pq.ParquetFile(path).metadata.num_rows for path in (folder / RUNS).glob("*.parquet"))


def test_real_walks_killed_twice_at_any_point_and_completed_are_the_uninterrupted_ones(
    athena_fmu: Path, tmp_path: Path
) -> None:
    file = tmp_path / "study.toml"
    file.write_text(REAL)
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    for least in (1, random.randint(50, 150)):
        process = command(killed, athena_fmu, study=file)
        deadline = time.monotonic() + TIMEOUT
        while (
            stored_runs(killed) < least and time.monotonic() < deadline and process.poll() is None
        ):
            time.sleep(0.005)
        time.sleep(random.uniform(0.0, 0.02))
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        assert least <= stored_runs(killed) < REAL_RUNS
    kept = {path.name: path.read_bytes() for path in (killed / RUNS).glob("*.parquet")}
    (killed / RUNS / ".part-99999999.parquet.12345678.new").write_bytes(b"half a part")
    (killed / ".results.parquet.12345678.new").write_bytes(b"half a file")
    process = command(killed, athena_fmu, study=file)
    _, err = process.communicate(timeout=TIMEOUT)
    assert process.returncode == 0, err
    run_quietly(load_study(str(file)), whole, fmu=athena_fmu, engine="compiled")
    assert digest(killed) == digest(whole)
    assert {name: (killed / RUNS / name).read_bytes() for name in kept} == kept
    assert not list(killed.rglob(".*.new"))
    assert len(rows(whole)) == REAL_RUNS
    assert all(row["status"] == "completed" for row in rows(whole))


def test_a_study_is_not_resumed_with_other_code(
    small: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    small("out", SMALL)
    monkeypatch.setattr(
        "hexapod_cosim.cosim.study.execute.job.code_hash", lambda: "0123456789abcdef"
    )
    with pytest.raises(StudyError, match=r"environment.code was .*, is \"0123456789abcdef\""):
        small("out", SMALL)


def test_a_full_disk_is_reported_and_the_study_is_resumed_from_the_stored_runs(
    athena_fmu: Path, tmp_path: Path
) -> None:
    room = [3]

    def filling(path: Path, content: bytes) -> None:
        if not room[0]:
            raise store_module._not_written(path, OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)))
        room[0] -= 1
        write_durably(path, content)

    study, folder = study_of(MANY_RUNS), tmp_path / "out"
    options = Options(engine=FAKE, workers=0, fmu=athena_fmu, write=filling)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(store_module, "FLUSH_ROWS", 20)
        patch.setattr("hexapod_cosim.cosim.study.execute.dispatch.MAX_CHUNK", 10)
        with pytest.raises(
            StudyError, match=r"the disk is full.*make room and start the study again"
        ):
            run_study(study, folder, options=options, start=quiet)
    stored = stored_runs(folder)
    assert 0 < stored < 200
    run_quietly(study, folder, fmu=athena_fmu)
    run_quietly(study, tmp_path / "whole", fmu=athena_fmu)
    assert digest(folder) == digest(tmp_path / "whole")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_a_file_that_does_not_fit_leaves_the_old_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = tmp_path / "results.parquet"
    place.write_bytes(b"old")
    unfinished = tmp_path / ".results.parquet.new"
    monkeypatch.setattr(store_module, "_unfinished", lambda _path: unfinished)
    unfinished.symlink_to("/dev/full")
    with pytest.raises(StudyError, match="the disk is full"):
        write_durably(place, b"new" * 100_000)
    assert place.read_bytes() == b"old"
    unfinished.symlink_to("/dev/full")
    table = pa.table({"run": np.arange(1_000_000)})
    with pytest.raises(StudyError, match="the disk is full"):
        write_whole(place, [table], table.schema)
    assert place.read_bytes() == b"old"
    assert [path.name for path in tmp_path.iterdir()] == ["results.parquet"]


def cut(content: bytes) -> bytes:
    return content[: len(content) // 2]


def flipped(content: bytes) -> bytes:
    place = len(content) // 3
    return content[:place] + bytes([content[place] ^ 1]) + content[place + 1 :]


@pytest.mark.parametrize(
    "damage",
    [cut, flipped, lambda _: b"", lambda _: b"PAR1 garbage PAR1"],
    ids=["cut", "flipped", "empty", "garbage"],
)
def test_a_damaged_part_is_set_aside_and_its_runs_are_run_again(
    small: Callable[..., Any], tmp_path: Path, damage: Callable[[bytes], bytes]
) -> None:
    small()
    first, events = digest(tmp_path / "out"), list[str]()
    (part,) = (tmp_path / "out" / RUNS).glob("*.parquet")
    content = damage(part.read_bytes())
    part.write_bytes(content)
    assert (
        read_results(tmp_path / "out").overall.runs,
        read_results(tmp_path / "out").damaged,
    ) == (9, [])  # of results.parquet
    (tmp_path / "out" / "results.parquet").unlink()
    found = read_results(tmp_path / "out")
    assert (found.overall.runs, [text.partition(" ")[0] for text in found.damaged]) == (
        0,
        [part.name],
    )
    small(events=events.append)
    assert digest(tmp_path / "out") == first
    assert part.with_name(part.name + ".damaged").read_bytes() == content
    assert [f"{part.name}: a damaged part" in text for text in events] == [True]
    small(events=events.append)
    assert len(events) == 1


def test_a_part_of_another_study_is_set_aside(small: Callable[..., Any], tmp_path: Path) -> None:
    small()
    first = digest(tmp_path / "out")
    small("columns", {**SMALL, "factors": {"friction.mu": [0.3], "command.vx": [0.05]}})
    small("more", {**SMALL, "seeds": 9})
    for other in ("columns", "more"):
        (part,) = (tmp_path / other / RUNS).glob("*.parquet")
        events: list[str] = []
        (tmp_path / "out" / RUNS / part.name).write_bytes(part.read_bytes())
        small(events=events.append)
        assert digest(tmp_path / "out") == first
        assert len(events) == 1


def test_what_is_not_a_part_is_left_alone(small: Callable[..., Any], tmp_path: Path) -> None:
    small()
    first = digest(tmp_path / "out")
    (tmp_path / "out" / RUNS / "part-mine.parquet").write_bytes(b"mine")
    small()
    assert digest(tmp_path / "out") == first
    assert (tmp_path / "out" / RUNS / "part-mine.parquet").read_bytes() == b"mine"


def test_a_reader_finds_every_run_while_parts_are_put_together(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(store_module, "ROWS_AT_ONCE", 10)
    monkeypatch.setattr(store_module, "MERGE_COUNT", 4)
    schema = schema_of(study_of())
    writer, reader = Store(tmp_path / RUNS, schema), Store(tmp_path / RUNS, schema)
    writer.prepare(100)
    for first in (0, 20, 40):
        writer.add(rows_from(schema, list(range(first, first + 20))))
        writer.flush()
    found: list[int] = []
    for block, table in enumerate(reader.sorted_rows()):
        found += table["run"].to_pylist()
        if block == 1:  # the three parts become one
            writer.add(rows_from(schema, [60, 61]))
            writer.flush()
            assert len(writer.parts()) == 1
    assert found == list(range(62))


def test_files_that_others_may_write_just_now_are_left_alone_for_a_while(
    small: Callable[..., Any], tmp_path: Path
) -> None:
    small()
    young, old = (
        tmp_path / "out" / f".summary.json.{name}.new" for name in ("12345678", "87654321")
    )
    for path in (young, old):
        path.touch()
    os.utime(old, (0.0, 0.0))
    small()
    assert young.exists()
    assert not old.exists()


def rows_from(schema: pa.Schema, runs: list[int]) -> list[dict[str, Any]]:
    zero = {pa.int64(): 0, pa.float64(): 0.5, pa.bool_(): True, pa.string(): "x"}
    return [
        {**{item.name: zero[item.type] for item in schema}, "run": run, "seed": run} for run in runs
    ]


def test_many_parts_become_one_and_a_run_in_two_parts_counts_once(tmp_path: Path) -> None:
    schema = schema_of(study_of())
    store = Store(tmp_path / RUNS, schema)
    store.prepare(3 * MERGE_COUNT)
    numbers = np.random.default_rng(0).permutation(3 * MERGE_COUNT).tolist()
    for run in numbers:
        store.add(rows_from(schema, [run]))
        store.flush()
    assert len(store.parts()) == 3
    # as after a kill between writing the merged part and removing the small ones
    store.add(rows_from(schema, [7, 8]))
    store.flush()
    (table,) = store.sorted_rows()
    assert table["run"].to_pylist() == list(range(3 * MERGE_COUNT))
    assert store.done(3 * MERGE_COUNT + 1).tolist() == [True] * 3 * MERGE_COUNT + [False]
    assert {row["seed"] for row in store.rows([3, 8]).values()} == {3, 8}


def test_sorting_goes_block_by_block(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store_module, "ROWS_AT_ONCE", 10)
    schema = schema_of(study_of())
    store = Store(tmp_path / RUNS, schema)
    store.prepare(26)
    for part in ([25, 3, 11], [4, 19, 3], [12]):
        store.add(rows_from(schema, part))
        store.flush()
    assert [table["run"].to_pylist() for table in store.sorted_rows()] == [
        [3, 4],
        [11, 12, 19],
        [25],
    ]
    write_whole(tmp_path / "whole.parquet", store.sorted_rows(), result_schema(schema))
    assert pq.read_table(tmp_path / "whole.parquet")["run"].to_pylist() == [3, 4, 11, 12, 19, 25]
    assert pq.read_schema(tmp_path / "whole.parquet").field("slip_per_metre").metadata == {
        b"unit": b"m/m"
    }
    assert set(FIGURES) < set(schema.names)


def test_another_study_into_the_same_folder_is_refused_and_the_differences_named(
    small: Callable[..., Any], tmp_path: Path, athena_fmu: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    small()
    first = (tmp_path / "out" / MANIFEST).read_bytes()
    with pytest.raises(StudyError, match=r"another study's runs.*study.seeds was 3, is 4"):
        small(table={**SMALL, "seeds": 4})
    other = tmp_path / "other.fmu"
    other.write_bytes(athena_fmu.read_bytes() + b"\0")
    with pytest.raises(StudyError, match=r"fmus.athena was"):
        small(fmu=other)
    with pytest.raises(StudyError, match=f"engine was .*{FAKE}.*, is .*{SLOW}"):
        small(engine=SLOW)
    monkeypatch.setattr("hexapod_cosim.cosim.study.execute.job.package_version", lambda: "9.9")
    with pytest.raises(StudyError, match=r"environment.hexapod-cosim was .*, is \"9.9\""):
        small()
    assert (tmp_path / "out" / MANIFEST).read_bytes() == first


def test_a_folder_of_something_else_is_refused(small: Callable[..., Any], tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "thesis.tex").touch()
    with pytest.raises(StudyError, match=r"other files.*thesis.tex"):
        small()


def test_two_processes_do_not_share_a_folder(small: Callable[..., Any], tmp_path: Path) -> None:
    with (
        locked(tmp_path / "out"),
        pytest.raises(StudyError, match="another process runs a study into this folder"),
    ):
        small()
    small()


@pytest.mark.skipif(sys.platform == "win32", reason="locks files by another function")
@pytest.mark.parametrize("number", [errno.ENOSYS, errno.ENOTSUP, errno.ENOLCK])
def test_a_file_system_without_locks_holds_studies_too(
    small: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    def flock(_file: int, _operation: int) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr("fcntl.flock", flock)
    assert len(small()) == 9


def test_the_lock_of_a_killed_process_is_gone(tmp_path: Path) -> None:
    holder = (
        "import sys, time; from pathlib import Path\n"
        "from hexapod_cosim.cosim.study.store.manifest import locked\n"
        "with locked(Path(sys.argv[1])):\n"
        "    print('locked', flush=True); time.sleep(600)\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", holder, str(tmp_path)], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "locked\n"
        with pytest.raises(StudyError, match="another process"), locked(tmp_path):
            pass
        process.kill()
        process.wait()
    with locked(tmp_path):
        pass
