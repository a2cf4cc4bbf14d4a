"""The content of a scenario as frozen records: fields with units, ranges and defaults."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Annotated, Any

from hexapod_cosim.controller import DEFAULT_PERIOD, Parts
from hexapod_cosim.cosim.common.installation import has_pyarrow
from hexapod_cosim.models import (
    JOINT_NAMES,
    LEG_NAMES,
    Baumgarte,
    BodyContact,
    Contact,
    Friction,
    Gait,
    Servo,
    Soil,
    Solver,
    Terrain,
)
from hexapod_cosim.models.schema import Choice, Flag, Number, Text, Texts, Vector, Whole, specs

CONTROLS = ("kinematic", "paper", "compliant")
COMPARED = ("kinematic", "compliant")  # unless a command or a study names its controls
FAULTS = ("dead", "stuck", "nan", "late")  # of sensors
NOISY = "noisy"  # a further one of force sensors
ANGLE, ATTITUDE = "angle", "attitude"  # sensors inside the robot
SERVO_FAULTS = ("weak", "limp", "locked")
WHOLE_LEG = "all"  # joints
LOST = ("command", "step")
DELAY = Number("s", at_least=0.0, at_most=1.0)  # of late readings
FORMATS = ("parquet", "csv", "mcap")  # of recordings
SETTINGS: dict[str, type[Any]] = {
    "gait": Gait,
    "terrain": Terrain,
    "soil": Soil,
    "contact": Contact,
    "friction": Friction,
    "servo": Servo,
    "solver": Solver,
    "baumgarte": Baumgarte,
    "body": BodyContact,
}
UNUSED = {"gait": ("stride",)}  # keys of robot files that scenarios replace by the body command
GRAVITY = Number("m/s2", above=0.0)  # along -z; or three numbers, a vector in world axes
GRAVITY_VECTOR = Vector("m/s2", 3)
GRAVITY_NAMES = ("gravity[1]", "gravity[2]", "gravity[3]")  # the FMU's parameters
ZERO = (0.0, 0.0, 0.0)
ALL_PARTS = Parts()
MAX_STEPS = 1_000_000  # a row of the recording is about 3 kB, and all rows are in memory


@dataclass(frozen=True, kw_only=True)
class Command:
    """A body command that holds from `time` on [s from the start of the run]."""

    time: Annotated[float, Number("s", at_least=0.0)] = 0.0
    vx: Annotated[float, Number("m/s")] = 0.0
    vy: Annotated[float, Number("m/s")] = 0.0
    yaw_rate: Annotated[float, Number("rad/s")] = 0.0
    height: Annotated[float, Number("m")] = 0.0
    roll: Annotated[float, Number("rad")] = 0.0
    pitch: Annotated[float, Number("rad")] = 0.0


@dataclass(frozen=True, kw_only=True)
class Push:
    """A force and torque on the torso, world axes, from `time` [s from the start of the run] on."""

    time: Annotated[float, Number("s", at_least=0.0)]
    duration: Annotated[float, Number("s", above=0.0)]
    force: Annotated[tuple[float, ...], Vector("N", 3)] = ZERO
    torque: Annotated[tuple[float, ...], Vector("N m", 3)] = ZERO


@dataclass(frozen=True, kw_only=True)
class Fault:
    """A fault of a foot's force sensor from `time` [s from the start of the run].

    A dead sensor reads zero, a stuck one repeats its last reading, and nan is no number. A late one
    reads what it should have read `delay` earlier, rounded up to whole macro-steps, or else at the
    start of the run. A noisy one has this noise: a standard deviation, as a share of the force.
    """

    time: Annotated[float, Number("s", at_least=0.0)]
    leg: Annotated[str, Choice(LEG_NAMES)]
    fault: Annotated[str, Choice((*FAULTS, NOISY))]
    delay: Annotated[float, DELAY] = 0.0
    noise: Annotated[float, Number("1", at_least=0.0)] = 0.1
    duration: Annotated[float, Number("s", above=0.0)] = math.inf


@dataclass(frozen=True, kw_only=True)
class AngleFault:
    """A fault of a joint's sensor, which gives angle and speed, as a `Fault`. The joint itself
    moves as before.
    """

    time: Annotated[float, Number("s", at_least=0.0)]
    leg: Annotated[str, Choice(LEG_NAMES)]
    joint: Annotated[str, Choice(JOINT_NAMES)]
    sensor: Annotated[str, Choice((ANGLE,))]
    fault: Annotated[str, Choice(FAULTS)]
    delay: Annotated[float, DELAY] = 0.0
    duration: Annotated[float, Number("s", above=0.0)] = math.inf


@dataclass(frozen=True, kw_only=True)
class AttitudeFault:
    """A fault of the torso's sensor of attitude and rotation rate, as a `Fault`. A dead one reads
    the level attitude with yaw 0, at rest.
    """

    time: Annotated[float, Number("s", at_least=0.0)]
    sensor: Annotated[str, Choice((ATTITUDE,))]
    fault: Annotated[str, Choice(FAULTS)]
    delay: Annotated[float, DELAY] = 0.0
    duration: Annotated[float, Number("s", above=0.0)] = math.inf


@dataclass(frozen=True, kw_only=True)
class ServoFault:
    """A fault of a joint's servo from `time` [s from the start of the run].

    A weak servo gives a share of its largest torque, a limp one none; a locked joint stays at the
    angle that it has when the fault begins (the plant's inputs `weakness` and `lock`).
    """

    time: Annotated[float, Number("s", at_least=0.0)]
    leg: Annotated[str, Choice(LEG_NAMES)]
    joint: Annotated[str, Choice((*JOINT_NAMES, WHOLE_LEG))]
    fault: Annotated[str, Choice(SERVO_FAULTS)]
    share: Annotated[float, Number("1", at_least=0.0, at_most=1.0)] = 0.5  # of a weak one
    duration: Annotated[float, Number("s", above=0.0)] = math.inf


@dataclass(frozen=True, kw_only=True)
class Lost:
    """Lost joint commands or dropped macro-steps from `time` [s from the start of the run].

    Where commands are lost, the controller is called, but the servos keep the last command that
    arrived. Where a whole macro-step is dropped, the readings do not arrive either: the controller
    is called with the last ones, because its time goes on. The first macro-step cannot be lost.
    """

    time: Annotated[float, Number("s", above=0.0)]
    duration: Annotated[float, Number("s", above=0.0)]
    lost: Annotated[str, Choice(LOST)]


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """A tunable parameter of the plant FMU that has a new value from `time` [s from the start]."""

    time: Annotated[float, Number("s", at_least=0.0)]
    parameter: Annotated[str, Text()]
    value: Annotated[float, Number("")]


SensorFault = Fault | AngleFault | AttitudeFault
Event = Push | SensorFault | ServoFault | Lost | Tuning


@dataclass(frozen=True, kw_only=True)
class Sensors:
    """Errors of all feet's force sensors, and so of the contacts derived from them."""

    # standard deviation of the noise, as a share of the force
    foot_force_noise: Annotated[float, Number("1", at_least=0.0, below=1.0)] = 0.0
    # delay, rounded up to whole macro-steps
    foot_force_delay: Annotated[float, Number("s", at_least=0.0, at_most=1.0)] = 0.0


@dataclass(frozen=True, kw_only=True)
class Variation:
    """Sizes of small random changes to a run, drawn from its seed.

    They show how far runs lie apart that are meant to be the same.
    """

    # standard deviation, per axis, of the torso's attitude at the start
    attitude: Annotated[float, Number("rad", at_least=0.0, at_most=0.5)] = 0.0
    # largest height from which the robot drops, uniform from 0
    height: Annotated[float, Number("m", at_least=0.0, at_most=0.1)] = 0.0
    # standard deviation of the joint angles at the start
    joint_angle: Annotated[float, Number("rad", at_least=0.0, at_most=0.5)] = 0.0
    # largest delay of all commands, uniform from 0
    command_delay: Annotated[float, Number("s", at_least=0.0)] = 0.0


OWN, DESIGNED, CHOSEN = "own", "designed", "chosen"
STANCES = (OWN, DESIGNED, CHOSEN)  # or two lengths
STANCE_CHANGE = Vector("m", 2)
WALK_KEYS = ("stance",)


def default_formats() -> tuple[str, ...]:
    """Returns the formats of recordings: CSV, and Parquet if the extra `parquet` is installed."""
    return ("parquet", "csv") if has_pyarrow() else ("csv",)


@dataclass(frozen=True, kw_only=True)
class Outputs:
    """Which files and columns a run writes."""

    # patterns of variable names, for the columns of results.csv; Parquet has all columns
    csv: Annotated[tuple[str, ...], Texts()] = ("*",)
    formats: Annotated[tuple[str, ...], Texts(FORMATS)] = field(default_factory=default_formats)
    plots: Annotated[bool, Flag()] = True
    # time between two rows of the recording; 0: every macro-step. Metrics use all macro-steps
    interval: Annotated[float, Number("s", at_least=0.0)] = 0.0


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """One run. It is complete but for the robot file that it names."""

    title: Annotated[str, Text()] = "walk"
    robot: Annotated[str, Text()] = "athena"  # a name of `hexapod list robots`, or a path
    # text of a control: a name of CONTROLS, law.py:Class or controller.fmu, see controls.py
    control: str = "kinematic"
    # the other keys of a table [control]: parameters of the user's law or FMU
    control_settings: Mapping[str, Any] = field(default_factory=dict)
    start: Annotated[float, Number("s")] = 0.0
    duration: Annotated[float, Number("s", above=0.0)] = 10.0
    macro_step: Annotated[float, Number("s", above=0.0, at_most=0.1)] = DEFAULT_PERIOD
    seed: Annotated[int, Whole()] = 0
    gravity: tuple[float, float, float] | None = None  # m/s2    None: the robot's own
    # OWN: of the robot file. DESIGNED: that of least heat for the gait. CHOSEN: that of compliant
    # control, with its gait unless [gait] names one. Two lengths: by which the feet stand further
    # out from the hips, and deeper below them [m]. None: not named
    stance: str | tuple[float, float] | None = None  # key of [walk]
    settings: Mapping[str, Mapping[str, Any]]  # differences from the robot file, by section
    commands: tuple[Command, ...]  # in order of time
    events: tuple[Event, ...] = ()
    sensors: Sensors = Sensors()
    compliance: Parts = ALL_PARTS  # active parts of the compliant control
    # gains that replace designed ones, by part and name, as in a gains file
    gains: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    variation: Variation | None = None  # None: the file has no such section
    outputs: Outputs = Outputs()
    parameters: Mapping[str, Any]  # further FMU parameters by name
    where: str = "scenario"

    @property
    def steps(self) -> int:
        """Number of macro-steps."""
        return round(self.duration / self.macro_step)

    @property
    def every(self) -> int:
        """Macro-steps from one row of the recording to the next."""
        return max(round(self.outputs.interval / self.macro_step), 1)

    @property
    def names_walk(self) -> bool:
        """Whether the scenario names a gait, its timing or a stance; else the control chooses."""
        timing = {"name", "period", "duty"} & set(self.settings.get("gait", {}))
        return bool(timing) or self.stance is not None

    @property
    def pushes(self) -> tuple[Push, ...]:
        """The events that are pushes."""
        return tuple(event for event in self.events if isinstance(event, Push))

    @property
    def faults(self) -> tuple[Fault, ...]:
        """The events that are faults of force sensors."""
        return tuple(event for event in self.events if isinstance(event, Fault))

    @property
    def angle_faults(self) -> tuple[AngleFault, ...]:
        """The events that are faults of joint sensors."""
        return tuple(event for event in self.events if isinstance(event, AngleFault))

    @property
    def attitude_faults(self) -> tuple[AttitudeFault, ...]:
        """The events that are faults of the attitude sensor."""
        return tuple(event for event in self.events if isinstance(event, AttitudeFault))

    @property
    def servo_faults(self) -> tuple[ServoFault, ...]:
        """The events that are faults of servos."""
        return tuple(event for event in self.events if isinstance(event, ServoFault))

    @property
    def tunings(self) -> tuple[Tuning, ...]:
        """The events that change parameters, in order of time."""
        found = [event for event in self.events if isinstance(event, Tuning)]
        return tuple(sorted(found, key=lambda event: event.time))

    @property
    def lost(self) -> tuple[Lost, ...]:
        """The events that are lost commands or dropped macro-steps."""
        return tuple(event for event in self.events if isinstance(event, Lost))

    def to_table(self) -> dict[str, Any]:
        """Returns the scenario as the tables of an equivalent scenario file."""
        names = [item.name for item in fields(self)]
        plain = {key: getattr(self, key) for key in names if key in ("control", *PLAIN_KEYS)}
        plain |= {} if self.gravity is None else {"gravity": list(self.gravity)}
        tables = {key: dict(value) for key, value in self.settings.items() if value}
        if self.stance is not None:
            named = self.stance
            tables["walk"] = {"stance": named if isinstance(named, str) else list(named)}
        if self.control_settings:  # a table, which stands behind the plain keys
            tables["control"] = {"law": plain.pop("control"), **self.control_settings}
        lists = {
            "command": [_as_table(entry) for entry in self.commands],
            "events": [_as_table(entry) for entry in self.events],
        }
        tail = {"sensors": _as_table(self.sensors), "compliance": _as_table(self.compliance)}
        tail |= {"gains": {part: dict(values) for part, values in self.gains.items()}}
        tail |= {"variation": {} if self.variation is None else _as_table(self.variation)}
        tail |= {"outputs": _as_table(self.outputs), "parameters": dict(self.parameters)}
        return (
            plain
            | tables
            | {key: value for key, value in lists.items() if value}
            | {key: value for key, value in tail.items() if value}
        )


PLAIN_KEYS = tuple(specs(Scenario))  # title, robot, start, duration, macro_step, seed
SECTIONS = (
    *(
        "command",
        "control",
        "walk",
        "sensors",
        "compliance",
        "gains",
        "variation",
        "outputs",
        "parameters",
    ),
    *SETTINGS,
)
KEYS = (*PLAIN_KEYS, "gravity", "events", *SECTIONS)


UNUSED_SETTINGS = (("delay", 0.0), ("noise", 0.1), ("share", 0.5))


def _as_table(record: Any) -> dict[str, Any]:
    """Returns the fields of a record, without an infinite duration and unused settings of faults,
    which files omit.
    """
    table = {item.name: getattr(record, item.name) for item in fields(record)}
    return {
        key: value
        for key, value in table.items()
        if value != math.inf and (key, value) not in UNUSED_SETTINGS
    }
