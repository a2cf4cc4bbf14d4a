"""Defines the robot: its data, its files, and a dense reference implementation of the equations of
motion.
"""

from hexapod_cosim.models.contact.law import (
    BODY_CONTACTS,
    CONTACT_LAWS,
    SELF_CONTACTS,
    BodyContact,
    Contact,
)
from hexapod_cosim.models.errors import (
    FmuError,
    HexapodError,
    ReachError,
    RobotError,
    ScenarioError,
    suggestion,
    unknown_name,
)
from hexapod_cosim.models.friction import FRICTION_LAWS, Friction
from hexapod_cosim.models.ground.surface import TERRAINS, Terrain
from hexapod_cosim.models.kinematics import foot_position, foot_positions
from hexapod_cosim.models.method import METHODS, PROJECTIONS, Baumgarte, Solver
from hexapod_cosim.models.records import (
    GAITS,
    JOINT_NAMES,
    LEG_NAMES,
    SERVO_DRIVES,
    SERVO_MODES,
    Foot,
    Gait,
    Leg,
    Link,
    Robot,
    Servo,
    Torso,
)
from hexapod_cosim.models.robot import (
    box_inertia,
    hertz_stiffness,
    list_robots,
    load_robot,
    robot_from_table,
)
from hexapod_cosim.models.soil.presets import SOIL_LAWS, Soil
from hexapod_cosim.models.validation import check_robot

__all__ = [
    "BODY_CONTACTS", "CONTACT_LAWS", "FRICTION_LAWS", "GAITS", "JOINT_NAMES", "LEG_NAMES",
    "METHODS", "PROJECTIONS", "SELF_CONTACTS", "SERVO_DRIVES", "SERVO_MODES", "SOIL_LAWS",
    "TERRAINS", "Baumgarte", "BodyContact", "Contact", "FmuError", "Foot", "Friction", "Gait",
    "HexapodError", "Leg", "Link", "ReachError", "Robot", "RobotError", "ScenarioError", "Servo",
    "Soil", "Solver", "Terrain", "Torso", "box_inertia", "check_robot", "foot_position",
    "foot_positions", "hertz_stiffness", "list_robots", "load_robot", "robot_from_table",
    "suggestion", "unknown_name",
]  # fmt: skip
