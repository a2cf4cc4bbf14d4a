"""The family of walks on which all engines are measured; `python -m benchmarks.walks` writes it.

A step size may look good on one trajectory by chance, so every figure is judged on all walks: both
robots, all gaits, two walks of each; the rest is drawn once from a seeded generator. The joint
commands come from the kinematic controller. It uses no measurement, so every engine gets the same
commands, whatever its own error is.

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
TURN = 0.3  # rad/s, largest yaw rate, of every other walk
MU = (0.4, 0.9)
STIFFNESS = (0.3, 3.0)  # times the robot's own, log-uniform
RESTITUTION = (0.2, 0.9)

STIFF_SLOPE, STIFF_RUBBER = 1000.0, 1e7  # s/m, N/m^1.5


@dataclass(frozen=True, kw_only=True)
class Case:
    """One walk of the family: a robot on its ground, a gait and a command."""

    name: str
    robot: Robot
    gait: Gait
    command: BodyCommand

    @property
    def steps(self) -> int:
        """Returns the number of macro-steps of the walk."""
        return round(DURATION / STEP)


def family() -> list[Case]:
    """Returns the walks of the family, which are always the same."""
    generator = np.random.default_rng(SEED)
    places = [(robot, gait, k) for k in range(VARIANTS) for gait in PATTERNS for robot in ROBOTS]
    return [_drawn(generator, *place) for place in places]


def stiff(walk: Case, *, slope: float | None = None, stiffness: float | None = None) -> Case:
    """Returns the walk with a steeper friction law [s/m] or a stiffer foot [N/m^1.5].

    Its name contains the change.
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


def _drawn(generator: np.random.Generator, robot_name: str, gait_name: str, k: int) -> Case:
    """Draws one walk; draws again if the legs cannot reach it."""
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
    return Case(
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


def commands(walk: Case, *, steps: int | None = None) -> Iterator[Command]:
    """Yields the commands of the servos at k h, without feedback; each has arrays of its own.

    `steps` replaces the number of macro-steps.
    """
    controller, nothing = Controller(walk.robot, period=STEP, gait=walk.gait), Measurement()
    for k in range(walk.steps if steps is None else steps):
        joints = controller.step(k * STEP, walk.command, nothing)
        yield Command(
            angle_ref=joints.angle_ref.copy(),
            speed_ref=joints.speed_ref.copy(),
            torque_ref=joints.torque_ref.copy(),
        )


def start(walk: Case) -> Any:
    """Returns the hxDefinition of the robot at rest on the ground, in its stance."""
    position, quaternion, angle = settled(walk.robot)
    return definition(walk.robot, position=position, quaternion=quaternion, angle=angle)


def file_bytes(walk: Case) -> bytes:
    """Returns the content of the walk's file."""
    parts = [
        bytes(start(walk)),
        struct.pack("=qd", walk.steps, STEP),
        *(bytes(inputs(command)) for command in commands(walk)),
    ]
    return b"".join(parts)


def write(walk: Case, folder: Path = BUILD / "walks") -> Path:
    """Writes the walk's file and returns its path."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{walk.name}.walk"
    path.write_bytes(file_bytes(walk))
    return path


def describe(walk: Case) -> str:
    """Returns one line about a walk."""
    robot, command = walk.robot, walk.command
    return (
        f"{walk.name:24s} vx {command.vx:.3f} m/s, yaw rate {command.yaw_rate:+.3f} rad/s,"
        f" mu {robot.friction.mu:.2f}, K {robot.contact.stiffness:.3g} N/m^1.5,"
        f" restitution {robot.contact.restitution:.2f}, period {walk.gait.period:.2f} s"
    )


if __name__ == "__main__":
    for member in family():
        write(member)
        print(describe(member))
