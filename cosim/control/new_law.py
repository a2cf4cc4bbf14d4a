"""Writes a user's first controller: a Python file, its test, and a line for a README."""

from __future__ import annotations

import keyword
import re
from pathlib import Path

from hexapod_cosim.cosim.common.files import write_text
from hexapod_cosim.models import HexapodError

TEMPLATE = Path(__file__).parent / "template"
LAW, TEST = "supported_walk.py", "test_of_law.txt"
README = (
    "- `{stem}.py`: a controller for `hexapod`; `hexapod compare walk_flat --control kinematic "
    "--control {stem}.py:{kind}` compares it with kinematic control, `pytest test_{stem}.py` tests "
    "it.\n"
)
NAME = re.compile(r"[^\W\d]\w*")


def write_law(name: str, folder: Path) -> list[Path]:
    """Writes NAME.py and test_NAME.py into a folder and adds a line to its README.md.

    Returns the files. Raises HexapodError for a name that no Python module can have and when one
    of the two files is there already; then nothing is written.
    """
    if not NAME.fullmatch(name) or keyword.iskeyword(name.lower()) or not name.isascii():
        raise HexapodError(
            "not a name of a controller",
            got=name,
            expected="letters, digits and underscores, and no word of the language such as class",
            fix="write hexapod controller new my_walk",
        )
    stem, kind = module_name(name), class_name(name)
    law, test, readme = folder / f"{stem}.py", folder / f"test_{stem}.py", folder / "README.md"
    for path in (law, test):
        if path.exists():
            raise HexapodError(
                "the file is there already",
                got=str(path),
                expected="a new file",
                fix="choose another name, or another folder with -o",
            )
    folder.mkdir(parents=True, exist_ok=True)
    words = {"@CLASS@": kind, "@STEM@": stem, "@FILE@": test.name, "SupportedWalk": kind}
    write_text(law, _filled(LAW, words))
    write_text(test, _filled(TEST, words))
    before = readme.read_text(encoding="utf-8") if readme.is_file() else ""
    gap = "\n" if before and not before.endswith("\n") else ""
    write_text(readme, f"{before}{gap}{README.format(stem=stem, kind=kind)}")
    return [law, test, readme]


def module_name(name: str) -> str:
    """Returns the name of a controller's file without ".py": my_walk for MyWalk and my_walk."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()


def class_name(name: str) -> str:
    """Returns the name of a controller's class: MyWalk for MyWalk and my_walk."""
    return "".join(part[:1].upper() + part[1:] for part in name.split("_"))


def _filled(template: str, words: dict[str, str]) -> str:
    """Returns the text of a template with its words replaced."""
    text = (TEMPLATE / template).read_text(encoding="utf-8")
    for word, value in words.items():
        text = text.replace(word, value)
    return text
