"""Writes a robot as a MuJoCo model with the same bodies, joints and servos and a similar ground
contact.

MuJoCo's contact is a spring and a damper of accelerations. Its stiffness is chosen so that the feet
of a standing tripod sink in as deep as with Hertz's law, its damping so that a free bounce has the
restitution. Friction is Coulomb's, with an elliptic cone; the feet's resistance to spin and rolling
(eq. 38) becomes torsional and rolling friction. Joint stops (eq. 39) become limits with the same
spring and damper. Viscous friction becomes the joint's damping, and a motor's back-EMF a part of
kv. The servos' torque-speed line, friction that depends on load and speed, the rotors' angular
momentum, the tanh law's creep, static friction above the kinetic one and the contacts' viscous
friction are omitted, and soil is rigid.

A robot without stops has limits of MuJoCo's own stiffness, which the plant does not have.

The ground is a plane; robots on a surface of the catalogue are refused.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable

import numpy as np

from hexapod_cosim.models.arrays import Array, Vector3
from hexapod_cosim.models.energy import joint_mobility, tibia_mobility
from hexapod_cosim.models.errors import RobotError
from hexapod_cosim.models.ground.faces import surface_of
from hexapod_cosim.models.kinematics import (
    LEGS,
    axis_quaternion,
    foot_positions,
    quaternion_product,
    rotation_matrix,
)
from hexapod_cosim.models.records import JOINT_NAMES, Leg, Link, Robot
from hexapod_cosim.models.servos.motor import back_emf_damping
from hexapod_cosim.models.urdf.writer import COLOURS, THICKNESS
from hexapod_cosim.models.xml_elements import add, joined, written

TIME_STEP = 0.001  # s
# 1  MuJoCo's default: the share of a constraint's acceleration that it corrects
IMPEDANCE = 0.9
# 1  of joint stops: the limit's force then depends little on the acceleration, as a spring's
STOP_IMPEDANCE = 0.001
# geometry for pictures, without contact and mass
DRAWN = {"contype": "0", "conaffinity": "0", "group": "1", "mass": "0"}
# geometry that touches the ground only
GROUNDED = {"contype": "0", "conaffinity": "1", "mass": "0"}
Z = np.array([0.0, 0.0, 1.0])
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
GROUND = "5 5 0.1"  # m    half sizes of the drawn plane and its grid


def robot_to_mjcf(robot: Robot) -> str:
    """Returns the text of an MJCF file, with a keyframe "stance" on the ground.

    Raises RobotError for a robot on a surface.
    """
    if surface_of(robot.terrain) is not None:
        what = "a ground that MJCF files of this project do not contain"
        fix = "set terrain.kind to flat, and add the ground in MuJoCo"
        expected = "flat or slope"
        raise RobotError(what, got=robot.terrain.name, expected=expected, fix=fix, where="terrain")
    root = ET.Element("mujoco", model=robot.name)
    add(root, "compiler", angle="radian", autolimits="true", balanceinertia="false")
    option = add(root, "option", timestep=TIME_STEP, gravity=robot.gravity)
    option.attrib |= {"integrator": "implicitfast", "cone": "elliptic", "impratio": "10"}
    _assets(root)
    world = add(root, "worldbody")
    add(world, "light", pos="0 0 3", dir="0 0 -1", directional="true")
    _ground(world, robot)
    _torso(world, robot)
    _servos(root, robot)
    _stance(root, robot)
    return written(root)


def _assets(root: ET.Element) -> None:
    asset = add(root, "asset")
    for name, colour in COLOURS.items():
        add(asset, "material", name=name, rgba=colour)
    add(
        asset,
        "texture",
        name="grid",
        type="2d",
        builtin="checker",
        rgb1="0.83 0.85 0.87",
        rgb2="0.76 0.78 0.81",
        width="256",
        height="256",
    )
    add(asset, "material", name="ground", texture="grid", texrepeat="5 5", texuniform="true")


def _ground(world: ET.Element, robot: Robot) -> None:
    add(
        world,
        "geom",
        _contact_attributes(robot),
        name="ground",
        type="plane",
        size=GROUND,
        material="ground",
        pos=(0.0, 0.0, robot.terrain.height),
        quat=_ground_quaternion(robot),
    )


def _contact_attributes(robot: Robot) -> dict[str, str]:
    """Returns the attributes of the ground's contact with the feet."""
    return {
        "friction": joined(_friction(robot)),
        "condim": _contact_dimensions(robot),
        "solref": _solref(robot),
        "solimp": _solimp(IMPEDANCE),
        "priority": "1",
    }


