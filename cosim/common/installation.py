"""Instructions for installing this package's extras.

The package is installed from a clone or from a wheel file, since no package index has it.
"""

from __future__ import annotations

from collections.abc import Iterable
from importlib.util import find_spec
from pathlib import Path

from hexapod_cosim.models import HexapodError


def install_extra(extra: str) -> str:
    """Returns the instruction for installing an extra of pyproject.toml, for messages."""
    return (
        f"in the clone run `.venv/bin/python -m pip install -e '.[{extra}]'`, "
        f"or install the wheel with it: `python -m pip install 'WHEEL.whl[{extra}]'`"
    )


def has_pyarrow() -> bool:
    """Tells whether Parquet files can be written and read."""
    return find_spec("pyarrow") is not None


def require_pyarrow(extra: str, where: str | Path) -> None:
    """Raises HexapodError, which names an extra that brings pyarrow, where pyarrow is missing."""
    require_packages(
        ["pyarrow"],
        "Parquet files need a package that is not installed",
        expected=f"the extra `{extra}`",
        fix=install_extra(extra),
        where=where,
    )


def require_packages(
    packages: Iterable[str], what: str, *, expected: str, fix: str, where: str | Path
) -> None:
    """Raises HexapodError, which names the first of these packages that is not installed.

    Args:
        packages: names of the modules that are imported.
        what: what is wrong without them, a sentence.
        expected: what has to be installed.
        fix: how it is installed.
        where: the file, option or command that needs them.
    """
    for name in packages:
        if find_spec(name) is None:
            raise HexapodError(what, got=f"no {name}", expected=expected, fix=fix, where=str(where))
