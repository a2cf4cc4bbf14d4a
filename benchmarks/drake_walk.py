"""Runs a walk in Drake: `drake_walk.py WALK METHOD STEP REPEATS PATH_OUT`.

Command line and output are those of the native drivers (native/driver.h).

The robot is that of the plant: same tree, inertias, reflected rotor inertias and PD gains. The
contact is Drake's own, since Drake's wheel contains no C++ headers and a law in a Python callback
would measure Python: point contact between foot and half space, linear in depth with Hunt-Crossley
dissipation, regularised Coulomb friction. Its stiffness is chosen for the same depth under the
standing robot, its dissipation for the requested restitution at IMPACT_SPEED, its stiction
tolerance for the same slope of friction at rest. The motors are Drake's PD actuators with their
effort limit; Drake has no torque-speed line, and the gears' dry friction is left out. The paths
therefore differ from the plant's, and each of Drake's three models is judged by its own converged
solution: the continuous plant's (runge_kutta3 at 1e-5), CENIC's (cenic at 1e-6) and the
time-stepping plant's (discrete at 5e-5 s). Their friction differs.

METHOD: one of Drake's integration schemes, STEP its accuracy; or `discrete`, the time-stepping
plant (lagged), STEP its period in s. Evaluations are those of the right-hand side, or steps where
Drake does not count them (discrete and CENIC, which solves one convex problem per step).
Microseconds per evaluation are those of CalcTimeDerivatives, less the time to set a new state, and
null for the discrete plant.
"""

from __future__ import annotations

import ctypes as ct
import json
import logging
import math
import struct
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.common.eigen_geometry import Quaternion
from pydrake.geometry import AddContactMaterial, HalfSpace, ProximityProperties, Sphere
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import (
    AddMultibodyPlant,
    CoulombFriction,
    MultibodyPlant,
    MultibodyPlantConfig,
)
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    PdControllerGains,
    RevoluteJoint,
    RigidBody,
    RotationalInertia,
    SpatialInertia,
)
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import Context, Diagram, DiagramBuilder

sys.path.append(str(Path(__file__).resolve().parents[1] / "tests" / "support"))
sys.path.append(str(Path(__file__).resolve().parents[1] / "build" / "typing"))  # `make typing`
from mirror import JOINTS, LEGS, HxDefinition, HxInput

Array = NDArray[np.float64]

IMPACT_SPEED = 0.1  # m/s  a walk's usual touch-down
RIGID = 1e12  # N/m  the ground's, beside the foot's
EVALUATIONS = 2000


@dataclass(frozen=True, kw_only=True)
class Recording:
    """Content of a walk file: the robot, and n commands, each constant over h [s]."""

    robot: Any
    h: float
    inputs: list[Any]


def read_walk(path: str) -> Recording:
    """Reads a walk file."""
    data, start = Path(path).read_bytes(), ct.sizeof(HxDefinition)
    n, h = struct.unpack_from("=qd", data, start)
    inputs = (HxInput * n).from_buffer_copy(data, start + struct.calcsize("=qd"))
    return Recording(robot=HxDefinition.from_buffer_copy(data), h=h, inputs=list(inputs))


@dataclass(frozen=True, kw_only=True)
class Model:
    """The diagram, its plant and its torso."""

    diagram: Diagram
    plant: MultibodyPlant
    torso: RigidBody


def build(robot: Any, *, time_step: float) -> Model:
    """Builds the robot on its ground; time_step 0 [s] gives the continuous plant."""
    builder = DiagramBuilder()
    config = MultibodyPlantConfig(
        time_step=time_step,
        contact_model="point",
        discrete_contact_approximation="lagged",
        stiction_tolerance=1.0 / robot.friction.slope,
    )
    plant, _ = AddMultibodyPlant(config, builder)
    plant.mutable_gravity_field().set_gravity_vector(np.array(robot.gravity))
    torso = add_link(plant, "torso", robot.torso)
    for leg in range(LEGS):
        add_leg(plant, robot, leg, torso)
    add_ground(plant, robot)
    plant.Finalize()
    return Model(diagram=builder.Build(), plant=plant, torso=torso)


