"""Defines the gains of compliant control, their requirements and margins, and their TOML file."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, TypeVar

from hexapod_cosim.models import HexapodError, Robot, nearest_name
from hexapod_cosim.models.errors import refuse_path
from hexapod_cosim.models.files import read_text
from hexapod_cosim.models.schema import decoding_toml, parse_toml

FORMAT = 5
TRIPOD_LEGS = 3  # legs that share the weight in a tripod gait: the unit of load is weight / 3


class GainsError(HexapodError):
    """Gains cannot be designed, read or used."""


@dataclass(frozen=True, kw_only=True)
class PaperGains:
    """Corrections of the feet by the paper's control (C25, C26, C47 to C49)."""

    share: float  # 1    of the deviation along the ground that is taken back, at duty 1/2
    height_share: float  # 1    the same of the deviation upwards
    share_limit: float  # 1    largest share at any duty
    yield_share: float  # 1    P part: yield to a force over the softness of the leg
    return_rate: float  # 1/s    I part: return of all feet
    filter_time: float  # s    smoothing of the measured forces, > 0
    damping: float  # N s/m    of the suspension, > 0
    return_time: float  # s    of the suspension of a standing foot, > 0
    sag_limit: float  # m    largest lift of a foot in the air by the torso's sag
    limit: float  # m    largest deflection of the suspension and return of the feet, > 0

    def shares(self, duty: float) -> tuple[float, float]:
        """Returns the shares along the ground and upwards of a gait with this duty factor [1].

        The torque that a share costs grows with the square of the load, W/(6 duty) on average.
        """
        factor = (2.0 * duty) ** 2
        return (
            min(factor * self.share, self.share_limit),
            min(factor * self.height_share, self.share_limit),
        )


@dataclass(frozen=True, kw_only=True)
class SupportGains:
    """Feed-forward of the planned load."""

    handover_time: float  # s    duration of the change of load between two sets of legs, > 0
    weight_time: float  # s    smoothing of the measured weight that the plan is scaled by, > 0
    load_time: float  # s    smoothing of the measured loads, grip and trust, > 0


@dataclass(frozen=True, kw_only=True)
class HoldGains:
    """Slow loops: torso attitude and height over the ground, and the path walked."""

    attitude_rate: float  # 1/s    integral of roll and pitch
    height_rate: float  # 1/s    integral of the height
    ground_time: float  # s    smoothing of the ground's measured inclination, > 0
    angle_limit: float  # rad    largest correction of roll and pitch
    height_limit: float  # m    largest correction of the height
    path_rate: float  # 1/s    gain from deviations of the path to the added velocity
    speed_limit: float  # m/s    largest added velocity
    turn_limit: float  # rad/s    largest added yaw rate


@dataclass(frozen=True, kw_only=True)
class LimitGains:
    """Limits of what compliant control adds to the commands."""

    torque: float  # N m    largest feed-forward torque


@dataclass(frozen=True, kw_only=True)
class Requirements:
    """Requirements of a design. The defaults suit legs of 0.22 to 0.44 m; for others: size.py."""

    phase_margin: float = 60.0  # deg    of the paper's control, at least
    gain_margin: float = 5.0  # dB    the same
    static_margin: float = 3.0  # dB    the same, of feet that push against each other
    delay_periods: float = 1.0  # 1    computing delay in controller periods
    force_delay: float = 0.010  # s    of the force sensors
    filter_time: float = 0.005  # s    smoothing of the forces
    share: float = 0.38  # 1    of the paper's control: of the deviations along the ground
    height_share: float = 0.5  # 1    of the deviations upwards, at most
    share_limit: float = 0.66  # 1    of both, in gaits with more standing legs
    yield_share: float = 0.3  # 1
    return_rate: float = 3.0  # 1/s
    # m/s    at which the suspension yields, at most, to a sixth of the weight beyond the share
    landing_speed: float = 0.9
    load_time: float = 0.030  # s    smoothing of the load: the time of real hand-overs
    return_time: float = 3.0  # s    of the suspension
    sag_limit: float = 0.002  # m    largest lift of feet in the air
    deflection_limit: float = 0.030  # m    largest deflection of the suspension
    handover_time: float = 0.065  # s
    weight_time: float = 0.5  # s
    attitude_rate: float = 2.0  # 1/s
    height_rate: float = 2.0  # 1/s
    ground_time: float = 2.0  # s
    angle_limit: float = 0.05  # rad
    height_limit: float = 0.010  # m
    path_rate: float = 1.0  # 1/s
    speed_limit: float = 0.02  # m/s
    turn_limit: float = 0.05  # rad/s
    torque_share: float = 0.9  # 1    of the servo's largest torque: a tripod must stand within it


