"""Finds the legs of a URDF and converts their links to this project's frames
(docs/architecture.md).

Legs are identified by the positions of their hips, not by names. At angle 0 every link's frame is
parallel to the hip's. The hip's yaw is chosen so that the joints rotate about +z, -y and +y, as the
controller requires, where their axes allow it. Joints with the opposite axis are reversed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.errors import RobotError
from hexapod_cosim.models.kinematics import axis_rotation, cross
from hexapod_cosim.models.records import JOINT_NAMES, LEG_NAMES
from hexapod_cosim.models.urdf.bodies import Body, Branch

Z = np.array([0.0, 0.0, 1.0])
PATTERN = (Z, np.array([0.0, -1.0, 0.0]), np.array([0.0, 1.0, 0.0]))  # the controller's joint axes
PATTERN_TOLERANCE = (
    1e-3  # rad    URDFs have 1.5704 for a quarter turn; it moves a foot by a tenth of a millimetre
)
SAME_YAW = 1e-9  # rad    then the printed one is taken
SHORT = 1e-6  # m    no direction can be taken from a way as short


@dataclass(frozen=True, eq=False)
class FoundLeg:
    """A leg's table for a robot file, and its origin in the URDF."""

    name: str
    table: dict[str, Any]
    joints: tuple[str, str, str]
    reversed: tuple[str, ...]  # joints counted the other way round
    radius: float | None  # m    of the foot, where the URDF states it
    footless: RobotError | None  # the error to raise if the position of the foot is given nowhere
    servo: tuple[Branch, Branch, Branch]


def find_legs(
    torso: Body, origin: Array, axes: Array, *, keep_frames: bool, where: str
) -> list[FoundLeg]:
    """Returns the six legs in the order LF LM LR RF RM RR. Raises RobotError.

    origin (3,) and axes (3, 3): the torso's frame in the root link's.
    """
    if len(torso.branches) != len(LEG_NAMES):
        raise _not_six(torso, where)
    chains = [_chain(branch, where) for branch in torso.branches]
    hips = np.array([axes.T @ (chain[0].position - origin) for chain in chains])
    order = _order(hips, [chain[0].joint.name for chain in chains], where)
    middle = hips.mean(axis=0)
    return [
        _leg(name, chains[k], hips[k], hips[k] - middle, axes, keep_frames=keep_frames, where=where)
        for name, k in zip(LEG_NAMES, order, strict=True)
    ]


def _not_six(torso: Body, where: str) -> RobotError:
    """Returns the exception for a torso without exactly six moving joints.

    Additional joints can be made fixed; missing legs cannot be added.
    """
    legs = [branch.joint.name for branch in torso.branches if _is_leg(branch)]
    others = [branch.joint.name for branch in torso.branches if not _is_leg(branch)]
    names = ", ".join(branch.joint.name for branch in torso.branches)
    got = f"{len(torso.branches)} moving joints on {torso.name!r}: {names}"
    if len(legs) == len(LEG_NAMES):
        fix = f"make joints that are no legs' fixed: {', '.join(others)}"
        return RobotError(
            "not six legs alone",
            got=got,
            expected="six legs and no other moving joints",
            fix=fix,
            where=where,
        )
    if len(torso.branches) == 1:
        fix = (
            f"make {torso.branches[0].joint.name!r} fixed if what it moves is the torso; "
            "robots with six legs alone can be simulated"
        )
        return RobotError(
            "not six legs on the root link",
            got=got,
            expected="six legs of three joints each",
            fix=fix,
            where=where,
        )
    got = f"{len(legs)} legs of three joints each, of {got}"
    fix = (
        "take a robot with six legs: plant, gaits and controller are a hexapod's, "
        "and fixing or adding joints makes no other robot one"
    )
    return RobotError(
        "six legs only: robots with another number of legs cannot be simulated",
        got=got,
        expected="six",
        fix=fix,
        where=where,
    )


def _is_leg(branch: Branch) -> bool:
    """Returns whether exactly three moving joints follow each other."""
    count, branches = 1, branch.body.branches
    while len(branches) == 1:
        count, branches = count + 1, branches[0].body.branches
    return not branches and count == len(JOINT_NAMES)


def _chain(branch: Branch, where: str) -> tuple[Branch, Branch, Branch]:
    chain = [branch]
    while chain[-1].body.branches:
        body = chain[-1].body
        if len(body.branches) > 1 or len(chain) == len(JOINT_NAMES):
            found = ", ".join(item.joint.name for item in body.branches)
            got = f"{found} on link {body.name!r}, joint {len(chain) + 1} of the leg"
            fix = "make the others fixed"
            raise RobotError(
                "a leg that is no chain of three joints",
                got=got,
                expected="one after the other",
                fix=fix,
                where=where,
            )
        chain.append(body.branches[0])
    if len(chain) != len(JOINT_NAMES):
        names, fix = [item.joint.name for item in chain], "make it fixed if it is no leg"
        raise RobotError(
            "a leg that is no chain of three joints",
            got=names,
            expected="three moving joints",
            fix=fix,
            where=where,
        )
    return (chain[0], chain[1], chain[2])


def _order(hips: Array, names: list[str], where: str) -> list[int]:
    """Indices of LF LM LR RF RM RR: x forward, y left."""
    sides = [
        sorted((k for k in range(len(hips)) if sign * hips[k, 1] > 0.0), key=lambda k: -hips[k, 0])
        for sign in (1.0, -1.0)
    ]
    if [len(side) for side in sides] != [3, 3]:
        got = ", ".join(
            f"{name} at ({x:.3g}, {y:.3g})" for name, (x, y, _) in zip(names, hips, strict=True)
        )
        fix = (
            'say which way is forward: `forward = "y"` under [urdf] '
            'of a robot file with file = "..."'
        )
        raise RobotError(
            "not three hips left and three right",
            got=got,
            expected="x forward, y left",
            fix=fix,
            where=where,
        )
    return [*sides[0], *sides[1]]


