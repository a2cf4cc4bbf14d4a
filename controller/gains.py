"""Gains of the compliant control: what the two laws run with, and what they were designed for. Kept in a TOML file."""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, TypeVar

from hexapod_cosim.models import HexapodError, Robot, nearest_name

FORMAT = 1
TRIPOD_LEGS = 3  # legs that share the weight in the hardest gait: loads are counted in weight / 3


class GainsError(HexapodError):
    """Gains that cannot be read, or cannot be used."""


@dataclass(frozen=True, kw_only=True)
class SlipGains:
    """PID from tangential force [N] to foot shift [m] of a leg under a third of the weight.

    In continuous time: (kp + ki/s + kd s/(derivative_time s + 1)) / (filter_time s + 1).
    """

    kp: float  # m/N
    ki: float  # m/(N s)
    kd: float  # m s/N
    derivative_time: float  # s    filter of the derivative, > 0
    filter_time: float  # s    force filter, > 0
    load_time: float  # s    smoothing of the planned load that the shift goes with, > 0
    tracking_time: float  # s    anti-windup: the integral gives way to the clamp this fast
    limit: float  # m    largest foot shift


@dataclass(frozen=True, kw_only=True)
class SuspensionGains:
    """Virtual m z'' + b z' + k z = f_n - preload x (leg's share of the weight); z lifts the foot towards the torso."""

    mass: float  # kg
    damping: float  # N s/m
    stiffness: float  # N/m
    preload: float  # 1    1: at rest under the leg's share of the weight the deflection is 0; more: the leg is held longer
    limit: float  # m    largest deflection


@dataclass(frozen=True, kw_only=True)
class Requirements:
    """What a design must meet."""

    phase_margin: float = 60.0  # deg    at least, both loops, at every load
    gain_margin: float = 8.0  # dB    at least, the same
    delay_periods: float = 1.0  # 1    computing delay in controller periods
    filter_time: float = 0.010  # s    force filter of the tangential loop
    load_time: float = 0.030  # s    smoothing of the planned load: the time in which legs really hand over the weight
    shift_limit: float = 0.020  # m    clamp of the tangential correction
    deflection: float = 0.003  # m    of the suspension under one leg's share of the weight
    frequency: float = 5.0  # Hz    natural frequency of the suspension
    damping_ratio: float = 1.0  # 1
    sag_compensation: float = 1.0  # 1    share of the servos' sag under the weight that the preload makes good
    deflection_limit: float = 0.015  # m    clamp of the suspension


@dataclass(frozen=True, kw_only=True)
class Margins:
    """What a design reached: the worst over the legs, directions and loads, in discrete time."""

    slip_crossover: float  # rad/s    at the stiffest leg under its share of the weight
    slip_phase_margin: float  # deg
    slip_gain_margin: float  # dB
    slip_rejection: float  # 1    steady slip speed with the law over without it
    suspension_phase_margin: float  # deg
    suspension_gain_margin: float  # dB


@dataclass(frozen=True, kw_only=True)
class Gains:
    """A designed set; `robot_hash` and `period` say what it is for."""

    robot: str
    robot_hash: str
    period: float  # s
    requirements: Requirements
    slip: SlipGains
    suspension: SuspensionGains
    margins: Margins

    def mismatch(self, robot: Robot, *, period: float) -> str | None:
        """Why these gains are not for this robot and period; None when they are."""
        if self.robot_hash != robot.hash:
            return f"the gains were designed for robot {self.robot!r} ({self.robot_hash[:12]}), not for {robot.name!r} ({robot.hash[:12]})"
        if not math.isclose(self.period, period, rel_tol=1e-9):
            return f"the gains were designed for a period of {self.period} s, not {period} s"
        return None


PARTS: dict[str, type[Any]] = {"requirements": Requirements, "slip": SlipGains, "suspension": SuspensionGains, "margins": Margins}
POSITIVE = {
    "slip": ("derivative_time", "filter_time", "load_time", "tracking_time", "limit"),
    "suspension": ("mass", "damping", "stiffness", "limit"),
    "requirements": ("phase_margin", "filter_time", "load_time", "deflection", "frequency", "damping_ratio"),
    "margins": (),
}
Record = TypeVar("Record")


def save_gains(gains: Gains, path: str | Path) -> Path:
    """Writes a gains file (TOML, floats to the last bit). Raises GainsError when the file cannot be written."""
    head = {"format": FORMAT, "robot": gains.robot, "robot_hash": gains.robot_hash, "period": gains.period}
    lines = ["# Gains of the compliant control, SI units; made by `hexapod design`."]
    lines += _toml_lines(head)
    for part in PARTS:
        lines += ["", f"[{part}]", *_toml_lines(asdict(getattr(gains, part)))]
    target = Path(path)
    partial = target.with_name(target.name + ".partial")
    try:
        partial.write_text("\n".join(lines) + "\n", encoding="utf-8")
        partial.replace(target)
    except OSError as error:
        raise GainsError("cannot write the gains file", got=error.strerror, fix="choose a writable folder", where=str(target)) from error
    return target


def _toml_lines(table: Mapping[str, Any]) -> list[str]:
    # a JSON text is a TOML text too; repr gives floats to the last bit, and TOML knows its inf
    return [f"{key} = {json.dumps(value) if isinstance(value, str) else repr(value)}" for key, value in table.items()]


def load_gains(path: str | Path) -> Gains:
    """Reads and checks a gains file. Raises GainsError: the file, the key, what was got and expected."""
    where = str(path)
    try:
        table = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise GainsError("cannot read the gains file", got=error.strerror, fix="make one with `hexapod design`", where=where) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise GainsError("not a TOML file", got=str(error), expected="TOML 1.0", fix="correct that line", where=where) from error
    if table.pop("format", None) != FORMAT:
        raise GainsError(
            "unknown format of gains", expected=f"format = {FORMAT}", fix="make the file again with `hexapod design`", where=where
        )
    parts = {name: _read_part(kind, name, table.pop(name, None), where) for name, kind in PARTS.items()}
    for key in ("robot", "robot_hash"):
        if not isinstance(table.get(key), str):
            raise GainsError("wrong type", got=table.get(key), expected="a text", fix=f"add {key}", where=f"{where}: {key}")
    period = _number(table.get("period"), f"{where}: period", positive=True)
    _refuse_unknown(table, ["robot", "robot_hash", "period"], where)
    return Gains(robot=table["robot"], robot_hash=table["robot_hash"], period=period, **parts)


def _read_part(kind: type[Record], name: str, table: Any, where: str) -> Record:
    if not isinstance(table, dict):
        raise GainsError("missing section", expected=f"a table [{name}]", fix=f"add [{name}]", where=where)
    keys = [entry.name for entry in fields(kind)]  # type: ignore[arg-type]
    _refuse_unknown(table, keys, f"{where}: {name}")
    values = {key: _number(table.get(key), f"{where}: {name}.{key}", positive=key in POSITIVE[name]) for key in keys}
    return kind(**values)


def _number(value: Any, where: str, *, positive: bool) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or math.isnan(value):
        raise GainsError("wrong type", got=value, expected="a number", fix="give a number in SI units", where=where)
    if positive and not 0.0 < value < math.inf:
        raise GainsError("impossible value", got=value, expected="a finite number > 0", fix="correct it", where=where)
    return float(value)


def _refuse_unknown(table: dict[str, Any], known: list[str], where: str) -> None:
    for key in table:
        if key not in known:
            near = nearest_name(key, known)
            fix = f"did you mean {near!r}?" if near else "remove it"
            raise GainsError("unknown key", got=key, expected="one of " + ", ".join(known), fix=fix, where=where)
