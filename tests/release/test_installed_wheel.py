"""A wheel of `make wheels` in an empty virtual environment, with no compiler on PATH.

Runs with HEXAPOD_WHEELS=FOLDER (`make test-wheels`), because it downloads the dependencies.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import urllib.request
import zipfile
from pathlib import Path

import pytest

FOLDER = os.environ.get("HEXAPOD_WHEELS")
EXTENSIONS = Path(__file__).resolve().parents[2] / "extensions"
FAMILIES = {
    "manylinux_2_17_x86_64.manylinux2014_x86_64.musllinux_1_1_x86_64",
    "manylinux_2_17_aarch64.manylinux2014_aarch64.musllinux_1_1_aarch64",
    "win_amd64",
    "macosx_11_0_x86_64",
    "macosx_11_0_arm64",
}
pytestmark = pytest.mark.skipif(FOLDER is None, reason="needs HEXAPOD_WHEELS: make test-wheels")


@pytest.fixture(scope="module")
def wheels() -> Path:
    """The folder of the release."""
    assert FOLDER is not None
    return Path(FOLDER).resolve()


@pytest.fixture(scope="module")
def hexapod(wheels: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The command of a new environment in which this machine's wheel alone is installed.

    It is the only one of the folder, as docs/install.md says.
    """
    folder = tmp_path_factory.mktemp("environment")
    subprocess.run([sys.executable, "-m", "venv", folder], check=True)
    (wheel,) = wheels.glob("*.whl")
    options = ["--quiet", "--only-binary=:all:"]
    command = [str(folder / "bin/python"), "-m", "pip", "install", *options, str(wheel)]
    subprocess.run(command, check=True, env=bare(folder))
    return folder / "bin" / "hexapod"


def bare(folder: Path) -> dict[str, str]:
    """Environment variables with no compiler on PATH and a home of its own."""
    kept = {name: os.environ[name] for name in os.environ if name.startswith(("PIP_", "SSL_"))}
    return kept | {"PATH": str(folder / "bin"), "HOME": str(folder), "LANG": "C.UTF-8"}


def run(hexapod: Path, cwd: Path, *arguments: str) -> str:
    """Runs the command outside the source tree and returns its output."""
    process = called(hexapod, cwd, *arguments)
    assert process.returncode == 0, process.stderr
    return process.stdout


def refused(hexapod: Path, cwd: Path, *arguments: str) -> str:
    """Runs a command that must fail and returns its message."""
    process = called(hexapod, cwd, *arguments)
    assert process.returncode == 1
    return process.stderr


