"""Finds the legs of a URDF and converts their links to this project's frames
(docs/architecture.md).

Legs are identified by the positions of their hips, not by names. At angle 0 every link's frame is
parallel to the hip's. The hip's yaw is chosen so that the joints rotate about +z, -y and +y, as the
controller requires, where their axes allow it. Joints with the opposite axis are reversed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.errors import RobotError
from hexapod_cosim.models.kinematics import axis_rotation, cross
from hexapod_cosim.models.records import JOINT_NAMES, LEG_NAMES
from hexapod_cosim.models.urdf.bodies import Body, Branch

Z = np.array([0.0, 0.0, 1.0])
PATTERN = (Z, np.array([0.0, -1.0, 0.0]), np.array([0.0, 1.0, 0.0]))  # the controller's joint axes
PATTERN_TOLERANCE = 1e-3  # rad  URDFs have 1.5704 for a quarter turn; it moves a foot by 0.1 mm
SAME_YAW = 1e-9  # rad    then the printed one is taken
SHORT = 1e-6  # m    no direction can be taken from a way as short


@dataclass(frozen=True, eq=False)
class FoundLeg:
    """A leg's table for a robot file, and its origin in the URDF."""

    name: str
    table: dict[str, Any]
    joints: tuple[str, ...]
    reversed: tuple[str, ...]  # joints counted the other way round
    radius: float | None  # m    of the foot, where the URDF states it
    foot: Array | None  # (3,) m  its centre in the tibia's frame
    servo: tuple[Branch, Branch, Branch]


def find_legs(
    torso: Body, origin: Array, R_BT: Array, *, keep_frames: bool, where: str
) -> list[FoundLeg]:
    """Returns the six legs in the order LF LM LR RF RM RR. Raises RobotError.

    origin (3,) and R_BT (3, 3): the torso's frame in the root link's.
    """
    if len(torso.branches) != len(LEG_NAMES):
        raise _not_six(torso, where)
    chains = [_chain(branch, where) for branch in torso.branches]
    hips = np.array([R_BT.T @ (chain[0].position - origin) for chain in chains])
    order = _order(hips, [chain[0].joint.name for chain in chains], where)
    middle = hips.mean(axis=0)
    return [
        _leg(name, chains[k], hips[k], hips[k] - middle, R_BT, keep_frames=keep_frames, where=where)
        for name, k in zip(LEG_NAMES, order, strict=True)
    ]


def _not_six(torso: Body, where: str) -> RobotError:
    """Returns the exception for a torso without exactly six moving joints."""
    names = ", ".join(branch.joint.name for branch in torso.branches)
    return RobotError(
        "not six legs on the root link",
        got=f"{len(torso.branches)} moving joints on {torso.name!r}: {names}",
        expected="six legs of three joints each and no other moving joint",
        fix="make joints that are no legs' fixed; robots with another number of legs cannot be "
        "simulated, because plant, gaits and controller are a hexapod's",
        where=where,
    )


def _chain(branch: Branch, where: str) -> tuple[Branch, Branch, Branch]:
    """Returns the three joints of a leg, of which each follows the other."""
    chain = [branch]
    while len(chain[-1].body.branches) == 1 and len(chain) < len(JOINT_NAMES):
        chain.append(chain[-1].body.branches[0])
    rest = [item.joint.name for item in chain[-1].body.branches]
    if len(chain) != len(JOINT_NAMES) or rest:
        names = [item.joint.name for item in chain]
        what = "a leg that is no chain of three joints"
        got = f"{', '.join(names)}" + (f", then {', '.join(rest)}" if rest else "")
        expected = "three moving joints, one after the other"
        fix = "make the others fixed, or all of them if this is no leg"
        raise RobotError(what, got=got, expected=expected, fix=fix, where=where)
    return (chain[0], chain[1], chain[2])


def _order(hips: Array, names: list[str], where: str) -> list[int]:
    """Indices of LF LM LR RF RM RR: x forward, y left."""
    sides = [
        sorted((k for k in range(len(hips)) if sign * hips[k, 1] > 0.0), key=lambda k: -hips[k, 0])
        for sign in (1.0, -1.0)
    ]
    if [len(side) for side in sides] != [3, 3]:
        places = zip(names, hips, strict=True)
        raise RobotError(
            "not three hips left and three right",
            got=", ".join(f"{name} at ({x:.3g}, {y:.3g})" for name, (x, y, _) in places),
            expected="x forward, y left",
            fix='say which way is forward: `forward = "y"` under [urdf] of a robot file with '
            'file = "..."',
            where=where,
        )
    return [*sides[0], *sides[1]]


