"""Tests that `make test-importers` passes exactly when every other tool that could be installed ran
and agrees.

Scripts stand for the adapters of the tools.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from hexapod_cosim.cosim.export.robot_package import PLANT
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.results.recordings import write_csv
from tools.importers import compare, packages
from tools.importers.compare import IMPORTERS, Importer, Row, verdict
from tools.importers.packages import TOOLS, PackageRow
from tools.importers.walk import STEP, Walk

PYTHON = Path(sys.executable)
INSTALLED, MISSING = ("numpy",), ("no-such-distribution",)  # packages of tools
# each script is called with FMU INPUTS NAMES OUTPUTS
ADAPTERS = {
    "right": "import shutil, sys; shutil.copy(sys.argv[2], sys.argv[4])",
    "crashes": "raise RuntimeError('the step failed')",
    "exits": "import sys; sys.exit(3)",
    "silent": "",
    "empty": "import sys; open(sys.argv[4], 'w').close()",
    "short": "import sys; open(sys.argv[4], 'w').writelines(open(sys.argv[2]).readlines()[:-1])",
    "lacks": "import sys; open(sys.argv[4], 'w').write('\"time\"\\n0.005\\n0.01\\n0.015\\n')",
    "wrong": "import sys; open(sys.argv[4], 'w').write(open(sys.argv[2]).read().replace('2', '3'))",
    "nan": "import sys; open(sys.argv[4], 'w').write(open(sys.argv[2]).read().replace('2', 'nan'))",
}
FAILING = [name for name in ADAPTERS if name != "right"]


class ReplayedWalk(Walk):
    """A walk without an FMU whose replay returns the reference."""

    def replay(self, ends: NDArray[np.float64], steps: NDArray[np.float64]) -> Recording:
        return self.reference


@pytest.fixture
def walk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Walk:
    for name, text in ADAPTERS.items():
        (tmp_path / f"{name}.py").write_text(text, encoding="utf-8")
    monkeypatch.setattr(compare, "ADAPTERS", tmp_path)
    inputs, none = tmp_path / "answers.csv", tmp_path / "none"
    reference = Recording(
        ("time", f"{PLANT}.x"), np.array([[STEP, 1.0], [2 * STEP, 2.0], [3 * STEP, 4.0]])
    )
    write_csv(reference, inputs)
    return ReplayedWalk(
        folder=tmp_path,
        fmu=none,
        inputs=inputs,
        wanted=none,
        reference=reference,
        recorded=reference,
    )


def importers(walk: Walk, *adapters: str, of: Sequence[str] = INSTALLED) -> list[Row]:
    return [
        compare.run_importer(Importer(name, tuple(of), f"{name}.py", ""), walk, PYTHON)
        for name in adapters
    ]


def tools(walk: Walk, *adapters: str, of: Sequence[str] = INSTALLED) -> list[PackageRow]:
    masters = [Recording(("time", "x"), walk.reference.data)] * 2
    outputs, none = walk.folder / "package.csv", walk.folder / "none"
    commands = [
        [PYTHON, walk.folder / f"{name}.py", none, walk.inputs, none, outputs] for name in adapters
    ]
    return [
        packages.run_tool(name, of, command, outputs, masters, ["x"])
        for name, command in zip(adapters, commands, strict=True)
    ]


RIGHT = ("right",) * len(IMPORTERS)
BOTH = ("right",) * len(TOOLS)


def test_three_importers_and_two_tools_that_agree_pass(walk: Walk) -> None:
    assert (len(IMPORTERS), len(TOOLS)) == (3, 2)
    assert verdict(importers(walk, *RIGHT), tools(walk, *BOTH), ours=importers(walk, "right")) == 0


@pytest.mark.parametrize("adapter", FAILING)
def test_an_importer_that_was_installed_and_fails_does_not_pass(
    walk: Walk, adapter: str, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = importers(walk, "right", "right", adapter)
    assert rows[-1].remark
    assert verdict(rows, tools(walk, *BOTH), ours=[]) == 1
    assert f"{adapter} does not agree" in capsys.readouterr().err


def test_tools_that_could_not_be_installed_pass_with_a_remark(walk: Walk) -> None:
    absent, absent_tool = importers(walk, "crashes", of=MISSING), tools(walk, "crashes", of=MISSING)
    assert "could not be installed: no-such-distribution" in absent[0].remark
    assert "could not be installed" in absent_tool[0].trouble
    assert (
        verdict(
            [*importers(walk, "right", "right"), *absent],
            [*tools(walk, "right"), *absent_tool],
            ours=[],
        )
        == 0
    )
    without_rust = compare.run_importer(
        Importer("crashes", (), "crashes.py", ""),
        walk,
        PYTHON,
        missing="cargo (Rust) is not installed",
    )
    assert without_rust.missing
    assert "Rust" in without_rust.remark
