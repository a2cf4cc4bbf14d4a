"""Tests that every reader of a file either returns or raises HexapodError with one paragraph, for
valid files with random changes.

`make test` draws the same few files each time; `make fuzz` draws others as long as it has time.
"""

from __future__ import annotations

import io
import json
import os
import zipfile
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from PIL import Image

from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.results.folder import read_result
from hexapod_cosim.cosim.results.recordings import read_csv, read_parquet, write_csv, write_parquet
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.models import HexapodError, load_robot
from hexapod_cosim.models.ground.grid_file import surface_from_bytes
from hexapod_cosim.models.ground.height_map import heightfield
from hexapod_cosim.models.urdf.writer import robot_to_urdf

ROOT = Path(__file__).resolve().parents[2]
LONGEST_MESSAGE = 3000  # characters
LONG = bool(os.environ.get("HEXAPOD_FUZZ"))
MODES = settings(
    max_examples=400 if LONG else 12,
    derandomize=not LONG,
    deadline=None,
    database=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
WORDS = (
    *(b"nan", b"inf", b"-inf", b"1e400", b"-1", b"0", b"1e308", b"true", b"[]", b"{}", b'""'),
    *(b"null", b"9223372036854775808", b"[[1]]", b"\0", b"\xff", b"\n\n", b"'", b'"a"', b"<a/>"),
    *(b"[terrain]\nkind = 1\n", b"1979-05-27", b"=", b",", b"]", b"}", b"5" * 400, b"/dev/null"),
)
Edit = tuple[float, int, bytes]
EDITS = st.lists(
    st.tuples(
        st.floats(0.0, 1.0),
        st.sampled_from([0, 1, 2, 4, 8, 20, 200]),
        st.one_of(st.sampled_from(WORDS), st.binary(max_size=12)),
    ),
    max_size=4,
)


def edited(content: bytes, edits: list[Edit]) -> bytes:
    """Returns content whose bytes at some places (as shares of the length) are replaced."""
    for place, length, new in edits:
        at = int(place * len(content))
        content = content[:at] + new + content[at + length :]
    return content


def reads(read: Callable[[], Any]) -> None:
    """Calls a reader, which may raise HexapodError with one paragraph and nothing else."""
    try:
        read()
    except HexapodError as error:
        text = str(error)
        assert "\n\n" not in text.strip()
        assert 0 < len(text) < LONGEST_MESSAGE


def written(folder: Path, name: str, content: bytes) -> Path:
    """Writes a file and returns its path."""
    path = folder / name
    path.write_bytes(content)
    return path


def values_replaced(text: str) -> st.SearchStrategy[bytes]:
    """Returns a strategy that puts words in the places of values of a TOML file."""
    lines = text.splitlines()
    places = [i for i, line in enumerate(lines) if "=" in line and not line.startswith("#")]

    def put(choice: list[tuple[int, bytes]]) -> bytes:
        changed = [line.encode() for line in lines]
        for place, word in choice:
            changed[place] = lines[place].partition("=")[0].encode() + b"= " + word
        return b"\n".join(changed)

    pairs = st.tuples(st.sampled_from(places), st.sampled_from(WORDS))
    return st.lists(pairs, max_size=3).map(put)


def toml_files(path: Path) -> st.SearchStrategy[bytes]:
    """Returns a strategy of a TOML file's content with changes."""
    content = path.read_bytes()
    return st.one_of(
        EDITS.map(lambda edits: edited(content, edits)), values_replaced(content.decode())
    )


ROBOT = ROOT / "models" / "athena.toml"
SCENARIOS = ROOT / "cosim" / "scenario" / "scenarios"


@MODES
@given(content=toml_files(ROBOT))
def test_a_robot_file_is_read_or_refused(tmp_path: Path, content: bytes) -> None:
    path = written(tmp_path, "robot.toml", content)
    reads(lambda: load_robot(path))


@MODES
@given(content=toml_files(SCENARIOS / "push.toml"))
def test_a_scenario_is_read_or_refused(tmp_path: Path, content: bytes) -> None:
    path = written(tmp_path, "scenario.toml", content)
    reads(lambda: load_scenario(path))


URDF = robot_to_urdf(load_robot("athena")).encode()


@MODES
@given(edits=EDITS)
def test_a_urdf_is_read_or_refused(tmp_path: Path, edits: list[Edit]) -> None:
    path = written(tmp_path, "robot.urdf", edited(URDF, edits))
    reads(lambda: load_robot(path))


def maps() -> dict[str, bytes]:
    """Returns small valid height maps by file name."""
    heights = np.arange(20.0).reshape(4, 5)
    png, npy = io.BytesIO(), io.BytesIO()
    Image.fromarray(heights.astype(np.uint16)).save(png, format="PNG")
    np.save(npy, heights)
    return {"map.png": png.getvalue(), "map.npy": npy.getvalue()}


MAPS = maps()


@pytest.mark.parametrize("name", MAPS)
@MODES
@given(edits=EDITS)
@example(edits=[(0.25, 0, b"]")])  # the header of an array is parsed as Python
@example(edits=[(0.4, 0, b"9" * 30)])
def test_a_height_map_is_read_or_refused(tmp_path: Path, name: str, edits: list[Edit]) -> None:
    path = written(tmp_path, name, edited(MAPS[name], edits))
    values = SimpleNamespace(
        file=str(path),
        horizontal_scale=0.1,
        vertical_scale=0.001,
        slope_threshold=0.75,
        smooth=0.02,
        platform_size=0.2,
        x=0.0,
        y=0.0,
    )
    reads(lambda: heightfield(values))


GRIDS = [path.read_bytes() for path in sorted((ROOT / "tests" / "native" / "grids").iterdir())]


@MODES
@given(content=st.sampled_from(GRIDS), edits=EDITS)
def test_a_grid_file_is_read_or_refused(content: bytes, edits: list[Edit]) -> None:
    reads(lambda: surface_from_bytes(edited(content, edits)))


RECORDING = Recording(("time", "torso.z"), np.arange(20.0).reshape(10, 2))


@MODES
@given(edits=EDITS)
def test_a_parquet_recording_is_read_or_refused(tmp_path: Path, edits: list[Edit]) -> None:
    whole = tmp_path / "whole.parquet"
    if not whole.exists():
        write_parquet(RECORDING, whole, about={"a": 1})
    path = written(tmp_path, "results.parquet", edited(whole.read_bytes(), edits))
    reads(lambda: read_parquet(path))


@MODES
@given(edits=EDITS)
def test_a_csv_recording_is_read_or_refused(tmp_path: Path, edits: list[Edit]) -> None:
    whole = tmp_path / "whole.csv"
    if not whole.exists():
        write_csv(RECORDING, whole, units=True)
    path = written(tmp_path, "results.csv", edited(whole.read_bytes(), edits))
    reads(lambda: read_csv(path))


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner),
    max_leaves=8,
)
FACTS: dict[str, Any] = {
    **{"status": "completed", "kind": "simulate", "title": "t", "control": "kinematic"},
    **{"gait_period": 1.0, "parameters": {}, "terrain": {}, "robot": "athena", "fmu": {}},
}


@MODES
@given(key=st.sampled_from([*FACTS, "other"]), value=JSON, metrics=JSON, edits=EDITS)
def test_a_folder_of_results_is_read_or_refused(
    tmp_path: Path, key: str, value: Any, metrics: Any, edits: list[Edit]
) -> None:
    facts = json.dumps({**FACTS, key: value}).encode()
    written(tmp_path, "run.json", edited(facts, edits))
    written(tmp_path, "metrics.json", json.dumps(metrics).encode())
    written(tmp_path, "scenario.toml", b"duration = 1.0\n")
    if not (tmp_path / "results.parquet").exists():
        write_parquet(RECORDING, tmp_path / "results.parquet", about={})
    reads(lambda: read_result(tmp_path))


def archive(description: bytes) -> bytes:
    """Returns a ZIP archive with a model description and nothing else."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as file:
        file.writestr("modelDescription.xml", description)
    return content.getvalue()
