"""Mirrors the structures, constants and statuses of hexapod.h in ctypes.

test_plant_functions.py compares them with the compiler's layout.
"""

from __future__ import annotations

import ctypes as ct
from typing import Any

LEGS, JOINTS, BODIES, BODY_STATE, MULTIPLIERS, MESSAGE_SIZE, CONE_BINS = 6, 3, 19, 13, 5, 512, 31

OK, INVALID_ARGUMENT, INVALID_MODEL, STEP_TOO_SMALL, NOT_FINITE, OUT_OF_MEMORY, BAD_STATE = range(7)

Real = ct.c_double
Doubles = ct.POINTER(Real)
Vector3, Vector4, Vector6 = Real * 3, Real * 4, Real * 6
PerLeg, PerJoint = Real * LEGS, (Real * JOINTS) * LEGS
LegVectors, JointVectors = (Real * 3) * LEGS, ((Real * 3) * JOINTS) * LEGS


def record(name: str, *fields: tuple[str, Any]) -> type[ct.Structure]:
    """Makes a structure type with these fields."""
    return type(name, (ct.Structure,), {"_fields_": list(fields)})


def reals(names: str) -> list[tuple[str, Any]]:
    """Returns fields of type double, from names separated by spaces."""
    return [(name, Real) for name in names.split()]


