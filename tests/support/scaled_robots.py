"""A robot of the same shape and density, so many times as large: Froude's similarity.

Lengths go with l, masses with l^3, times with sqrt(l).
"""

from __future__ import annotations

from dataclasses import replace

from hexapod_cosim.models import Robot
from hexapod_cosim.models.records import Leg, Link, Vector3, Vector6


def scaled_robot(robot: Robot, by: float) -> Robot:
    """Returns a robot whose motion is similar, with times multiplied by sqrt(by).

    Forces are multiplied by by^3, torques by by^4, moduli of elasticity by by.
    """
    time = by**0.5

    def long(values: Vector3) -> Vector3:
        x, y, z = values
        return by * x, by * y, by * z

    def heavy(inertia: Vector6) -> Vector6:
        xx, yy, zz, xy, xz, yz = (by**5 * value for value in inertia)
        return xx, yy, zz, xy, xz, yz

    def link(of: Link) -> Link:
        return replace(
            of, mass=by**3 * of.mass, com=long(of.com), inertia=heavy(of.inertia),
            length=by * of.length, offset_y=by * of.offset_y, offset_z=by * of.offset_z,
        )  # fmt: skip

    def leg(of: Leg) -> Leg:
        coxa, femur, tibia = of.links
        return replace(
            of, hip_position=long(of.hip_position), links=(link(coxa), link(femur), link(tibia))
        )

    torso, servo, contact, friction, gait = (
        robot.torso,
        robot.servo,
        robot.contact,
        robot.friction,
        robot.gait,
    )
    return replace(
        robot,
        name=f"{robot.name}_times_{by:g}",
        torso=replace(
            torso,
            mass=by**3 * torso.mass,
            size=long(torso.size),
            com=long(torso.com),
            inertia=heavy(torso.inertia),
        ),
        legs=tuple(map(leg, robot.legs)),
        foot=replace(
            robot.foot, radius=by * robot.foot.radius, youngs_modulus=by * robot.foot.youngs_modulus
        ),
        # K of F = K d^1.5: sqrt(R) E
        contact=replace(
            contact,
            stiffness=by**1.5 * contact.stiffness,
            damping_factor=contact.damping_factor / time,
            impact_speed_floor=contact.impact_speed_floor * time,
        ),
        friction=replace(
            friction,
            slope=friction.slope / time,
            presliding=by * friction.presliding,
            bristle_damping=time * friction.bristle_damping,
        ),
        servo=replace(
            servo,
            kp=by**4 * servo.kp,
            kd=by**4 * time * servo.kd,
            torque_max=by**4 * servo.torque_max,
            speed_max=servo.speed_max / time,
            rotor_inertia=by**5 * servo.rotor_inertia,
            coulomb_friction=by**4 * servo.coulomb_friction,
            torque_continuous=by**4 * servo.torque_continuous,
        ),
        baumgarte=replace(
            robot.baumgarte, alpha=robot.baumgarte.alpha / time, beta=robot.baumgarte.beta / time
        ),
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
