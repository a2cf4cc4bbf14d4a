"""The family of walks: who walks how over what, and what the servos are told. `python -m
benchmarks.walks` writes the files.

A step size that looks good on one trajectory may be luck, so every figure is judged on all of
these: both robots, all gaits, two of each, the rest drawn once from a seeded generator. The joint
commands are the kinematic controller's, which looks at no measurement, so every engine gets the
same ones whatever its own error is.

A walk file is raw bytes, so that a driver in any language reads it without a parser:
    hxDefinition | int64 n | double h | n x hxInput (held over [k h, (k + 1) h))
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from plant import definition, inputs

from benchmarks import BUILD
from hexapod_cosim.controller import PATTERNS, BodyCommand, Controller, Gait, Measurement, make_gait
from hexapod_cosim.cosim.scenario.reach import check_commands
from hexapod_cosim.cosim.scenario.records import Command as TimedCommand
from hexapod_cosim.models import HexapodError, Robot, load_robot
from hexapod_cosim.models.dynamics import Command
from hexapod_cosim.models.statics import settled

ROBOTS = ("athena", "phantomx_mk4")
VARIANTS = 2  # of each robot and gait
SEED = 20240229
DURATION, STEP = 2.0, 0.005  # s

SPEED = (0.04, 0.16)  # m/s
TURN = 0.3  # rad/s, at most, either way; of every other walk
MU = (0.4, 0.9)
STIFFNESS = (0.3, 3.0)  # of the robot's own, drawn in the logarithm
RESTITUTION = (0.2, 0.9)

STIFF_SLOPE, STIFF_RUBBER = 1000.0, 1e7  # s/m, N/m^1.5


@dataclass(frozen=True, kw_only=True)
class Walk:
    """One member of the family."""

    name: str
    robot: Robot
    gait: Gait
    command: BodyCommand

    @property
    def steps(self) -> int:
        """Macro-steps."""
        return round(DURATION / STEP)


def family() -> list[Walk]:
    """The walks everything is measured on, always the same ones."""
    generator = np.random.default_rng(SEED)
    places = [(robot, gait, k) for k in range(VARIANTS) for gait in PATTERNS for robot in ROBOTS]
    return [_drawn(generator, *place) for place in places]


def stiff(walk: Walk, *, slope: float | None = None, stiffness: float | None = None) -> Walk:
    """The same walk with a steeper friction law [s/m] or a harder foot [N/m^1.5], named after
    the change.
    """
    robot, name = walk.robot, walk.name
    if slope is not None:
        robot, name = (
            replace(robot, friction=replace(robot.friction, slope=slope)),
            f"{name}-slope{slope:g}",
        )
    if stiffness is not None:
        robot, name = (
            replace(robot, contact=replace(robot.contact, stiffness=stiffness)),
            f"{name}-stiff{stiffness:g}",
        )
    return replace(walk, name=name, robot=robot)


def _drawn(generator: np.random.Generator, robot_name: str, gait_name: str, k: int) -> Walk:
    """One walk; what the legs cannot reach is drawn again."""
    robot = load_robot(robot_name)
    gait = make_gait(robot, gait_name)
    while True:
        turn = generator.uniform(-TURN, TURN) * (k % 2)
        command = BodyCommand(vx=generator.uniform(*SPEED), yaw_rate=turn)
        if _reachable(command, robot, gait):
            break
    stiffness = robot.contact.stiffness * float(np.exp(generator.uniform(*np.log(STIFFNESS))))
    contact = replace(
        robot.contact, stiffness=stiffness, restitution=generator.uniform(*RESTITUTION)
    )
    friction = replace(robot.friction, mu=generator.uniform(*MU))
    name = f"{robot_name}-{gait_name}-{k}"
    return Walk(
        name=name,
        robot=replace(robot, contact=contact, friction=friction),
        gait=gait,
        command=command,
    )


def _reachable(command: BodyCommand, robot: Robot, gait: Gait) -> bool:
    try:
        check_commands([TimedCommand(**asdict(command))], robot, gait, where="benchmark")
    except HexapodError:
        return False
    return True


def commands(walk: Walk) -> Iterator[Command]:
    """What the servos are told at k h, without feedback."""
    controller, nothing = Controller(walk.robot, period=STEP, gait=walk.gait), Measurement()
    for k in range(walk.steps):
        told = controller.step(k * STEP, walk.command, nothing)
        yield Command(
            angle_ref=told.angle_ref, speed_ref=told.speed_ref, torque_ref=told.torque_ref
        )


def start(walk: Walk) -> Any:
    """The hxDefinition: the robot at rest on the ground, in its stance."""
    position, quaternion, angle = settled(walk.robot)
    return definition(walk.robot, position=position, quaternion=quaternion, angle=angle)


def file_bytes(walk: Walk) -> bytes:
    """The walk as the drivers read it."""
    parts = [
        bytes(start(walk)),
        struct.pack("=qd", walk.steps, STEP),
        *(bytes(inputs(command)) for command in commands(walk)),
    ]
    return b"".join(parts)


def write(walk: Walk, folder: Path = BUILD / "walks") -> Path:
    """Writes the walk's file and returns its path."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{walk.name}.walk"
    path.write_bytes(file_bytes(walk))
    return path


def describe(walk: Walk) -> str:
    """One line about a walk."""
    robot, command = walk.robot, walk.command
    return (
        f"{walk.name:24s} vx {command.vx:.3f} m/s, yaw rate {command.yaw_rate:+.3f} rad/s, mu {robot.friction.mu:.2f}, "
        f"K {robot.contact.stiffness:.3g} N/m^1.5, restitution {robot.contact.restitution:.2f}, period {walk.gait.period:.2f} s"
    )


if __name__ == "__main__":
    for member in family():
        write(member)
        print(describe(member))
