"""Provides robots of the same shape and density in other sizes, by Froude's similarity.

Lengths are multiplied by l, masses by l^3, times by sqrt(l).
"""

from __future__ import annotations

from dataclasses import replace

from hexapod_cosim.models import Robot
from hexapod_cosim.models.contact.law import Contact
from hexapod_cosim.models.friction import Friction
from hexapod_cosim.models.records import Leg, Link, Servo, Vector3, Vector6


def scaled_robot(robot: Robot, by: float) -> Robot:
    """Returns a robot whose motion is similar, with times multiplied by sqrt(by).

    Forces are multiplied by by^3, torques by by^4, moduli of elasticity by by.
    """
    time = by**0.5
    torso, foot, baumgarte, gait = robot.torso, robot.foot, robot.baumgarte, robot.gait
    return replace(
        robot,
        name=f"{robot.name}_times_{by:g}",
        torso=replace(
            torso,
            mass=by**3 * torso.mass,
            size=_scaled_vector(torso.size, by),
            com=_scaled_vector(torso.com, by),
            inertia=_scaled_inertia(torso.inertia, by),
        ),
        legs=tuple(_scaled_leg(leg, by) for leg in robot.legs),
        foot=replace(foot, radius=by * foot.radius, youngs_modulus=by * foot.youngs_modulus),
        contact=_scaled_contact(robot.contact, by),
        friction=_scaled_friction(robot.friction, by),
        servo=_scaled_servo(robot.servo, by),
        baumgarte=replace(baumgarte, alpha=baumgarte.alpha / time, beta=baumgarte.beta / time),
        solver=replace(
            robot.solver, step=time * robot.solver.step, step_max=time * robot.solver.step_max
        ),
        gait=replace(
            gait,
            period=time * gait.period,
            stride=by * gait.stride,
            step_height=by * gait.step_height,
        ),
    )


def _scaled_vector(values: Vector3, by: float) -> Vector3:
    x, y, z = values
    return by * x, by * y, by * z


def _scaled_inertia(inertia: Vector6, by: float) -> Vector6:
    xx, yy, zz, xy, xz, yz = (by**5 * value for value in inertia)
    return xx, yy, zz, xy, xz, yz


def _scaled_leg(leg: Leg, by: float) -> Leg:
    coxa, femur, tibia = (_scaled_link(link, by) for link in leg.links)
    return replace(
        leg, hip_position=_scaled_vector(leg.hip_position, by), links=(coxa, femur, tibia)
    )


def _scaled_link(link: Link, by: float) -> Link:
    return replace(
        link,
        mass=by**3 * link.mass,
        com=_scaled_vector(link.com, by),
        inertia=_scaled_inertia(link.inertia, by),
        length=by * link.length,
        offset_y=by * link.offset_y,
        offset_z=by * link.offset_z,
    )


def _scaled_contact(contact: Contact, by: float) -> Contact:
    """Scales the contact, whose stiffness K in F = K d^1.5 is proportional to sqrt(R) E."""
    return replace(
        contact,
        stiffness=by**1.5 * contact.stiffness,
        damping_factor=contact.damping_factor / by**0.5,
        impact_speed_floor=contact.impact_speed_floor * by**0.5,
    )


def _scaled_friction(friction: Friction, by: float) -> Friction:
    return replace(
        friction,
        slope=friction.slope / by**0.5,
        presliding=by * friction.presliding,
        bristle_damping=by**0.5 * friction.bristle_damping,
    )


def _scaled_servo(servo: Servo, by: float) -> Servo:
    return replace(
        servo,
        kp=by**4 * servo.kp,
        kd=by**4 * by**0.5 * servo.kd,
        torque_max=by**4 * servo.torque_max,
        speed_max=servo.speed_max / by**0.5,
        rotor_inertia=by**5 * servo.rotor_inertia,
        coulomb_friction=by**4 * servo.coulomb_friction,
        torque_continuous=by**4 * servo.torque_continuous,
    )
