"""The problems that `hexapod validate` finds in FMI 2.0 FMUs."""

from __future__ import annotations

import json
import re
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from command import Call

from hexapod_cosim.cosim.export.export import export_fmu
from hexapod_cosim.cosim.validate.validation import find_own_problems
from hexapod_cosim.models import load_robot


def tampered(source: Path, target: Path, member: str, change: Callable[[bytes], bytes]) -> Path:
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            new.writestr(name, change(old.read(name)) if name == member else old.read(name))
    return target


@pytest.mark.parametrize(
    ("member", "change", "part"),
    [
        (
            "resources/start_values.txt",
            lambda text: b"{wrong}" + text[text.index(b"\n") :],
            "has GUID",
        ),
        (
            "resources/start_values.txt",
            lambda text: text.replace(b" torso.mass", b"p1 torso.mass"),
            "torso.mass",
        ),
        ("resources/start_values.txt", lambda text: text + b"99999 1.0\n", "99999"),
        ("resources/start_values.txt", lambda text: text + b"nonsense\n", "'nonsense'"),
        ("resources/start_values.txt", lambda text: text[: text.index(b"\n") + 1], "more"),
        (
            "resources/start_values.txt",
            lambda text: re.sub(rb"\n\d+ \S+ torso.mass\n", b"\n", text),
            "lacks the value reference",
        ),
        ("binaries/linux64/hexapod.so", lambda _: b"no library", "cannot be loaded"),
    ],
)
def test_problems_that_fmpy_does_not_find_are_found(
    plant_build: Path, tmp_path: Path, member: str, change: Callable[[bytes], bytes], part: str
) -> None:
    good = export_fmu(load_robot("athena"), tmp_path / "good.fmu")
    assert find_own_problems(good) == []
    problems = find_own_problems(tampered(good, tmp_path / "bad.fmu", member, change))
    assert any(part in problem for problem in problems)


def test_validate_prints_the_problems(call: Call, tmp_path: Path, plant_build: Path) -> None:
    good = export_fmu(load_robot("athena"), tmp_path / "good.fmu")
    bad = tampered(
        good,
        tmp_path / "bad.fmu",
        "modelDescription.xml",
        lambda text: text.replace(b'"output"', b'"outputs"', 1),
    )
    code, out, err = call("validate", bad, "--json")
    printed = json.loads(out)
    assert code == 1
    assert printed["valid"] is False
    assert any("outputs" in problem for problem in printed["problems"])
    assert "the FMU is not sound" in err


def test_an_fmu_for_other_machines_is_checked_without_running_it(
    plant_build: Path, tmp_path: Path
) -> None:
    good = export_fmu(load_robot("athena"), tmp_path / "good.fmu")
    with zipfile.ZipFile(good) as old, zipfile.ZipFile(tmp_path / "sources.fmu", "w") as new:
        for name in old.namelist():
            if not name.startswith("binaries/"):
                new.writestr(name, old.read(name))
    assert find_own_problems(tmp_path / "sources.fmu") == []


def test_a_missing_resource_is_found(plant_build: Path, tmp_path: Path) -> None:
    good = export_fmu(load_robot("athena"), tmp_path / "good.fmu")
    with zipfile.ZipFile(good) as old, zipfile.ZipFile(tmp_path / "bare.fmu", "w") as new:
        for name in old.namelist():
            if not name.startswith("resources/"):
                new.writestr(name, old.read(name))
    assert any(
        "resources/start_values.txt is missing" in problem
        for problem in find_own_problems(tmp_path / "bare.fmu")
    )


@pytest.mark.parametrize(
    ("text", "part"),
    [
        (b"nonsense", "cannot be read"),
        (b"<other/>", "No matching global declaration"),
        (b"<fmiModelDescription fmiVersion='2.0' />", "'guid' is required"),
    ],
)
def test_an_unreadable_description_is_reported_as_json_too(
    call: Call, tmp_path: Path, text: bytes, part: str
) -> None:
    bad = tmp_path / "bad.fmu"
    with zipfile.ZipFile(bad, "w") as archive:
        archive.writestr("modelDescription.xml", text)
    code, out, _ = call("validate", bad, "--json")
    printed = json.loads(out)
    assert code == 1
    assert (printed["fmu"], printed["valid"]) == (str(bad), False)
    assert any(part in problem for problem in printed["problems"]), printed