@dataclass(frozen=True, kw_only=True)
class Margins:
    """Margins of a design: the worst over stances, loads and eigenvalues of the sampled loop."""

    support_torque: float  # N m    largest torque of a servo in a standing tripod
    # of the paper's control: the worst of its loops
    binding: str  # what limited the shares
    paper_phase_margin: float = math.inf  # deg
    paper_gain_margin: float = math.inf  # dB    of oscillations
    paper_static_margin: float = math.inf  # dB    of feet that push against each other, at rest
    paper_spectral_radius: float = 0.0  # 1    of its whole closed loop, < 1


@dataclass(frozen=True, kw_only=True)
class Gains:
    """A designed set of gains for the robot `robot_hash` and the controller period `period`."""

    robot: str
    robot_hash: str
    period: float  # s
    requirements: Requirements
    support: SupportGains
    hold: HoldGains
    limits: LimitGains
    paper: PaperGains
    margins: Margins
    caveats: tuple[str, ...] = ()  # stances that are left out, and why; what was not reached

    def as_facts(self) -> dict[str, Any]:
        """Returns the gains as nested dictionaries, as dataclasses.asdict() does in more time."""
        return {
            name: dict(vars(value)) if name in PARTS else value
            for name, value in vars(self).items()
        }

    def mismatch(self, robot: Robot, *, period: float) -> str | None:
        """Returns why these gains are not for this robot and period [s]; None when they are."""
        if self.robot_hash != robot.hash:
            designed, present = self.robot_hash[:12], robot.hash[:12]
            return (
                f"the gains were designed for robot {self.robot!r} ({designed}), "
                f"not for {robot.name!r} ({present})"
            )
        if not math.isclose(self.period, period, rel_tol=1e-9):
            return f"the gains were designed for a period of {self.period} s, not {period} s"
        return None


PARTS: dict[str, type[Any]] = {
    "requirements": Requirements,
    "support": SupportGains,
    "hold": HoldGains,
    "limits": LimitGains,
    "paper": PaperGains,
    "margins": Margins,
}
POSITIVE = {
    "support": ("handover_time", "weight_time", "load_time"),
    "hold": ("ground_time",),
    "limits": ("torque",),
    "paper": ("filter_time", "damping", "return_time", "limit"),
    "requirements": (
        "phase_margin",
        "filter_time",
        "load_time",
        "landing_speed",
        "return_time",
        "deflection_limit",
        "handover_time",
    ),
    "margins": (),
}
TEXTS = ("binding",)  # the rest are numbers
Record = TypeVar("Record")


def save_gains(gains: Gains, path: str | Path) -> Path:
    """Writes a gains file (TOML, floats to the last bit).

    Raises GainsError when the file cannot be written.
    """
    head = {
        "format": FORMAT,
        "robot": gains.robot,
        "robot_hash": gains.robot_hash,
        "period": gains.period,
    }
    head |= {"caveats": list(gains.caveats)} if gains.caveats else {}
    lines = ["# Gains of compliant and paper control, SI units; made by `hexapod design`."]
    lines += _toml_lines(head)
    for part in PARTS:
        lines += ["", f"[{part}]", *_toml_lines(asdict(getattr(gains, part)))]
    target = Path(path)
    partial = target.with_name(target.name + ".partial")
    try:
        partial.write_text("\n".join(lines) + "\n", encoding="utf-8")
        partial.replace(target)
    except OSError as error:
        raise GainsError(
            "cannot write the gains file",
            got=error.strerror,
            fix="choose a writable folder",
            where=str(target),
        ) from error
    return target