def called(hexapod: Path, cwd: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Runs the command outside the source tree, without a compiler on PATH."""
    return subprocess.run(
        [str(hexapod), *arguments],
        cwd=cwd,
        env=bare(hexapod.parents[1]),
        capture_output=True,
        text=True,
        check=False,
    )


def test_there_is_a_wheel_for_each_platform_of_at_most_5_mb(wheels: Path) -> None:
    found = {path.stem.split("-py3-none-")[1]: path for path in wheels.rglob("*.whl")}
    assert found.keys() == FAMILIES
    assert max(path.stat().st_size for path in found.values()) < 5e6


def test_the_descriptions_are_what_the_index_accepts(wheels: Path) -> None:
    files = [str(path) for path in (*wheels.rglob("*.whl"), *wheels.glob("*.tar.gz"))]
    subprocess.run([sys.executable, "-m", "twine", "check", "--strict", *files], check=True)


@pytest.mark.parametrize("machine", ["x86_64", "aarch64"])
def test_the_linux_wheel_keeps_what_its_tag_promises(wheels: Path, machine: str) -> None:
    (wheel,) = wheels.rglob(f"*manylinux_2_17_{machine}*.whl")
    command = [sys.executable, "-m", "auditwheel", "show", str(wheel)]
    shown = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    text = " ".join(shown.split())
    tag = re.search(r'the following platform tag: "manylinux_2_(\d+)_(\w+)"', text)
    assert tag is not None, text
    assert int(tag[1]) <= 17
    assert tag[2] == machine


def test_the_first_report_comes_out_of_the_wheel(hexapod: Path, tmp_path: Path) -> None:
    run(hexapod, tmp_path, "compare", "walk_flat", "--set", "duration=2 s", "-o", "first")
    assert (tmp_path / "first" / "report.html").stat().st_size > 100_000


@pytest.mark.skipif(not (EXTENSIONS / "live").is_dir(), reason="the extension live")
def test_the_page_of_a_live_robot_comes_out_of_the_wheel(hexapod: Path, tmp_path: Path) -> None:
    process = subprocess.Popen(
        [str(hexapod), "live", "walk_flat", "--no-browser"],
        cwd=tmp_path,
        env=bare(hexapod.parents[1]),
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    match = re.search(r"http://\S+", process.stdout.readline())
    try:
        assert match is not None
        with urllib.request.urlopen(match[0]) as answer:
            page = answer.read().decode()
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60.0)
    assert len(page) > 500_000
    assert process.returncode == 0


def test_pipx_runs_a_comparison_without_an_environment_of_its_own(
    wheels: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "pipx"
    subprocess.run([sys.executable, "-m", "venv", folder], check=True)
    python = str(folder / "bin/python")
    subprocess.run([python, "-m", "pip", "install", "--quiet", "pipx"], check=True)
    (wheel,) = wheels.glob("*.whl")
    command = [python, "-m", "pipx", "run", "--spec", str(wheel), "hexapod", "compare"]
    subprocess.run(
        [*command, "walk_flat", "--set", "duration=2 s", "-o", "first"],
        cwd=tmp_path,
        env=bare(folder) | {"PIPX_HOME": str(folder / "home")},
        check=True,
    )
    assert (tmp_path / "first" / "report.html").stat().st_size > 100_000


def test_an_fmu_for_all_platforms_needs_no_compiler(hexapod: Path, tmp_path: Path) -> None:
    run(hexapod, tmp_path, "export", "--platforms", "all", "-o", "athena.fmu")
    with zipfile.ZipFile(tmp_path / "athena.fmu") as archive:
        binaries = {name for name in archive.namelist() if name.startswith("binaries/")}
    assert {name for name in binaries if not name.endswith("/")} == {
        "binaries/linux64/hexapod.so",
        "binaries/aarch64-linux/hexapod.so",
        "binaries/win64/hexapod.dll",
        "binaries/darwin64/hexapod.dylib",
    }
    run(hexapod, tmp_path, "validate", "athena.fmu")


def test_the_examples_come_out_of_the_wheel_and_run(hexapod: Path, tmp_path: Path) -> None:
    run(hexapod, tmp_path, "examples", "-o", "mine")
    assert {path.name for path in (tmp_path / "mine").iterdir()} >= {"01_stand.py", "notebooks"}
    environment = bare(hexapod.parents[1])
    command = [str(hexapod.with_name("python")), "01_stand.py"]
    subprocess.run(command, cwd=tmp_path / "mine", env=environment, check=True)


def test_an_installation_has_no_pyarrow_and_messages_name_the_extras(
    hexapod: Path, tmp_path: Path
) -> None:
    assert not list(hexapod.parents[1].glob("lib*/python*/site-packages/pyarrow"))
    run(hexapod, tmp_path, "simulate", "stand", "--set", "duration=0.2 s", "-o", "stood")
    assert {path.name for path in (tmp_path / "stood").glob("results.*")} == {"results.csv"}
    for command, extra in (
        (["simulate", "stand", "--format", "parquet"], "parquet"),
        *([(["study", "friction_speed"], "studies")] if (EXTENSIONS / "study").is_dir() else []),
    ):
        assert f"WHEEL.whl[{extra}]" in refused(hexapod, tmp_path, *command)
