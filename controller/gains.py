"""Defines the parts of the controller and the gains of each: the one table of them.

A part of the controller is a switch of `Parts`; its gains are a section of `Gains`. The variables
of the controller's FMU, its structures in C and the keys of scenarios and of gains files follow
from the rows here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Annotated, Any

from hexapod_cosim.models import HexapodError, Robot
from hexapod_cosim.models.schema import Flag, Number, Text, Texts

Switch = Annotated[bool, Flag()]
Real = Annotated[float, Number("SI unit")]
NotNegative = Annotated[float, Number("SI unit", at_least=0.0)]
Positive = Annotated[float, Number("SI unit", above=0.0)]
TRIPOD_LEGS = 3  # legs that share the weight in a tripod gait: the unit of load is weight / 3
LEAST = 1e-9  # SI unit    smallest value of a parameter that must be positive
# nominal and largest values of the parameters of the FMU, by unit
USUAL = {
    **{"1": (0.1, 10.0), "m": (0.01, 10.0), "rad": (0.01, 10.0), "s": (0.01, 1e6)},
    **{"m/s": (0.01, 1e6), "rad/s": (0.01, 1e6), "1/s": (1.0, 1e6)},
    **{"N.m": (1.0, 1e8), "N.s/m": (10.0, 1e9)},
}


class GainsError(HexapodError):
    """Gains cannot be designed, read or used."""


@dataclass(frozen=True)
class Row:
    """What the FMU says of its parameter for a switch or a number.

    unit: "" for a switch; nominal, low, most: by default those of the unit; low: 0, or LEAST of a
    positive number.
    """

    text: str
    unit: str = ""
    nominal: float | None = None
    low: float | None = None
    most: float | None = None


@dataclass(frozen=True, kw_only=True)
class Parts:
    """Switches of the parts of both force controls, and the weight of the squeeze.

    Each part can be switched by itself, so that its effect can be measured. Switches have no effect
    on kinematic control.
    """

    support: Annotated[
        Switch, Row("servo torques that carry each leg's share of weight and acceleration")
    ] = True
    paper_share: Annotated[Switch, Row("a share of the deviations of the feet is taken back")] = (
        True
    )
    paper_pid: Annotated[
        Switch,
        Row("feet yield to the forces that make them slip, and return to their planned places"),
    ] = True
    paper_suspension: Annotated[
        Switch,
        Row("a foot yields where it meets the ground early and extends where it meets it late"),
    ] = True
    touchdown: Annotated[Switch, Row("early and late touch-downs are answered")] = True
    posture: Annotated[Switch, Row("roll, pitch and height are held")] = True
    sway: Annotated[Switch, Row("under a payload the torso moves against the swinging legs")] = True
    path: Annotated[
        Switch, Row("the walked way is measured at the feet and held to the command")
    ] = True
    limits: Annotated[Switch, Row("torques are limited")] = True
    fallback: Annotated[
        Switch,
        Row(
            "a sensor that contradicts the plan is replaced; kinematic control while the robot "
            "slides"
        ),
    ] = True
    squeeze: Annotated[
        float,
        Number("1", at_least=0.0, at_most=0.99),
        Row(
            "Weight of the servos' torques against the feet's use of friction in the planned "
            "squeeze of the legs; 0 plans none",
            "1",
            low=0.0,
            most=0.99,
        ),
    ] = 0.3


SWITCHES = tuple(item.name for item in fields(Parts) if item.name != "squeeze")


@dataclass(frozen=True, kw_only=True)
class PaperGains:
    """Corrections of the feet by the paper's control (C25, C26, C47 to C49)."""

    share: Annotated[
        NotNegative,
        Row(
            "Share of a foot's deviation along the ground under its load that the paper's control"
            " takes back, at duty 1/2",
            "1",
        ),
    ]
    height_share: Annotated[
        NotNegative,
        Row("Share of the deviation upwards that the paper's control takes back, at duty 1/2", "1"),
    ]
    share_limit: Annotated[NotNegative, Row("Largest share at any duty", "1")]
    yield_share: Annotated[
        NotNegative,
        Row(
            "Yield of the paper's control to the force that makes a foot slip, over the softness "
            "of the leg",
            "1",
            low=-10.0,
        ),
    ]
    return_rate: Annotated[
        NotNegative,
        Row(
            "Rate at which the paper's control returns the standing feet to their planned places",
            "1/s",
        ),
    ]
    filter_time: Annotated[Positive, Row("Smoothing of the forces of the paper's control", "s")]
    damping: Annotated[
        Positive, Row("Damping of the suspension of the paper's control, per foot", "N.s/m")
    ]
    return_time: Annotated[
        Positive, Row("Time in which the suspension of a standing foot returns", "s", nominal=1.0)
    ]
    sag_limit: Annotated[
        NotNegative, Row("Largest lift of a foot in the air by the torso's sag", "m")
    ]
    limit: Annotated[
        Positive,
        Row("Largest deflection of the suspension and return of the feet, paper's control", "m"),
    ]

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

    handover_time: Annotated[
        Positive, Row("Time in which one set of legs hands the weight to the next", "s")
    ]
    weight_time: Annotated[
        Positive,
        Row("Smoothing of the measured weight that the plan is scaled by", "s", nominal=0.1),
    ]
    load_time: Annotated[
        Positive, Row("Smoothing of the measured loads, of the grip and of the trust", "s")
    ]