def add_link(plant: MultibodyPlant, name: str, link: Any) -> RigidBody:
    """Adds a body with mass [kg], centre of mass [m] and inertia about it [kg m2]."""
    about_centre = RotationalInertia(*link.inertia)
    inertia = SpatialInertia.MakeFromCentralInertia(link.mass, np.array(link.com), about_centre)
    return plant.AddRigidBody(name, inertia)


def add_leg(plant: MultibodyPlant, robot: Any, leg: int, torso: RigidBody) -> None:
    """Adds three links with their joints and motors, and a foot."""
    hip = RigidTransform(
        RotationMatrix.MakeZRotation(robot.leg[leg].hip_yaw), np.array(robot.leg[leg].hip_position)
    )
    parent, place = torso, hip
    for k in range(JOINTS):
        link, name = robot.leg[leg].link[k], f"{leg}-{k}"
        body = add_link(plant, name, link)
        frame = plant.AddFrame(FixedOffsetFrame(f"joint-{name}", parent.body_frame(), place))
        joint = plant.AddJoint(RevoluteJoint(name, frame, body.body_frame(), np.array(link.axis)))
        actuator = plant.AddJointActuator(name, joint, robot.servo.torque_max)
        actuator.set_default_rotor_inertia(robot.servo.rotor_inertia)
        actuator.set_default_gear_ratio(1.0)
        actuator.set_controller_gains(PdControllerGains(p=robot.servo.kp, d=robot.servo.kd))
        parent, place = body, RigidTransform(np.array([link.length, link.offset_y, link.offset_z]))
    plant.RegisterCollisionGeometry(
        parent, place, Sphere(robot.foot_radius), f"foot-{leg}", foot_material(robot)
    )


def foot_material(robot: Any) -> ProximityProperties:
    """Returns the material of a foot.

    Under a sixth of the weight its depth is that of the plant's foot; at IMPACT_SPEED its
    restitution is the requested one.
    """
    masses = robot.torso.mass + sum(link.mass for leg in robot.leg for link in leg.link)
    load = masses * float(np.linalg.norm(robot.gravity)) / LEGS
    depth = (load / robot.contact.stiffness) ** (2.0 / 3.0)
    chi = exact_restitution_chi(robot.contact.restitution)
    return material(load / depth, chi / IMPACT_SPEED, robot.friction.mu)


def material(stiffness: float, dissipation: float, mu: float) -> ProximityProperties:
    """Returns a material with stiffness [N/m], Hunt-Crossley dissipation [s/m] and friction."""
    properties, friction = ProximityProperties(), CoulombFriction(mu, mu)
    AddContactMaterial(
        dissipation=dissipation, point_stiffness=stiffness, friction=friction, properties=properties
    )
    return properties


def exact_restitution_chi(e: float) -> float:
    """Returns the root of chi (1 + e) = ln[(1 + chi)/(1 - chi e)] other than 0."""
    low, high = 0.0, 1.0 / e
    for _ in range(100 if e < 1.0 else 0):
        chi = 0.5 * (low + high)
        below = math.log1p(chi) - math.log1p(-chi * e) < chi * (1.0 + e)
        low, high = (chi, high) if below else (low, chi)
    return low


def add_ground(plant: MultibodyPlant, robot: Any) -> None:
    """Adds a rigid half space through (0, 0, height) that rises along the heading."""
    terrain = robot.terrain
    incline = terrain.incline if terrain.kind == 2 else 0.0
    slope, heading = -math.sin(incline), terrain.heading
    normal = np.array([slope * math.cos(heading), slope * math.sin(heading), math.cos(incline)])
    pose = HalfSpace.MakePose(normal, np.array([0.0, 0.0, terrain.height]))
    plant.RegisterCollisionGeometry(
        plant.world_body(), pose, HalfSpace(), "ground", material(RIGID, 0.0, robot.friction.mu)
    )


def put_at_start(model: Model, robot: Any, context: Context) -> None:
    """Sets the initial state of the definition."""
    plant, at = model.plant, robot.initial
    own = plant.GetMyMutableContextFromRoot(context)
    R_WT = RotationMatrix(Quaternion(np.array(at.quaternion) / np.linalg.norm(at.quaternion)))
    origin = np.array(at.position) - R_WT @ np.array(robot.torso.com)
    plant.SetFreeBodyPose(own, model.torso, RigidTransform(R_WT, origin))
    for leg in range(LEGS):
        for k in range(JOINTS):
            joint = plant.GetJointByName(f"{leg}-{k}")
            joint.set_angle(own, at.angle[leg][k])
            joint.set_angular_rate(own, at.speed[leg][k])


