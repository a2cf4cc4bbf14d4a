"""Puts the robot to rest on some of its legs, under a light or a heavy load.

There it is linearised; a robot that cannot stand on these legs is reported.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count

import numpy as np

from hexapod_cosim.controller import LegSolver
from hexapod_cosim.controller.design.paper import weight_share
from hexapod_cosim.controller.plane import Mask
from hexapod_cosim.controller.size import size_of
from hexapod_cosim.cosim.design.linearise import ANGLES, LATEST, POSES, STATES, Bench, Motion
from hexapod_cosim.cosim.interface.names import JOINTS, LEGS
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.master.signals import PUSH
from hexapod_cosim.models import LEG_NAMES, FmuError, ReachError, Robot
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.dynamics import masses
from hexapod_cosim.models.kinematics import body_states

# lengths, times and speeds here are for robots of the usual size (size.py)
LIFT = 0.04  # m    of the feet that do not stand
LIFTS = (1.0, 0.5, 0.25)  # 1    parts of it that are tried, as far as the legs reach
SETTLING, SETTLING_STEP = 2.0, 0.05  # s    before the first check for rest; macro-step
LOOKED = 10  # steps between two checks
PATIENCE = 10.0  # 1    limit of the settling time, in multiples of SETTLING plus the feet's creep
SETTLING_SLOPE = 0.1  # 1    of the friction's: feet get to the same pose as much faster
REST = 1e-3  # m/s or rad/s
KEPT = 0.5  # 1    least part of its share of the load that a foot keeps when the torso is pushed
STIFFEN = "spread the feet of the stance, or stiffen the servos (servo.kp)"
SHIFT = "shift masses, or the feet of the stance"
BALANCED = 1e-9  # 1    of the load: feet that miss the balance by more cannot hold it


class StanceError(FmuError):
    """The legs do not hold the robot."""


def rest(plant: Fmu, robot: Robot, *, standing: Sequence[str], load: float) -> tuple[Motion, Array]:
    """Returns the robot at rest on the named legs, and the inputs (60,) that keep it there.

    load: mean of the standing legs', in thirds of the weight; a push on the torso, up or down,
    makes up the difference. The inputs hold the torques that carry the load. Raises StanceError
    when the robot does not stand there.
    """
    angle, stands = lifted_stance(robot, standing), _mask(standing)
    share, push = loads(robot, angle, standing, load=load)
    legs = LegSolver(robot)
    inputs = np.zeros(3 * ANGLES + len(PUSH))
    inputs[:ANGLES] = angle.reshape(-1)
    torque = -(legs.jacobian(angle)[:, 2] * share[:, None])
    inputs[2 * ANGLES : 3 * ANGLES] = torque.reshape(-1)
    inputs[3 * ANGLES :] = push
    feet = legs.forward(angle) - np.array(robot.torso.com)
    depth = (share.max() / robot.contact.stiffness) ** (2.0 / 3.0)
    start = np.zeros(1 + STATES)
    start[2], start[3] = robot.foot.radius - depth - feet[:, 2].min(), 1.0
    start[7 : 7 + ANGLES] = angle.reshape(-1)
    creep = creep_time(robot, angle, share)
    return settle(plant, robot, Motion(values=start), inputs, stands, creep=creep), inputs


def settle(
    plant: Fmu, robot: Robot, motion: Motion, inputs: Array, standing: Mask, *, creep: float
) -> Motion:  # fmt: skip
    """Returns the motion at rest on the `standing` (6,) feet, which creep in a time [s].

    Raises StanceError when the robot does not come to rest.
    """
    size, first = size_of(robot), round(SETTLING / SETTLING_STEP)
    step = SETTLING_STEP * size.time
    longest = min(PATIENCE * (SETTLING * size.time + creep), LATEST - LOOKED * step)
    slope = SETTLING_SLOPE * robot.friction.slope
    bench = Bench(plant, robot, coulomb_friction=0.0, slope=slope, period=step)
    bench.start(motion, inputs)
    for k in count(1):
        bench.step(k - 1)
        if k < first or k % LOOKED:
            continue
        way, in_contact = bench.motion().less(motion), bench.force()[2::3] > 0.0
        if (in_contact != standing).any():
            got = f"{_names(in_contact) or 'no foot'} on the ground"
            raise _not_standing(robot, got=got, expected=f"rest on {_names(standing)}", fix=STIFFEN)
        line = float(np.abs(way[POSES : POSES + 3]).max())  # m/s
        turn = float(np.abs(way[POSES + 3 :]).max())  # rad/s
        if line < REST * size.speed and turn < REST / size.time:
            break
        if k * step > longest:
            got = f"{line:.3g} m/s and {turn:.3g} rad/s after {k * step:.3g} s"
            raise _not_standing(robot, got=got, expected=f"rest on {_names(standing)}", fix=STIFFEN)
    way[POSES:] = 0.0
    return motion.moved(way)


def _mask(names: Sequence[str]) -> Mask:
    return np.array([leg in names for leg in LEG_NAMES])


def _names(legs: Mask) -> str:
    return " ".join(leg for leg, chosen in zip(LEG_NAMES, legs, strict=True) if chosen)


def _not_standing(robot: Robot, *, got: str, expected: str, fix: str) -> StanceError:
    what = "the robot does not stay on its legs"
    return StanceError(what, got=got, expected=expected, fix=fix, where=robot.name)


def creep_time(robot: Robot, angle: Array, share: Array) -> float:
    """Returns the time [s] in which the servos draw the slowest loaded foot over the ground.

    That is the damping of friction times the leg's horizontal compliance.
    """
    jacobian = LegSolver(robot).jacobian(angle)[:, :2]
    squares = np.linalg.eigvalsh(jacobian @ jacobian.transpose(0, 2, 1))
    damping = robot.friction.mu * SETTLING_SLOPE * robot.friction.slope * share
    return float((damping * squares[:, -1]).max() / robot.servo.kp)


def lifted_stance(robot: Robot, standing: Sequence[str]) -> Array:
    """Returns the joint angles (6, 3) [rad] of the stance with the feet of the other legs lifted.

    Raises StanceError where a leg cannot be lifted.
    """
    legs, lift = LegSolver(robot), LIFT * size_of(robot).length
    feet, up = legs.forward(robot.stance), np.outer(~_mask(standing), [0.0, 0.0, 1.0])
    for part in LIFTS:
        try:
            return legs.inverse(feet + part * lift * up)
        except ReachError as error:
            refused = error
    raise StanceError(
        "a foot cannot be lifted",
        got=refused.where,
        expected=f"{LIFTS[-1] * lift:.3g} m within the joints' limits",
        fix="widen the limits or bend the leg's stance",
        where=robot.name,
    ) from refused


def loads(
    robot: Robot, angle: Array, standing: Sequence[str], *, load: float
) -> tuple[Array, Array]:  # fmt: skip
    """Returns the least vertical forces on the standing feet (6,) [N] that hold the torso level.

    The second value is the push on the torso (6,) [N, N m] under which they do. It acts at the
    torso's centre of mass, or only as far towards the whole robot's as each foot needs to keep its
    share. Raises StanceError for feet that cannot hold the robot.
    """
    feet, stands = LegSolver(robot).forward(angle) - np.array(robot.torso.com), _mask(standing)
    rows = np.array([np.ones(LEGS), feet[:, 0], feet[:, 1]]) * stands
    moment, total = weight_moment(robot, angle), load * stands.sum() * weight_share(robot)
    spread, needed = np.linalg.pinv(rows), np.array([total, *(moment * total / robot.weight)])
    at_torso, at_centre = spread @ [total, *moment], spread @ needed
    missing = float(np.abs(rows @ at_centre - needed).max())
    least = int(np.where(stands, at_centre, np.inf).argmin())
    if missing > BALANCED * total or at_centre[least] <= 0.0:
        x, y = 1000.0 * (moment / robot.weight + np.array(robot.torso.com)[:2])
        got = f"the centre of mass at ({x:.0f}, {y:.0f}) mm"
        if missing <= BALANCED * total:
            got += f", under which foot {LEG_NAMES[least]} carries nothing"
        expected = f"between {' '.join(standing)}"
        raise _not_standing(robot, got=got, expected=expected, fix=SHIFT)
    gain, short = at_centre - at_torso, stands & (at_torso < KEPT * at_centre)
    shift = float(((KEPT * at_centre - at_torso)[short] / gain[short]).max(initial=0.0))
    (x, y), push = shift * moment / robot.weight, robot.weight - total
    return at_torso + shift * gain, np.array([0.0, 0.0, push, y * push, -x * push, 0.0])


def weight_moment(robot: Robot, angle: Array) -> Array:
    """Returns the weight of the level robot times its arms along x and y (2,) [N m].

    The arms begin at the torso's centre of mass.
    """
    level, still = np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3)
    body = body_states(robot, still, level, still, still, angle, np.zeros((LEGS, JOINTS)))
    return np.asarray(masses(robot) @ body[:, :2] * float(np.linalg.norm(robot.gravity)))
