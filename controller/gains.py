"""Defines the gains of compliant control, their requirements and margins, and their TOML file."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import MISSING, dataclass, fields
from pathlib import Path
from typing import Annotated, Any

from hexapod_cosim.models import HexapodError, Robot, RobotError
from hexapod_cosim.models.errors import refuse_path
from hexapod_cosim.models.files import read_text
from hexapod_cosim.models.schema import (
    Number,
    Text,
    decoding_toml,
    expect_table,
    parse_toml,
    read_given,
    require,
    specs,
)

FORMAT = 5
Real = Annotated[float, Number("SI unit")]
NotNegative = Annotated[float, Number("SI unit", at_least=0.0)]
Positive = Annotated[float, Number("SI unit", above=0.0)]
TRIPOD_LEGS = 3  # legs that share the weight in a tripod gait: the unit of load is weight / 3


class GainsError(HexapodError):
    """Gains cannot be designed, read or used."""


@dataclass(frozen=True, kw_only=True)
class PaperGains:
    """Corrections of the feet by the paper's control (C25, C26, C47 to C49)."""

    share: NotNegative  # 1    of the deviation along the ground that is taken back, at duty 1/2
    height_share: NotNegative  # 1    the same of the deviation upwards
    share_limit: NotNegative  # 1    largest share at any duty
    yield_share: NotNegative  # 1    P part: yield to a force over the softness of the leg
    return_rate: NotNegative  # 1/s    I part: return of all feet
    filter_time: Positive  # s    smoothing of the measured forces
    damping: Positive  # N s/m    of the suspension
    return_time: Positive  # s    of the suspension of a standing foot
    sag_limit: NotNegative  # m    largest lift of a foot in the air by the torso's sag
    limit: Positive  # m    largest deflection of the suspension and return of the feet

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

    handover_time: Positive  # s    duration of the change of load between two sets of legs
    weight_time: Positive  # s    smoothing of the measured weight that the plan is scaled by
    load_time: Positive  # s    smoothing of the measured loads, grip and trust


@dataclass(frozen=True, kw_only=True)
class HoldGains:
    """Slow loops: torso attitude and height over the ground, and the path walked."""

    attitude_rate: NotNegative  # 1/s    integral of roll and pitch
    height_rate: NotNegative  # 1/s    integral of the height
    ground_time: Positive  # s    smoothing of the ground's measured inclination
    angle_limit: NotNegative  # rad    largest correction of roll and pitch
    height_limit: NotNegative  # m    largest correction of the height
    path_rate: NotNegative  # 1/s    gain from deviations of the path to the added velocity
    speed_limit: NotNegative  # m/s    largest added velocity
    turn_limit: NotNegative  # rad/s    largest added yaw rate


@dataclass(frozen=True, kw_only=True)
class LimitGains:
    """Limits of what compliant control adds to the commands."""

    torque: Positive  # N m    largest feed-forward torque


@dataclass(frozen=True, kw_only=True)
class Requirements:
    """Requirements of a design. The defaults suit legs of 0.22 to 0.44 m; for others: size.py."""

    phase_margin: Positive = 60.0  # deg    of the paper's control, at least
    gain_margin: NotNegative = 5.0  # dB    the same
    static_margin: NotNegative = 3.0  # dB    the same, of feet that push against each other
    delay_periods: NotNegative = 1.0  # 1    computing delay in controller periods
    force_delay: NotNegative = 0.010  # s    of the force sensors
    filter_time: Positive = 0.005  # s    smoothing of the forces
    share: NotNegative = 0.38  # 1    of the paper's control: of the deviations along the ground
    height_share: NotNegative = 0.5  # 1    of the deviations upwards, at most
    share_limit: NotNegative = 0.66  # 1    of both, in gaits with more standing legs
    yield_share: NotNegative = 0.3  # 1
    return_rate: NotNegative = 3.0  # 1/s
    # m/s    at which the suspension yields, at most, to a sixth of the weight beyond the share
    landing_speed: Positive = 0.9
    load_time: Positive = 0.030  # s    smoothing of the load: the time of real hand-overs
    return_time: Positive = 3.0  # s    of the suspension
    sag_limit: NotNegative = 0.002  # m    largest lift of feet in the air
    deflection_limit: Positive = 0.030  # m    largest deflection of the suspension
    handover_time: Positive = 0.065  # s
    weight_time: NotNegative = 0.5  # s
    attitude_rate: NotNegative = 2.0  # 1/s
    height_rate: NotNegative = 2.0  # 1/s
    ground_time: NotNegative = 2.0  # s
    angle_limit: NotNegative = 0.05  # rad
    height_limit: NotNegative = 0.010  # m
    path_rate: NotNegative = 1.0  # 1/s
    speed_limit: NotNegative = 0.02  # m/s
    turn_limit: NotNegative = 0.05  # rad/s
    torque_share: NotNegative = (
        0.9  # 1    of the servo's largest torque: a tripod must stand within it
    )


