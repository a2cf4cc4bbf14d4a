"""A robot written for other tools: as a URDF, as a MuJoCo model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from hexapod_cosim.cosim.common.files import not_writable, write_text
from hexapod_cosim.models import HexapodError, Robot
from hexapod_cosim.models.mjcf import robot_to_mjcf
from hexapod_cosim.models.urdf.writer import robot_to_urdf


@dataclass(frozen=True)
class Format:
    """A way to describe a robot."""

    name: str
    title: str
    suffix: str
    write: Callable[[Robot], str]


FORMATS = {
    "urdf": Format("urdf", "a URDF", ".urdf", robot_to_urdf),
    "mjcf": Format("mjcf", "an MJCF file", ".xml", robot_to_mjcf),
}


def chosen_format(path: Path | None, *, urdf: bool, mjcf: bool) -> Format | None:
    """The format that is asked for, by name or by the suffix of the file; None for an FMU.
    Raises HexapodError for two.
    """
    if urdf and mjcf:
        raise HexapodError(
            "two formats at once",
            got="--urdf --mjcf",
            expected="one of them",
            fix="run the command twice",
        )
    if urdf or mjcf:
        return FORMATS["urdf" if urdf else "mjcf"]
    return next(
        (form for form in FORMATS.values() if path is not None and path.suffix == form.suffix), None
    )


def export_description(robot: Robot, path: str | Path, form: Format) -> Path:
    """Writes a robot's file and returns its path; it appears whole or not at all. Raises
    HexapodError.
    """
    path = Path(path)
    if path.suffix != form.suffix:
        expected = f"a name that ends in {form.suffix}"
        raise HexapodError(
            f"not {form.title}'s name",
            got=path.name,
            expected=expected,
            fix=f"write -o {path.with_suffix(form.suffix)}",
        )
    text = form.write(robot)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise not_writable(path, error) from error
    write_text(path, text)
    return path