@dataclass(frozen=True, kw_only=True)
class HoldGains:
    """Slow loops: torso attitude and height over the ground, and the path walked."""

    attitude_rate: Annotated[NotNegative, Row("Integral of roll and pitch", "1/s")]
    height_rate: Annotated[NotNegative, Row("Integral of the height", "1/s")]
    ground_time: Annotated[
        Positive, Row("Smoothing of the ground's measured inclination", "s", nominal=1.0)
    ]
    angle_limit: Annotated[NotNegative, Row("Largest correction of roll and pitch", "rad")]
    height_limit: Annotated[NotNegative, Row("Largest correction of the height", "m")]
    path_rate: Annotated[
        NotNegative, Row("From way and heading lost to a change of the commanded velocity", "1/s")
    ]
    speed_limit: Annotated[
        NotNegative, Row("Largest change of the commanded velocity", "m/s", low=1e-09)
    ]
    turn_limit: Annotated[NotNegative, Row("Largest change of the commanded yaw rate", "rad/s")]


@dataclass(frozen=True, kw_only=True)
class LimitGains:
    """Limits of what compliant control adds to the commands."""

    torque: Annotated[Positive, Row("Largest feed-forward torque", "N.m")]


@dataclass(frozen=True, kw_only=True)
class Requirements:
    """Requirements of a design. The defaults suit legs of 0.22 to 0.44 m; for others: size.py."""

    # deg    of the paper's control, at least; no loop with a crossing has 180
    phase_margin: Annotated[float, Number("deg", above=0.0, below=180.0)] = 60.0
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
    # stances that are left out, and why; what was not reached
    caveats: Annotated[tuple[str, ...], Texts()] = ()

    def as_facts(self) -> dict[str, Any]:
        """Returns the gains as nested dictionaries, as dataclasses.asdict() does in more time."""
        return {
            name: dict(vars(value)) if name in SECTIONS else value
            for name, value in vars(self).items()
        }

    def warnings(self, robot: Robot, *, period: float) -> tuple[str, ...]:
        """Returns why these gains are not for this robot and period [s], and the caveats."""
        other: tuple[str, ...] = ()
        if self.robot_hash != robot.hash:
            designed, present = self.robot_hash[:12], robot.hash[:12]
            other = (
                f"the gains were designed for robot {self.robot!r} ({designed}), "
                f"not for {robot.name!r} ({present})",
            )
        elif not math.isclose(self.period, period, rel_tol=1e-9):
            other = (f"the gains were designed for a period of {self.period} s, not {period} s",)
        return other + self.caveats


SECTIONS: dict[str, type[Any]] = {
    "requirements": Requirements,
    "support": SupportGains,
    "hold": HoldGains,
    "limits": LimitGains,
    "paper": PaperGains,
    "margins": Margins,
}