def _leg(
    name: str,
    chain: tuple[Branch, Branch, Branch],
    hip: Array,
    outwards: Array,
    axes: Array,
    *,
    keep_frames: bool,
    where: str,
) -> FoundLeg:
    turns = [axes.T @ chain[0].rotation]  # links' axes to the torso's at angle 0
    for branch in chain[1:]:
        turns.append(turns[-1] @ branch.rotation)
    wanted = None if keep_frames else _pattern_yaw(turns, chain, outwards)
    yaw, R_HC = _yaw(chain[0], turns[0], wanted, plain=bool((axes == np.eye(3)).all()))
    turns = [R_HC, R_HC @ chain[1].rotation, R_HC @ chain[1].rotation @ chain[2].rotation]
    foot, radius = foot_of(chain[2].body)
    tips = [
        turns[0] @ chain[1].position,
        turns[1] @ chain[2].position,
        None if foot is None else turns[2] @ foot,
    ]
    table: dict[str, Any] = {"hip_position": hip.tolist(), "hip_yaw": yaw}
    other_way = []
    for joint, pattern, branch, R, tip in zip(
        JOINT_NAMES, PATTERN, chain, turns, tips, strict=True
    ):
        axis, sign = _axis(R @ branch.joint.axis, pattern if wanted is not None else None)
        other_way += [branch.joint.name] if sign < 0.0 else []
        table[joint] = _link(branch, R, tip, axis, sign, where)
    names = (chain[0].joint.name, chain[1].joint.name, chain[2].joint.name)
    return FoundLeg(
        name,
        table,
        names,
        tuple(other_way),
        radius,
        _footless(chain[2].body, where) if foot is None else None,
        chain,
    )


def _pattern_yaw(
    turns: list[Array], chain: tuple[Branch, Branch, Branch], outwards: Array
) -> float | None:
    """Returns the hip's yaw [rad] at which the axes equal the controller's up to their signs, or
    None.
    """
    coxa, femur, tibia = (R @ branch.joint.axis for R, branch in zip(turns, chain, strict=True))
    if np.hypot(*coxa[:2]) > PATTERN_TOLERANCE or abs(femur[2]) > PATTERN_TOLERANCE:
        return None
    if np.linalg.norm(cross(femur, tibia)) > PATTERN_TOLERANCE:
        return None
    x = cross(femur, Z)
    way = (turns[0] @ chain[1].position) @ x
    way = way if abs(way) > SHORT else outwards @ x
    x = -x if way < 0.0 else x
    return math.atan2(x[1], x[0])


def _yaw(coxa: Branch, R_TC: Array, wanted: float | None, *, plain: bool) -> tuple[float, Array]:
    """Returns the hip's yaw [rad] and the coxa's axes in the hip's frame.

    The yaw is exact where the URDF gives it.
    """
    printed = coxa.joint.yaw if coxa.direct and plain else None
    if printed is not None and abs(printed) <= math.pi:
        turn = 0.0 if wanted is None else math.remainder(wanted - printed, 2.0 * math.pi)
        if abs(turn) <= SAME_YAW:
            return printed, np.eye(3)
    yaw = math.atan2(R_TC[1, 0], R_TC[0, 0]) if wanted is None else wanted
    return yaw, axis_rotation(Z, -yaw) @ R_TC


def _axis(axis: Array, pattern: Array | None) -> tuple[Array, float]:
    if pattern is None:
        return axis + 0.0, 1.0
    return pattern, 1.0 if axis @ pattern > 0.0 else -1.0


def foot_of(tibia: Body) -> tuple[Array | None, float | None]:
    """Returns the foot's centre [m] in the tibia's frame, and its radius.

    It is the outermost collision sphere, else the outermost fixed link.
    """
    spheres = tibia.spheres
    if spheres:
        outermost = max(spheres, key=lambda sphere: float(np.linalg.norm(sphere.centre)))
        return outermost.centre, outermost.radius
    tip = max(
        (member.position for member in tibia.members),
        key=lambda place: float(np.linalg.norm(place)),
    )
    return (tip, None) if np.linalg.norm(tip) > SHORT else (None, None)


def _footless(tibia: Body, where: str) -> RobotError:
    fix = (
        "give it a collision sphere where it touches the ground, or a fixed link there; "
        "or give length and offsets under [links.tibia]"
    )
    return RobotError(
        "a leg without a foot", expected="a foot", fix=fix, where=f"{where}: link {tibia.name!r}"
    )


def _link(
    branch: Branch, R: Array, tip: Array | None, axis: Array, sign: float, where: str
) -> dict[str, Any]:
    """Returns a link's table, in hip axes."""
    inertial, joint = branch.body.inertial(where), branch.joint
    place = (
        {}
        if tip is None
        else {"length": float(tip[0]), "offset_y": float(tip[1]), "offset_z": float(tip[2])}
    )
    limits = (joint.lower, joint.upper) if sign > 0.0 else (-joint.upper, -joint.lower)
    return {
        "mass": inertial.mass,
        **place,
        "com": (R @ inertial.com).tolist(),
        "inertia": inertia_entries(R @ inertial.inertia @ R.T),
        "axis": axis.tolist(),
        "angle_min": limits[0],
        "angle_max": limits[1],
    }


def inertia_entries(inertia: Array) -> list[float]:
    """Returns xx yy zz xy xz yz of a symmetric matrix."""
    return [float(inertia[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
