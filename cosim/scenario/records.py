"""The content of a scenario as frozen records: fields with units, ranges and defaults."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Annotated, Any, TypeVar

from hexapod_cosim.controller import DEFAULT_PERIOD, Parts
from hexapod_cosim.cosim.common.installation import has_pyarrow
from hexapod_cosim.cosim.scenario.events import Event
from hexapod_cosim.models import (
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
from hexapod_cosim.models.schema import Flag, Number, Text, Texts, Vector, Whole, specs

CONTROLS = ("kinematic", "paper", "compliant")
COMPARED = ("kinematic", "compliant")  # unless a command or a study names its controls
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
_Event = TypeVar("_Event", bound=Event)
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

    def events_of(self, kind: type[_Event]) -> tuple[_Event, ...]:
        """Returns the events of one kind in their order in the file."""
        return tuple(event for event in self.events if isinstance(event, kind))

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
UNUSED_SETTINGS = (("delay", 0.0), ("noise", 0.1), ("share", 0.5))  # of faults


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