def set_command(model: Model, context: Context, command: Any) -> None:
    """Sets the command of the motors."""
    plant = model.plant
    instance = plant.GetModelInstanceByName("DefaultModelInstance")
    own = plant.GetMyMutableContextFromRoot(context)
    plant.get_desired_state_input_port(instance).FixValue(
        own, np.concatenate([np.ravel(command.angle_ref), np.ravel(command.speed_ref)])
    )
    plant.get_actuation_input_port(instance).FixValue(own, np.ravel(command.torque_ref))


def torso_position(model: Model, robot: Any, context: Context) -> Array:
    """Returns the position of the torso's centre of mass in world axes (3,) [m]."""
    pose = model.plant.EvalBodyPoseInWorld(model.plant.GetMyContextFromRoot(context), model.torso)
    return np.asarray(pose.multiply(np.array(robot.torso.com)))


def simulator_of(model: Model, method: str, step: float, h: float) -> Simulator:
    """Returns a simulator for METHOD and STEP, with steps of at most h [s]."""
    simulator = Simulator(model.diagram)
    if method != "discrete":
        integrator = ResetIntegratorFromFlags(simulator, method, h)
        integrator.set_target_accuracy(step)
    return simulator


def walk_once(model: Model, walk: Recording, method: str, step: float) -> tuple[float, int, Array]:
    """Returns the loop's time [s], evaluations (or steps), and the path (n + 1, 3) [m]."""
    simulator = simulator_of(model, method, step, walk.h)
    context = simulator.get_mutable_context()
    put_at_start(model, walk.robot, context)
    set_command(model, context, walk.inputs[0])
    simulator.Initialize()
    path = [torso_position(model, walk.robot, context)]
    begin = time.perf_counter()
    for k, command in enumerate(walk.inputs):
        set_command(model, context, command)
        simulator.AdvanceTo((k + 1) * walk.h)
        path.append(torso_position(model, walk.robot, context))
    seconds = time.perf_counter() - begin
    evaluations = 0
    if method != "discrete":
        evaluations = simulator.get_integrator().get_num_derivative_evaluations()
    return seconds, evaluations or simulator.get_num_steps_taken(), np.array(path)


def microseconds_per_evaluation(model: Model, walk: Recording) -> float:
    """Returns the time of CalcTimeDerivatives [us], evaluated at a new state each time."""
    context = model.diagram.CreateDefaultContext()
    put_at_start(model, walk.robot, context)
    set_command(model, context, walk.inputs[0])
    state = context.get_continuous_state_vector().CopyToVector()
    result = model.diagram.AllocateTimeDerivatives()

    def move() -> None:
        np.add(state, 1e-9, out=state)
        context.SetContinuousState(state)

    def evaluate() -> None:
        move()
        model.diagram.CalcTimeDerivatives(context, result)

    return 1e6 * (mean_seconds(evaluate) - mean_seconds(move))


def mean_seconds(action: Callable[[], None]) -> float:
    """Returns the mean time of one call [s]."""
    begin = time.perf_counter()
    for _ in range(EVALUATIONS):
        action()
    return (time.perf_counter() - begin) / EVALUATIONS


def main(walk_path: str, method: str, step: str, repeats: str, path_out: str) -> None:
    """Runs, writes the path and prints the JSON line."""
    # Drake warns about half spaces and deformable bodies, but the model has no deformable bodies
    logging.getLogger("drake").setLevel(logging.ERROR)
    walk, size = read_walk(walk_path), float(step)
    discrete = method == "discrete"
    model = build(walk.robot, time_step=size if discrete else 0.0)
    seconds = []
    for _ in range(int(repeats)):
        taken, evaluations, path = walk_once(model, walk, method, size)
        seconds.append(taken)
    path.tofile(path_out)
    each = None if discrete else microseconds_per_evaluation(model, walk)
    found = {"seconds": seconds, "evaluations": evaluations, "microseconds_per_evaluation": each}
    print(json.dumps(found))


if __name__ == "__main__":
    if len(sys.argv) != 6:
        sys.exit("usage: drake_walk.py WALK METHOD STEP REPEATS PATH_OUT")
    main(*sys.argv[1:])