def _leg(
    name: str,
    chain: tuple[Branch, Branch, Branch],
    hip: Array,
    outwards: Array,
    R_BT: Array,
    *,
    keep_frames: bool,
    where: str,
) -> FoundLeg:
    R_BC, R_CF, R_FS = (branch.R_BL for branch in chain)  # at angle 0
    R_TC = R_BT.T @ R_BC
    R_TF = R_TC @ R_CF
    wanted = None if keep_frames else _pattern_yaw((R_TC, R_TF, R_TF @ R_FS), chain, outwards)
    yaw, R_HC = _yaw(chain[0], R_TC, wanted, plain=np.array_equal(R_BT, np.eye(3)))
    R_HF = R_HC @ R_CF
    R_HS = R_HF @ R_FS
    foot_S, radius = foot_of(chain[2].body)
    end = None if foot_S is None else R_HS @ foot_S
    tips = (R_HC @ chain[1].position, R_HF @ chain[2].position, end)
    table: dict[str, Any] = {"hip_position": hip.tolist(), "hip_yaw": yaw}
    other_way = []
    links = zip(JOINT_NAMES, PATTERN, chain, (R_HC, R_HF, R_HS), tips, strict=True)
    for joint, pattern, branch, R_HL, tip in links:
        axis, sign = _axis(R_HL @ branch.joint.axis, pattern if wanted is not None else None)
        other_way += [branch.joint.name] if sign < 0.0 else []
        table[joint] = _link(branch, R_HL, tip, axis, sign, where)
    names = tuple(branch.joint.name for branch in chain)
    return FoundLeg(name, table, names, tuple(other_way), radius, foot_S, chain)


def _pattern_yaw(
    R_TL: tuple[Array, ...], chain: tuple[Branch, Branch, Branch], outwards: Array
) -> float | None:
    """Returns the hip's yaw [rad] at which the axes equal the controller's up to their signs, or
    None.
    """
    coxa, femur, tibia = (R @ one.joint.axis for R, one in zip(R_TL, chain, strict=True))
    if np.hypot(*coxa[:2]) > PATTERN_TOLERANCE or abs(femur[2]) > PATTERN_TOLERANCE:
        return None
    if np.linalg.norm(cross(femur, tibia)) > PATTERN_TOLERANCE:
        return None
    x = cross(femur, Z)
    way = (R_TL[0] @ chain[1].position) @ x
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
    R_HT = axis_rotation(Z, -yaw)
    return yaw, R_HT @ R_TC


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


def _link(
    branch: Branch, R_HL: Array, tip: Array | None, axis: Array, sign: float, where: str
) -> dict[str, Any]:
    """Returns a link's table, in hip axes."""
    inertial, joint = branch.body.inertial(where), branch.joint
    keys = ("length", "offset_y", "offset_z")
    place = {} if tip is None else dict(zip(keys, tip.tolist(), strict=True))
    limits = (joint.lower, joint.upper) if sign > 0.0 else (-joint.upper, -joint.lower)
    return {
        "mass": inertial.mass,
        **place,
        "com": (R_HL @ inertial.com).tolist(),
        "inertia": inertia_entries(R_HL @ inertial.inertia @ R_HL.T),
        "axis": axis.tolist(),
        "angle_min": limits[0],
        "angle_max": limits[1],
    }


def inertia_entries(inertia: Array) -> list[float]:
    """Returns xx yy zz xy xz yz of a symmetric matrix."""
    return [float(inertia[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]


def turned_leg(leg: FoundLeg, signs: Sequence[float]) -> FoundLeg:
    """Returns a leg with the joints of negative sign counted against the URDF's axes."""
    other_way = [k for k, sign in enumerate(signs) if sign < 0.0]
    table = dict(leg.table)
    for joint in (JOINT_NAMES[k] for k in other_way):
        link = table[joint]
        limits = {"angle_min": -link["angle_max"], "angle_max": -link["angle_min"]}
        table[joint] = link | {"axis": [0.0 - value for value in link["axis"]]} | limits
    return replace(leg, table=table, reversed=(*leg.reversed, *(leg.joints[k] for k in other_way)))


def refuse_footless(legs: list[FoundLeg], table: dict[str, Any], where: str) -> None:
    """Raises RobotError for a leg of which no file gives the foot."""
    for leg in legs:
        if "length" not in table["legs"][leg.name]["tibia"]:
            raise RobotError(
                "a leg without a foot",
                expected="a foot",
                fix="give it a collision sphere where it touches the ground, or a fixed link "
                "there; or give length and offsets under [links.tibia]",
                where=f"{where}: link {leg.servo[2].body.name!r}",
            )