@dataclass(frozen=True, kw_only=True)
class Margins:
    """Margins of a design: the worst over stances, loads and eigenvalues of the sampled loop."""

    support_torque: Real  # N m    largest torque of a servo in a standing tripod
    # of the paper's control: the worst of its loops
    binding: Annotated[str, Text()]  # what limited the shares
    paper_phase_margin: Real = math.inf  # deg
    paper_gain_margin: Real = math.inf  # dB    of oscillations
    paper_static_margin: Real = math.inf  # dB    of feet that push against each other, at rest
    paper_spectral_radius: Real = 0.0  # 1    of its whole closed loop, < 1


@dataclass(frozen=True, kw_only=True)
class Gains:
    """A designed set of gains for the robot `robot_hash` and the controller period `period`."""

    robot: Annotated[str, Text()]
    robot_hash: Annotated[str, Text()]
    period: Positive  # s
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


@contextmanager
def raising_gains_errors() -> Iterator[None]:
    """Turns the errors of checked records into GainsError."""
    try:
        yield
    except RobotError as error:
        raise GainsError(
            error.what,
            got=error.got,
            expected=error.expected,
            fix=error.fix,
            where=error.where,
        ) from error


def save_gains(gains: Gains, path: str | Path) -> Path:
    """Writes a gains file (TOML, floats to the last bit).

    Raises GainsError when the file cannot be written.
    """
    lines = ["# Gains of compliant and paper control, SI units; made by `hexapod design`."]
    lines += [f"format = {FORMAT}", *_toml_lines(gains), f"caveats = {json.dumps(gains.caveats)}"]
    for part in PARTS:
        lines += ["", f"[{part}]", *_toml_lines(getattr(gains, part))]
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


def _toml_lines(record: Any) -> list[str]:
    """Returns a line for each number and text of a record; a margin without a limit has none."""
    values = {key: getattr(record, key) for key in specs(type(record))}
    return [
        f"{key} = {json.dumps(value) if isinstance(value, str) else repr(value)}"
        for key, value in values.items()
        if value != math.inf
    ]


def load_gains(path: str | Path) -> Gains:
    """Reads and checks a gains file.

    Raises GainsError: the file, the key, what was got and expected.
    """
    refuse_path(path, "the gains file", GainsError)
    try:
        with decoding_toml(Path(path), kind="gains", error=GainsError):
            table = parse_toml(read_text(Path(path)))
    except OSError as error:
        raise GainsError(
            "cannot read the gains file",
            got=error.strerror,
            fix="make one with `hexapod design`",
            where=str(path),
        ) from error
    if table.pop("format", None) != FORMAT:
        raise GainsError(
            "unknown format of gains",
            expected=f"format = {FORMAT}",
            fix="make the file again with `hexapod design`",
            where=str(path),
        )
    with raising_gains_errors():
        return _read(table, str(path))


def _read(table: dict[str, Any], where: str) -> Gains:
    """Returns the gains of a file's tables. Raises RobotError; `where` names the file."""
    parts = {
        name: _read_record(kind, table.pop(name, None), f"{where}: [{name}]")
        for name, kind in PARTS.items()
    }
    caveats = table.pop("caveats", [])
    texts = caveats if isinstance(caveats, list) else [caveats]
    known = tuple(Text().read(text, f"{where}: caveats") for text in texts)
    head = require(Gains, read_given(Gains, table, where), where)
    return Gains(**head, **parts, caveats=known)


def _read_record(kind: type[Any], value: Any, where: str) -> Any:
    """Returns a record of a table; a margin without a limit may be absent, or infinite."""
    table = expect_table(value, where)
    given = {key: value for key, value in table.items() if value != math.inf}
    values = read_given(kind, given, where)
    usual = {item.name: item.default for item in fields(kind) if item.default is not MISSING}
    return kind(**require(kind, usual | values, where))
