"""Tests that odd and damaged files end in one paragraph that says what is wrong with them, never in
an unexpected exception.
"""

from __future__ import annotations

import io
import shutil
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import pytest

from hexapod_cosim.cosim.cli import main

MODELS = Path(__file__).resolve().parents[2] / "models"
ATHENA = (MODELS / "athena.toml").read_text(encoding="utf-8")
LARGE = {
    "beyond_float": "1" + 400 * "0",
    "digits": 5000 * "1",
    "hexadecimal": "0x" + 6000 * "f",
    "64_bits": str(2**63),
}
DEEP = {
    "arrays": "x = " + 100_000 * "[",
    "tables": "x = " + 5000 * "{a=",
    "keys": ".".join(5000 * "a") + " = 1",
    "closed": "x = " + 65 * "[" + 65 * "]",
}
TEXTS = {
    **{f"large_{key}": ATHENA.replace("mass = ", f"mass = {n} # ", 1) for key, n in LARGE.items()},
    **{f"deep_{key}": text for key, text in DEEP.items()},
}
LONGEST_MESSAGE = 2000  # characters


def said(*arguments: str) -> tuple[int, str]:
    """Runs the command; returns its exit code and what it writes to stderr."""
    errors = io.StringIO()
    with redirect_stderr(errors), redirect_stdout(io.StringIO()):
        code = main(list(arguments))
    return code, errors.getvalue()


def refused(*arguments: str) -> str:
    """Runs the command, which must fail in one paragraph; returns that."""
    code, text = said(*arguments)
    assert code in (1, 2), text
    assert "unexpected" not in text
    assert text.startswith("hexapod: ")
    assert "\n\n" not in text.strip()
    assert len(text) < LONGEST_MESSAGE
    return " ".join(text.split())


@pytest.mark.parametrize("name", TEXTS)
@pytest.mark.parametrize(
    "command",
    [
        lambda file, out: ("export", "--robot", file, "-o", f"{out}.fmu"),
        lambda file, out: ("simulate", file, "-o", out),
        lambda file, out: (
            *("export", "--controller", "compliant", "--gains", file),
            *("-o", f"{out}.fmu"),
        ),
    ],
    ids=["robot", "scenario", "gains"],
)
def test_large_numbers_and_deep_tables_are_no_toml(
    plant_build: Path, tmp_path: Path, command: Callable[[str, str], tuple[str, ...]], name: str
) -> None:
    file = tmp_path / "file.toml"
    file.write_text(TEXTS[name], encoding="utf-8")
    text = refused(*command(str(file), str(tmp_path / "out")))
    assert "not a TOML file" in text
    assert "expected TOML 1.0 in UTF-8" in text.replace("'", "")
    assert f"correct {file}" in text
    expected = "an integer of more than 64 bits" if name.startswith("large") else "deep"
    assert expected in text
    assert [path.name for path in tmp_path.iterdir()] == ["file.toml"]


@pytest.mark.parametrize(
    "path", ["a\0b", 5000 * "x", "/".join(40 * [200 * "d"]) + "/x"], ids=["nul", "long", "deep"]
)
@pytest.mark.parametrize(
    "command",
    [
        lambda path: ("export", "--robot", f"{path}.toml", "-o", "o.fmu"),
        lambda path: ("export", "--robot", f"{path}.urdf", "-o", "o.fmu"),
        lambda path: ("export", "-o", f"{path}.fmu"),
        lambda path: ("simulate", f"{path}.toml"),
        lambda path: ("simulate", "walk_flat", "--set", "duration=0.01", "-o", path),
        lambda path: ("simulate", "walk_flat", "--fmu", f"{path}.fmu"),
        lambda path: ("compare", f"{path}.toml", "-o", "o"),
        lambda path: ("validate", f"{path}.fmu"),
        lambda path: ("report", path),
        lambda path: ("terrain", "stairs", "-o", f"{path}.png"),
        lambda path: ("export", "--controller", "compliant", "--gains", path, "-o", "o.fmu"),
    ],
)
def test_a_path_that_no_system_opens_is_refused(
    plant_build: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    command: Callable[[str], tuple[str, ...]],
    path: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    refused(*command(path))


@pytest.fixture(scope="module")
def results(plant_build: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a short run."""
    folder = tmp_path_factory.mktemp("run") / "out"
    short = ("--set", "duration=0.1", "--set", "outputs.formats=['parquet']")
    code, text = said("simulate", "walk_flat", *short, "-o", str(folder))
    assert code == 0, text
    return folder


def damaged(results: Path, tmp_path: Path, name: str, content: bytes) -> Path:
    """Returns a copy of results with another file."""
    copy = tmp_path / "copy"
    shutil.copytree(results, copy)
    (copy / name).write_bytes(content)
    return copy


def test_a_report_into_a_folder_that_takes_no_files_names_the_place(
    results: Path, tmp_path: Path
) -> None:
    copy = damaged(results, tmp_path, "other", b"")
    shutil.rmtree(copy / "plots")
    (copy / "plots").write_text("a file", encoding="utf-8")
    text = refused("report", str(copy))
    assert f"{tmp_path}/copy/plots: the results cannot be read or written: got 'File exists" in text
    assert "run the scenario again" not in text


def test_an_error_of_the_system_is_one_paragraph(
    plant_build: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device", "somewhere")

    monkeypatch.setattr("hexapod_cosim.cosim.export.validation.find_problems", full)
    text = refused("validate", "x.fmu")
    assert "No space left on device: 'somewhere'; run `hexapod --debug ...` to see where" in text


ENDLESS = [
    ("simulate", "PATH.toml", "-o", "o"),
    ("export", "--robot", "PATH.toml", "-o", "o.fmu"),
    ("export", "--robot", "PATH.urdf", "-o", "o.fmu"),
    ("export", "--controller", "compliant", "--gains", "PATH.toml", "-o", "o.fmu"),
    ("report", "folder"),
    ("simulate", "walk_flat", "--set", "robot=PATH.toml", "-o", "o"),
]


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="a file without an end")
@pytest.mark.parametrize("command", ENDLESS)
def test_a_file_without_an_end_is_refused(
    plant_build: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: tuple[str, ...]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    for name in ("PATH.toml", "PATH.urdf", "folder/run.json"):
        (tmp_path / name).symlink_to("/dev/zero")
    assert "a file of more than 64 MiB" in refused(*command)


@pytest.mark.parametrize("path", [".", "/", "", "folder", "..", "./"])
@pytest.mark.parametrize(
    "command",
    [
        ("export", "-o"),
        ("export", "--mjcf", "-o"),
        ("export", "--urdf", "-o"),
        ("export", "--ssp", "-o"),
        ("terrain", "stairs", "-o"),
    ],
)
def test_a_folder_is_no_file_to_write(
    plant_build: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    command: tuple[str, ...],
    path: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    refused(*command, path)


def test_a_folder_whose_name_is_no_utf_8_gets_results(
    plant_build: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = Path(f"{tmp_path}/out \udcff\udcc3")
    code, text = said("simulate", "walk_flat", "--set", "duration=0.02", "-o", str(folder))
    assert code == 0, text
    assert (folder / "report.html").is_file()
    monkeypatch.setattr("hexapod_cosim.cosim.report.plots.DRAWINGS", {})
    assert said("report", str(folder))[0] == 0
