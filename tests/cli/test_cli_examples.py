"""`hexapod examples` copies what comes with the package into a folder of its own."""

from __future__ import annotations

import json
from pathlib import Path

from command import Call


def test_examples_are_copied_as_they_are(call: Call, tmp_path: Path) -> None:
    code, out, _ = call("examples", "-o", tmp_path / "mine", "--json")
    assert code == 0
    names = {
        Path(name).relative_to(tmp_path / "mine").as_posix() for name in json.loads(out)["files"]
    }
    assert {"02_walk.py", "controllers/cpg.py", "notebooks/first_walk.ipynb"} <= names
    assert not any("__pycache__" in name for name in names)
    source = Path(__file__).parents[2] / "examples" / "02_walk.py"
    assert (tmp_path / "mine" / "02_walk.py").read_bytes() == source.read_bytes()


def test_a_folder_with_files_is_refused_and_left_alone(call: Call, tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine", encoding="utf-8")
    code, _, err = call("examples", "-o", tmp_path)
    assert code == 1
    assert "a new or an empty folder" in err
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]
