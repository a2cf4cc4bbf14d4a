"""How this package is installed: from a clone or from a wheel file, since no package index has
it.
"""

from __future__ import annotations


def install_extra(extra: str) -> str:
    """What to do to have what one of the extras of pyproject.toml brings, as an imperative for
    messages.
    """
    return (
        f"in the clone run `.venv/bin/python -m pip install -e '.[{extra}]'`, "
        f"or install the wheel with it: `python -m pip install 'WHEEL.whl[{extra}]'`"
    )