def _toml_lines(table: Mapping[str, Any]) -> list[str]:
    # a JSON text is a TOML text too; repr gives floats to the last bit, and TOML knows its inf
    return [
        f"{key} = {json.dumps(value) if isinstance(value, str | list) else repr(value)}"
        for key, value in table.items()
    ]


def load_gains(path: str | Path) -> Gains:
    """Reads and checks a gains file.

    Raises GainsError: the file, the key, what was got and expected.
    """
    where = str(path)
    refuse_path(path, "the gains file", GainsError)
    try:
        with decoding_toml(Path(path), kind="gains", error=GainsError):
            table = parse_toml(read_text(Path(path)))
    except OSError as error:
        raise GainsError(
            "cannot read the gains file",
            got=error.strerror,
            fix="make one with `hexapod design`",
            where=where,
        ) from error
    if table.pop("format", None) != FORMAT:
        raise GainsError(
            "unknown format of gains",
            expected=f"format = {FORMAT}",
            fix="make the file again with `hexapod design`",
            where=where,
        )
    parts = {
        name: _read_part(kind, name, table.pop(name, None), where) for name, kind in PARTS.items()
    }
    for key in ("robot", "robot_hash"):
        _text(table.get(key), f"{where}: {key}")
    period = _number(table.get("period"), f"{where}: period", positive=True)
    caveats = _texts(table.pop("caveats", []), f"{where}: caveats")
    _refuse_unknown(table, ["robot", "robot_hash", "period"], where)
    return Gains(
        robot=table["robot"],
        robot_hash=table["robot_hash"],
        period=period,
        caveats=caveats,
        **parts,
    )


def _texts(value: Any, where: str) -> tuple[str, ...]:
    if not isinstance(value, list):
        raise GainsError(
            "wrong type",
            got=value,
            expected="a list of texts",
            fix="put it in brackets",
            where=where,
        )
    return tuple(_text(entry, where) for entry in value)


def _read_part(kind: type[Record], name: str, table: Any, where: str) -> Record:
    if not isinstance(table, dict):
        raise GainsError(
            "missing section", expected=f"a table [{name}]", fix=f"add [{name}]", where=where
        )
    keys = [entry.name for entry in fields(kind)]  # type: ignore[arg-type]
    _refuse_unknown(table, keys, f"{where}: {name}")
    values = {
        key: _value(table.get(key), key, f"{where}: {name}.{key}", positive=key in POSITIVE[name])
        for key in keys
    }
    return kind(**values)


def _value(value: Any, key: str, where: str, *, positive: bool) -> Any:
    return _text(value, where) if key in TEXTS else _number(value, where, positive=positive)


def _text(value: Any, where: str) -> str:
    if not isinstance(value, str):
        raise GainsError(
            "wrong type", got=value, expected="a text", fix="put it in quotes", where=where
        )
    return value


def _number(value: Any, where: str, *, positive: bool) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or math.isnan(value):
        raise GainsError(
            "wrong type",
            got=value,
            expected="a number",
            fix="give a number in SI units",
            where=where,
        )
    if positive and not 0.0 < value < math.inf:
        raise GainsError(
            "impossible value",
            got=value,
            expected="a finite number > 0",
            fix="correct it",
            where=where,
        )
    return float(value)


def _refuse_unknown(table: dict[str, Any], known: list[str], where: str) -> None:
    for key in table:
        if key not in known:
            near = nearest_name(key, known)
            fix = f"did you mean {near!r}?" if near else "remove it"
            raise GainsError(
                "unknown key", got=key, expected="one of " + ", ".join(known), fix=fix, where=where
            )