def _friction(robot: Robot) -> Vector3:
    """Returns sliding [1], torsional [m] and rolling [m] friction of the feet.

    MuJoCo's moments are at most the latter two times the normal force; ours are mu r_s f_n against
    spin and r_r f_n against rolling.
    """
    if not robot.friction.has_friction:
        return (0.0, 0.0, 0.0)
    mu = robot.friction.mu
    return (mu, mu * robot.friction.spin_radius, robot.friction.rolling_radius)


def _contact_dimensions(robot: Robot) -> str:
    """Returns MuJoCo's condim: 3 sliding, 4 with torsional friction, 6 with rolling friction."""
    _, torsional, rolling = _friction(robot)
    return "6" if rolling > 0.0 else "4" if torsional > 0.0 else "3"


def _body_attributes(robot: Robot) -> dict[str, str]:
    """Returns the attributes of torso, knees and shanks: contact without moments, not drawn."""
    contact = _contact_attributes(robot)
    sliding = {"friction": joined((_friction(robot)[0], 0.0, 0.0)), "condim": "3"}
    return GROUNDED | {"group": "3"} | contact | sliding | {"priority": "2"}


def _solimp(impedance: float) -> str:
    return joined((impedance, impedance, 0.001, 0.5, 2.0))


def _solref(robot: Robot) -> str:
    """Returns time constant t [s] and damping ratio z.

    MuJoCo's force at a depth r is r / ((1 - d) w t^2 z^2), with the impedance d and the mobility w;
    Hertz's depth under f is (f / K)^(2/3).
    """
    load = max(robot.weight / 3.0, 1e-6)
    depth = (load / robot.contact.stiffness) ** (2.0 / 3.0)
    loss = math.log(max(robot.contact.restitution, 1e-3))
    damping = max(-loss / math.hypot(math.pi, loss), 0.01)
    product = math.sqrt(depth / (load * (1.0 - IMPEDANCE) * tibia_mobility(robot)))
    return joined((max(product / damping, 2.0 * TIME_STEP), damping))


def _inertial(body: ET.Element, mass: float, com: Vector3, inertia: Iterable[float]) -> None:
    add(body, "inertial", pos=com, mass=mass, fullinertia=inertia)


def _torso(world: ET.Element, robot: Robot) -> None:
    torso = add(world, "body", name="torso")
    add(torso, "freejoint", name="torso")
    _inertial(torso, robot.torso.mass, robot.torso.com, robot.torso.inertia)
    half = joined(0.5 * size for size in robot.torso.size)
    add(
        torso,
        "geom",
        DRAWN,
        name="torso",
        type="box",
        size=half,
        pos=robot.torso.com,
        material="body",
    )
    body = robot.body
    if body.contact == "on" and any(body.torso_box):
        edges = joined(half + body.corner_radius for half in body.torso_box)
        place = joined(body.torso_centre)
        box = {"name": "torso_contact", "type": "box", "size": edges, "pos": place}
        add(torso, "geom", _body_attributes(robot) | box)
    add(torso, "site", name="imu", pos=robot.torso.com)
    for k, mobility in enumerate(joint_mobility(robot)):
        _leg(torso, k, robot, mobility)


def _leg(torso: ET.Element, k: int, robot: Robot, mobility: Array) -> None:
    """Adds leg k; mobility (3,) of its joints [1/(kg m2)]."""
    leg = robot.legs[k]
    body, place = torso, leg.hip_position
    quaternion = axis_quaternion(Z, leg.hip_yaw)
    links = zip(JOINT_NAMES, robot.owner_links(k), mobility, strict=True)
    for name, (owners, link), mobile in links:
        body = add(body, "body", name=f"{leg.name}_{name}", pos=place, quat=quaternion)
        _inertial(body, link.mass, link.com, link.inertia)
        _hinge(body, owners, link, robot, float(mobile))
        size = repr(THICKNESS * robot.foot.radius)
        add(
            body,
            "geom",
            DRAWN,
            type="capsule",
            fromto=(0.0, 0.0, 0.0, *link.tip),
            size=size,
            material="limb",
        )
        place, quaternion = link.tip, UPRIGHT
    if robot.body.contact == "on":
        _tibia_spheres(body, leg, robot)
    _foot(body, leg, robot, place)


