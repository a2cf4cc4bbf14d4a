"""Merges a URDF's links at fixed joints into bodies and the joints between them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.errors import RobotError, unknown_name
from hexapod_cosim.models.urdf.elements import Inertial, Sphere, Urdf, UrdfJoint, UrdfLink


@dataclass(frozen=True, eq=False)
class Member:
    """A link of a body."""

    link: UrdfLink
    rotation: Array  # (3, 3) link to body
    position: Array  # (3,) m    of the link's frame in the body's

    def point(self, place: Array) -> Array:
        """Returns a point (3,) of the link in the body's frame [m]."""
        return self.position + self.rotation @ place


@dataclass(frozen=True, eq=False)
class Branch:
    """A moving joint and the body that it moves."""

    joint: UrdfJoint
    rotation: Array  # (3, 3) child body to this one at angle 0
    position: Array  # (3,) m
    direct: bool  # the joint leaves the body's own link, not one that is fixed to it
    body: Body


@dataclass(frozen=True, eq=False)
class Body:
    """Links that move together; the frame is that of the first link."""

    name: str
    members: list[Member] = field(default_factory=list)
    branches: list[Branch] = field(default_factory=list)

    @property
    def spheres(self) -> list[Sphere]:
        """Returns the collision spheres in the body's frame."""
        return [
            Sphere(member.point(sphere.centre), sphere.radius)
            for member in self.members
            for sphere in member.link.spheres
        ]

    def inertial(self, where: str) -> Inertial:
        """Returns mass, centre of mass and inertia of all members together, in the body's frame.

        Raises RobotError without mass.
        """
        parts = [_moved(member) for member in self.members if member.link.inertial is not None]
        if not parts:
            fix = "give it <inertial> with its mass and inertia"
            raise RobotError(
                "a moving body without mass",
                expected="<inertial>",
                fix=fix,
                where=f"{where}: link {self.name!r}",
            )
        return parts[0] if len(parts) == 1 else _together(parts)

    @property
    def problem(self) -> RobotError | None:
        """The reason why the inertia is impossible, or None."""
        found = (
            member.link.inertial.problem
            for member in self.members
            if member.link.inertial is not None
        )
        return next((problem for problem in found if problem is not None), None)


def _moved(member: Member) -> Inertial:
    inertial, R = member.link.inertial, member.rotation
    assert inertial is not None
    return Inertial(inertial.mass, member.point(inertial.com), R @ inertial.inertia @ R.T)


def _together(parts: list[Inertial]) -> Inertial:
    mass = sum(part.mass for part in parts)
    com = sum((part.mass * part.com for part in parts), start=np.zeros(3)) / mass
    inertia = np.zeros((3, 3))
    for part in parts:
        d = part.com - com
        inertia = (
            inertia + part.inertia + part.mass * (d @ d * np.eye(3) - np.outer(d, d))
        )  # parallel axes
    return Inertial(mass, com, inertia)


def root_body(urdf: Urdf) -> Body:
    """Returns the torso with all bodies that follow.

    Raises RobotError for a graph that is not a tree, or a torso fixed to the world.
    """
    leaving = _leaving(urdf)
    root = _unworldly(_root(urdf), leaving, urdf)
    torso = Body(root)
    waiting, reached = [torso], {_root(urdf)}
    while waiting:
        _collect(body := waiting.pop(), urdf, leaving)
        waiting += [branch.body for branch in body.branches]
        reached |= {member.link.name for member in body.members}
    if len(reached) < len(urdf.links):
        got = sorted(set(urdf.links) - reached)[0]
        raise RobotError(
            "links in a ring of their own",
            got=got,
            expected="a tree",
            fix="connect them to the root",
            where=urdf.where,
        )
    return torso


def _leaving(urdf: Urdf) -> dict[str, list[UrdfJoint]]:
    """Returns the joints that leave each link."""
    leaving: dict[str, list[UrdfJoint]] = {name: [] for name in urdf.links}
    parents: dict[str, str] = {}
    for joint in urdf.joints:
        where = f"{urdf.where}: joint {joint.name!r}"
        for name in (joint.parent, joint.child):
            if name not in urdf.links:
                raise unknown_name("link", name, list(urdf.links), where=where, error=RobotError)
        if joint.child in parents:
            got = f"link {joint.child!r} also hangs on {parents[joint.child]!r}"
            raise RobotError(
                "a closed loop",
                got=got,
                expected="a tree",
                fix="remove one of the joints",
                where=where,
            )
        parents[joint.child] = joint.parent
        leaving[joint.parent].append(joint)
    return leaving


def _root(urdf: Urdf) -> str:
    children = {joint.child for joint in urdf.joints}
    roots = [name for name in urdf.links if name not in children]
    if len(roots) != 1:
        raise RobotError(
            "not one root link",
            got=roots,
            expected="one link that is no joint's child",
            fix="connect the links",
            where=urdf.where,
        )
    return roots[0]


def _unworldly(root: str, leaving: dict[str, list[UrdfJoint]], urdf: Urdf) -> str:
    """Returns the root, or the floating child of a root that is the world."""
    joints = leaving[root]
    if len(joints) == 1 and joints[0].kind == "floating" and urdf.links[root].inertial is None:
        return joints[0].child
    if root == "world" and any(joint.kind == "fixed" for joint in joints):
        fix = "remove the link world and its joint, or make that floating"
        raise RobotError(
            "a robot fixed to the world",
            got=joints[0].name,
            expected="a torso that moves",
            fix=fix,
            where=urdf.where,
        )
    return root


def _collect(body: Body, urdf: Urdf, leaving: dict[str, list[UrdfJoint]]) -> None:
    """Adds the links that fixed joints connect, and the branches."""
    waiting = [Member(urdf.links[body.name], np.eye(3), np.zeros(3))]
    while waiting:
        member = waiting.pop(0)
        body.members.append(member)
        for joint in leaving[member.link.name]:
            if joint.kind == "floating":
                fix = "only the torso may float: make it fixed"
                raise RobotError(
                    "a link that floats",
                    got=joint.child,
                    expected="joints",
                    fix=fix,
                    where=f"{urdf.where}: joint {joint.name!r}",
                )
            R, p = member.rotation @ joint.rotation, member.point(joint.position)
            if joint.kind == "fixed":
                waiting.append(Member(urdf.links[joint.child], R, p))
            else:
                body.branches.append(
                    Branch(joint, R, p, member is body.members[0], Body(joint.child))
                )
