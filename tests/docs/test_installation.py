"""How extras are installed: as pages and messages say it, from a clone or a wheel file, for no
package index has this package.
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

from hexapod_cosim.cosim.common.installation import install_extra

ROOT = Path(__file__).parents[2]
PLACES = (
    "README.md",
    ".github/CONTRIBUTING.md",
    "Makefile",
    "docs",
    "cosim",
    "controller",
    "models",
    "tools",
    "examples",
    "benchmarks",
)
KINDS = {".md", ".py", ".ipynb", ".toml", ".jinja", "", ".c", ".ts"}
FROM_AN_INDEX = re.compile(
    r"pip install (?:-\S+ )*[\"']?hexapod[-_]cosim(?!\S*\.whl)|hexapod[-_]cosim\["
)
NAMED = re.compile(r"(?:\.|\.whl)\[(\w+)\]'|install_extra\([\"'](\w+)[\"']\)")


def texts() -> dict[str, str]:
    """All pages and sources, by their path in the tree."""
    files = [
        file
        for place in PLACES
        for file in ([ROOT / place] if (ROOT / place).is_file() else (ROOT / place).rglob("*"))
    ]
    return {
        str(file.relative_to(ROOT)): file.read_text(encoding="utf-8")
        for file in files
        if file.is_file()
        and file.suffix in KINDS
        and not {"node_modules", "__pycache__"} & set(file.parts)
    }


def test_no_page_and_no_message_installs_this_package_from_an_index() -> None:
    found = texts()
    assert {"README.md", "docs/studies.md", "cosim/export/cross_build.py"} <= found.keys()
    assert not {
        file: match[0] for file, text in found.items() if (match := FROM_AN_INDEX.search(text))
    }


def test_extras_that_are_named_exist() -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"][
        "optional-dependencies"
    ]
    named = {first or second for text in texts().values() for first, second in NAMED.findall(text)}
    assert {"platforms", "cluster", "optimise"} <= named
    assert named <= extras.keys()


@pytest.mark.parametrize(
    "text",
    [
        "pip install hexapod-cosim",
        "pip install 'hexapod-cosim[platforms]'",
        "pip install --quiet hexapod_cosim",
        "`hexapod-cosim[docs]`",
    ],
)
def test_what_is_looked_for_is_found(text: str) -> None:
    assert FROM_AN_INDEX.search(text)


def test_a_message_names_the_clone_and_the_wheel() -> None:
    assert install_extra("cluster") == (
        "in the clone run `.venv/bin/python -m pip install -e '.[cluster]'`, "
        "or install the wheel with it: `python -m pip install 'WHEEL.whl[cluster]'`"
    )