def _foot(tibia: ET.Element, leg: Leg, robot: Robot, place: Vector3) -> None:
    """Adds the foot's sphere, which touches the ground only, and its site."""
    sphere = {"name": f"{leg.name}_foot", "type": "sphere", "size": repr(robot.foot.radius)}
    contact = GROUNDED | {"condim": _contact_dimensions(robot), "material": "rubber"}
    add(tibia, "geom", contact | sphere | {"pos": joined(place)})
    add(tibia, "site", name=f"{leg.name}_foot", pos=place)


def _tibia_spheres(tibia: ET.Element, leg: Leg, robot: Robot) -> None:
    """Adds the spheres of knee and shank."""
    for name, radius, share in robot.body.tibia_spheres:
        place = joined(share * value for value in leg.links[-1].tip)
        sphere = {"name": f"{leg.name}_{name}", "type": "sphere", "size": repr(radius)}
        add(tibia, "geom", _body_attributes(robot) | sphere | {"pos": place})


def _hinge(body: ET.Element, name: str, link: Link, robot: Robot, mobility: float) -> None:
    """Adds a joint with its limits; mobility in 1/(kg m2)."""
    servo = robot.servo
    joint = add(body, "joint", name=name, type="hinge", axis=link.axis)
    joint.attrib |= {
        "range": joined((link.angle_min, link.angle_max)),
        "armature": repr(servo.rotor_inertia),
        "frictionloss": repr(servo.coulomb_friction),
    }
    if servo.viscous_friction > 0.0:
        joint.set("damping", repr(servo.viscous_friction))
    if servo.stop_stiffness > 0.0:
        # MuJoCo's torque at a depth x is (k x + c dx/dt) / ((1 - d) w), with the impedance d and
        # the mobility w; negative joined give k and c
        share = (1.0 - STOP_IMPEDANCE) * mobility
        joint.set(
            "solreflimit", joined((-share * servo.stop_stiffness, -share * servo.stop_damping))
        )
        joint.set("solimplimit", _solimp(STOP_IMPEDANCE))


def _servos(root: ET.Element, robot: Robot) -> None:
    servo, actuator = robot.servo, add(root, "actuator")
    damping = servo.kd + (back_emf_damping(servo) if servo.drive == "motor" else 0.0)
    for k in range(LEGS):
        for joint, link in robot.owner_links(k):
            position = add(actuator, "position", name=joint, joint=joint, kp=servo.kp, kv=damping)
            position.set("ctrlrange", joined((link.angle_min, link.angle_max)))
            position.set("forcerange", joined((-servo.torque_max, servo.torque_max)))


def _stance(root: ET.Element, robot: Robot) -> None:
    """Adds the standing pose: the lowest feet touch the ground, the torso is parallel to it."""
    q_WG = _ground_quaternion(robot)
    heading = robot.terrain.heading if robot.terrain.kind == "slope" else 0.0
    q_GT = axis_quaternion(Z, -heading)
    q_WT = quaternion_product(q_WG, q_GT)
    feet = foot_positions(robot, robot.stance)
    height = robot.foot.radius - float(np.min(feet[:, 2]))  # of the torso's frame above the plane
    place = np.array([0.0, 0.0, robot.terrain.height]) + height * rotation_matrix(q_WG)[:, 2]
    key = add(add(root, "keyframe"), "key", name="stance")
    angles = robot.joints.signs * robot.stance.ravel()
    key.set("qpos", joined([*place, *q_WT, *angles]))
    key.set("ctrl", joined(angles))


def _ground_quaternion(robot: Robot) -> Array:
    """Returns q_WG (4,) of the ground: its z is the normal, its x goes uphill."""
    terrain = robot.terrain
    slope = terrain.kind == "slope"
    q_WV = axis_quaternion(Z, terrain.heading if slope else 0.0)
    q_VG = axis_quaternion(np.array([0.0, 1.0, 0.0]), -terrain.incline if slope else 0.0)
    return quaternion_product(q_WV, q_VG)
