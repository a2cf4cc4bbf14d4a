"""Instructions for installing this package's extras.

The package is installed from a clone or from a wheel file, since no package index has it.
"""

from __future__ import annotations


def install_extra(extra: str) -> str:
    """Returns the instruction for installing an extra of pyproject.toml, for messages."""
    return (
        f"in the clone run `.venv/bin/python -m pip install -e '.[{extra}]'`, "
        f"or install the wheel with it: `python -m pip install 'WHEEL.whl[{extra}]'`"
    )
