"""Merges a URDF's links at fixed joints into bodies and the joints between them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.errors import RobotError, unknown_name
from hexapod_cosim.models.urdf.elements import Inertial, Sphere, Urdf, UrdfJoint, UrdfLink


@dataclass(frozen=True, eq=False)
class Member:
    """A link of a body."""

    link: UrdfLink
    R_BL: Array  # (3, 3) link to body
    position: Array  # (3,) m    of the link's frame in the body's

    def point(self, p_L: Array) -> Array:
        """Returns a point (3,) of the link in the body's frame [m]."""
        return self.position + self.R_BL @ p_L

    def moved(self, part: Inertial) -> Inertial:
        """Returns the link's mass, centre of mass and inertia in the body's frame."""
        return Inertial(part.mass, self.point(part.com), self.R_BL @ part.inertia @ self.R_BL.T)


@dataclass(frozen=True, eq=False)
class Branch:
    """A moving joint and the body that it moves."""

    joint: UrdfJoint
    R_BL: Array  # (3, 3) child body's frame, that of its first link, to this one's at angle 0
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
        """Collision spheres of all links, in the body's frame."""
        return [
            replace(sphere, centre=member.point(sphere.centre))
            for member in self.members
            for sphere in member.link.spheres
        ]

    def inertial(self, where: str) -> Inertial:
        """Returns mass, centre of mass and inertia of all members together, in the body's frame.

        Raises RobotError without mass.
        """
        parts = [member.moved(part) for member in self.members if (part := member.link.inertial)]
        if not parts:
            what, fix = "a moving body without mass", "give it <inertial> with its mass and inertia"
            at = f"{where}: link {self.name!r}"
            raise RobotError(what, expected="<inertial>", fix=fix, where=at)
        return parts[0] if len(parts) == 1 else _together(parts)


def _together(parts: list[Inertial]) -> Inertial:
    """Returns the sum of several bodies, by the parallel-axis theorem."""
    mass = sum(part.mass for part in parts)
    com = sum((part.mass * part.com for part in parts), start=np.zeros(3)) / mass
    inertia = np.zeros((3, 3))
    for part in parts:
        d = part.com - com
        inertia = inertia + part.inertia + part.mass * (d @ d * np.eye(3) - np.outer(d, d))
    return Inertial(mass, com, inertia)


def root_body(urdf: Urdf) -> Body:
    """Returns the torso with all bodies that follow.

    Raises RobotError for a graph that is not a tree, or a torso fixed to the world.
    """
    leaving = _leaving(urdf)
    children = {joint.child for joint in urdf.joints}
    roots = [name for name in urdf.links if name not in children]
    if len(roots) != 1:
        what, fix = "not one root link", "connect the links"
        expected = "one link that is no joint's child"
        raise RobotError(what, got=roots, expected=expected, fix=fix, where=urdf.where)
    torso = Body(_moving_root(roots[0], leaving[roots[0]], urdf))
    waiting, reached = [torso], {roots[0]}
    while waiting:
        _collect(body := waiting.pop(), urdf, leaving)
        waiting += [branch.body for branch in body.branches]
        reached |= {member.link.name for member in body.members}
    lost = sorted(set(urdf.links) - reached)
    if lost:
        what, fix = "links in a ring of their own", "connect them to the root"
        raise RobotError(what, got=lost[0], expected="a tree", fix=fix, where=urdf.where)
    return torso


def _leaving(urdf: Urdf) -> dict[str, list[UrdfJoint]]:
    """Returns the joints that leave each link."""
    leaving: dict[str, list[UrdfJoint]] = {name: [] for name in urdf.links}
    children = set[str]()
    for joint in urdf.joints:
        where = f"{urdf.where}: joint {joint.name!r}"
        for name in (joint.parent, joint.child):
            if name not in urdf.links:
                raise unknown_name("link", name, list(urdf.links), where=where, error=RobotError)
        if joint.child in children:
            got, fix = f"link {joint.child!r} hangs on two joints", "remove one of the joints"
            raise RobotError("a closed loop", got=got, expected="a tree", fix=fix, where=where)
        children.add(joint.child)
        leaving[joint.parent].append(joint)
    return leaving


def _moving_root(root: str, joints: list[UrdfJoint], urdf: Urdf) -> str:
    """Returns the root, or the floating child of a root that is the world."""
    if len(joints) == 1 and joints[0].kind == "floating" and urdf.links[root].inertial is None:
        return joints[0].child
    if root == "world" and any(joint.kind == "fixed" for joint in joints):
        what = "a robot fixed to the world"
        fix = "remove the link world and its joint, or make that floating"
        raise RobotError(what, got=root, expected="a moving torso", fix=fix, where=urdf.where)
    return root


def _collect(body: Body, urdf: Urdf, leaving: dict[str, list[UrdfJoint]]) -> None:
    """Adds the links that fixed joints connect, and the branches."""
    waiting = [Member(urdf.links[body.name], np.eye(3), np.zeros(3))]
    while waiting:
        member = waiting.pop(0)
        body.members.append(member)
        for joint in leaving[member.link.name]:
            where = f"{urdf.where}: joint {joint.name!r}"
            if joint.kind == "floating":
                what, fix = "a link that floats", "only the torso may float: make it fixed"
                raise RobotError(what, got=joint.child, expected="joints", fix=fix, where=where)
            R_BP, p_B = member.R_BL, member.point(joint.position)
            R_BL = R_BP @ joint.R_PL
            if joint.kind == "fixed":
                waiting.append(Member(urdf.links[joint.child], R_BL, p_B))
            else:
                direct = member is body.members[0]
                body.branches.append(Branch(joint, R_BL, p_B, direct, Body(joint.child)))