HxLink = record(
    "HxLink",
    *reals("mass length offset_y offset_z"),
    ("com", Vector3),
    ("inertia", Vector6),
    ("axis", Vector3),
    *reals("angle_min angle_max"),
)
HxLeg = record("HxLeg", ("hip_position", Vector3), ("hip_yaw", Real), ("link", HxLink * JOINTS))
HxSoilDefinition = record(
    "HxSoilDefinition",
    ("law", ct.c_int),
    *reals(
        "frictional_modulus cohesive_modulus exponent resistance alpha_down alpha_side alpha_ahead "
        "yield_pressure hardening cohesion friction_angle shear_displacement stiffness damping"
    ),
)
HxDefinition = record(
    "HxDefinition",
    ("torso", record("Torso", ("mass", Real), ("com", Vector3), ("inertia", Vector6))),
    ("leg", HxLeg * LEGS),
    ("foot_radius", Real),
    (
        "body",
        record(
            "Body",
            ("contact", ct.c_int),
            ("self_contact", ct.c_int),
            ("torso_box", Vector3),
            ("torso_centre", Vector3),
            *reals("corner_radius knee_radius shank_radius shank_position"),
        ),
    ),
    ("foot_pad_radius", Real),
    (
        "contact",
        record(
            "Contact",
            ("law", ct.c_int),
            *reals("stiffness restitution damping_factor impact_speed_floor"),
        ),
    ),
    (
        "friction",
        record(
            "Friction",
            ("law", ct.c_int),
            *reals(
                "mu slope presliding bristle_damping mu_static stribeck_speed viscous "
                "spin_radius rolling_radius"
            ),
        ),
    ),
    (
        "servo",
        record(
            "Servo",
            ("mode", ct.c_int),
            ("drive", ct.c_int),
            *reals(
                "kp kd torque_max speed_max rotor_inertia coulomb_friction stop_stiffness "
                "stop_damping voltage duty_max torque_constant resistance viscous_friction "
                "stribeck_friction motor_load_friction external_load_friction "
                "stribeck_motor_load_friction stribeck_external_load_friction "
                "quadratic_motor_friction quadratic_external_friction stribeck_speed "
                "stribeck_exponent friction_speed winding_capacity housing_capacity "
                "winding_to_housing housing_to_air air_temperature start_temperature "
                "derate_temperature temperature_max supply_resistance "
                "bus_period command_step gear_stiffness gear_damping backlash gear_ratio"
            ),
        ),
    ),
    ("baumgarte", record("Baumgarte", *reals("alpha beta"))),
    ("gravity", Vector3),
    (
        "solver",
        record(
            "Solver",
            ("method", ct.c_int),
            *reals("step tolerance step_max"),
            ("projection", ct.c_int),
        ),
    ),
    ("terrain", record("Terrain", ("kind", ct.c_int), *reals("height incline heading grid"))),
    ("soil", HxSoilDefinition),
    (
        "initial",
        record(
            "Initial",
            ("position", Vector3),
            ("quaternion", Vector4),
            ("velocity", Vector3),
            ("angular_velocity", Vector3),
            ("angle", PerJoint),
            ("speed", PerJoint),
        ),
    ),
)
HxInput = record(
    "HxInput",
    ("angle_ref", PerJoint),
    ("speed_ref", PerJoint),
    ("torque_ref", PerJoint),
    ("push_force", Vector3),
    ("push_torque", Vector3),
    ("acceleration_ref", PerJoint),
)
HxCoordinates = record(
    "HxCoordinates",
    ("position", Vector3),
    ("quaternion", Vector4),
    ("velocity", Vector3),
    ("angular_velocity", Vector3),
    ("angle", PerJoint),
    ("speed", PerJoint),
    *reals("actuator_work push_work dissipated"),
    ("bristle", LegVectors),
)
HxOutput = record(
    "HxOutput",
    ("time", Real),
    ("angle", PerJoint),
    ("speed", PerJoint),
    ("torque", PerJoint),
    ("positive_work", PerJoint),
    ("negative_work", PerJoint),
    ("torque_squared", PerJoint),
    ("reaction_force", JointVectors),
    ("reaction_torque", JointVectors),
    (
        "foot",
        record(
            "FootOutput",
            ("force", LegVectors),
            ("normal_force", PerLeg),
            ("tangential_force", PerLeg),
            ("position", LegVectors),
            ("velocity", LegVectors),
            ("slip_speed", PerLeg),
            ("bristle", LegVectors),
            ("penetration", PerLeg),
            ("impact_speed", PerLeg),
            ("slip_distance", PerLeg),
            ("impulse", PerLeg),
            ("peak_force", PerLeg),
            ("peak_force_rate", PerLeg),
            ("landing_rate", PerLeg),
            ("landings", PerLeg),
            ("sinkage", PerLeg),
            ("contact", ct.c_int * LEGS),
        ),
    ),
    (
        "torso",
        record(
            "TorsoOutput",
            ("position", Vector3),
            ("quaternion", Vector4),
            *reals("roll pitch yaw"),
            ("velocity", Vector3),
            ("angular_velocity", Vector3),
            ("contact_force", Vector3),
        ),
    ),
    (
        "body",
        record(
            "BodyOutput",
            ("knee_force", LegVectors),
            ("shank_force", LegVectors),
            ("clearance", PerLeg),
            ("neighbour_force", LegVectors),
        ),
    ),
    ("imu", record("ImuOutput", ("specific_force", Vector3), ("angular_velocity", Vector3))),
    (
        "energy",
        record(
            "EnergyOutput",
            *reals(
                "kinetic potential actuator_work push_work dissipated contact_loss "
                "friction_loss gear_loss residual"
            ),
        ),
    ),
    ("constraint", record("ConstraintOutput", *reals("position_error velocity_error"))),
    ("solver", record("SolverOutput", *reals("evaluations steps rejected touchdowns"))),
    ("footprints", Real),
    ("cone_time", Real * CONE_BINS),
    ("current", PerJoint),
    ("electrical_power", PerJoint),
    ("winding_temperature", PerJoint),
    ("housing_temperature", PerJoint),
    ("remaining_rating", PerJoint),
    ("supply_voltage", Real),
    ("gear_deflection", PerJoint),
    ("motor_speed", PerJoint),
    (
        "depth",
        record(
            "Indicators",
            ("foot", PerLeg),
            ("knee", PerLeg),
            ("shank", PerLeg),
            ("torso", Real * 8),
            ("neighbour", (Real * 4) * LEGS),
        ),
    ),
)
