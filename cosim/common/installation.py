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
    """Returns whether Parquet files can be written and read."""
    return find_spec("pyarrow") is not None


def require_packages(packages: Iterable[str], files: str, *, extra: str, where: str | Path) -> None:
    """Raises HexapodError, which names the first of these packages that is not installed.

    files: the kind of files that need them; extra: that brings them; where: what needs the files.
    """
    for name in packages:
        if find_spec(name) is None:
            raise HexapodError(
                f"{files} files need a package that is not installed",
                got=f"no {name}",
                expected=f"the extra `{extra}`",
                fix=install_extra(extra),
                where=str(where),
            )


def require_pyarrow(extra: str, where: str | Path) -> None:
    """Raises HexapodError, which names an extra that brings pyarrow, where pyarrow is missing."""
    require_packages(["pyarrow"], "Parquet", extra=extra, where=where)
