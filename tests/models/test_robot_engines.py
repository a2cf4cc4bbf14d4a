"""Tests that other engines read the same robot from the exported URDF and MJCF files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from disguised_urdf import random_robot
from foreign_urdf import spider_urdf

from hexapod_cosim.cosim.cli.exported_files import FORMATS, export_description
from hexapod_cosim.models import LEG_NAMES, Robot, foot_positions, list_robots, load_robot
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.dynamics import mass_matrix, masses
from hexapod_cosim.models.energy import tibia_mobility
from hexapod_cosim.models.ground.faces import ground_normal
from hexapod_cosim.models.kinematics import body_states, rotation_matrix
from hexapod_cosim.models.mjcf import robot_to_mjcf
from hexapod_cosim.models.records import JOINT_NAMES
from hexapod_cosim.models.servos.motor import back_emf_damping
from hexapod_cosim.models.statics import settled
from hexapod_cosim.models.urdf.writer import robot_to_urdf

EXACT = 1e-12  # relative to the largest entry: about 1e3 times the rounding of a dozen products
# MuJoCo computes principal axes of inertias by an iteration that ends at 1e-12, and stores the axes
# as a quaternion
PRINCIPAL_AXES = 1e-9
UNKNOWNS = 24
ROBOTS = {
    **{name: load_robot(name) for name in list_robots()},
    **{f"random {seed}": random_robot(seed, pattern=seed > 1) for seed in (1, 2)},
}


@pytest.fixture(params=ROBOTS)
def robot(request: pytest.FixtureRequest) -> Robot:
    return ROBOTS[request.param]


def pose(robot: Robot, seed: int) -> tuple[Array, Array, Array]:
    """Pose of a robot: position of the torso's frame (3,), its quaternion (4,), joint angles (6,
    3).
    """
    rng = np.random.default_rng(seed)
    quaternion = rng.normal(0.0, 0.3, 4) + np.eye(4)[0]
    return (
        rng.normal(0.0, 0.3, 3),
        quaternion / np.linalg.norm(quaternion),
        robot.stance + rng.normal(0.0, 0.4, (6, 3)),
    )


def bodies(
    robot: Robot,
    place: Array,
    quaternion: Array,
    angle: Array,
    velocity: Array,
    spin: Array,
    speed: Array,
) -> Array:
    """Returns this project's bodies (19, 13) from position, velocity and angular velocity of the
    torso's frame in world axes.
    """
    arm = rotation_matrix(quaternion) @ np.array(robot.torso.com)
    return body_states(
        robot, place + arm, quaternion, velocity + np.cross(spin, arm), spin, angle, speed
    )


def our_mass_matrix(
    robot: Robot, place: Array, quaternion: Array, angle: Array, *, local_velocity: bool
) -> Array:
    """Returns the mass matrix (24, 24) for the velocity of the torso's frame (torso or world axes),
    its angular velocity in torso axes and the joint speeds.
    """
    R, columns = rotation_matrix(quaternion), []
    for unit in np.eye(UNKNOWNS):
        velocity = R @ unit[:3] if local_velocity else unit[:3]
        columns.append(
            bodies(
                robot, place, quaternion, angle, velocity, R @ unit[3:6], unit[6:].reshape(6, 3)
            )[:, 7:13].ravel()
        )
    J = np.array(columns).T
    still = bodies(robot, place, quaternion, angle, np.zeros(3), np.zeros(3), np.zeros((6, 3)))
    return np.asarray(J.T @ mass_matrix(robot, still) @ J)


def our_centre(robot: Robot, body: Array) -> Array:
    return np.asarray(masses(robot) @ body[:, :3] / robot.total_mass)


def assert_same(theirs: Any, ours: Any, tolerance: float) -> None:
    ours = np.asarray(ours)
    assert float(np.max(np.abs(np.asarray(theirs) - ours))) <= tolerance * max(
        float(np.max(np.abs(ours))), 1e-300
    )


def joint_names(form: str) -> list[str]:
    return [form.format(leg=leg, joint=joint) for leg in LEG_NAMES for joint in JOINT_NAMES]


def test_pinocchio_reads_the_urdf_as_the_robot(robot: Robot) -> None:
    model = pin.buildModelFromXML(robot_to_urdf(robot), pin.JointModelFreeFlyer())
    data = model.createData()
    assert model.nv == UNKNOWNS
    assert sum(inertia.mass for inertia in model.inertias) == pytest.approx(
        robot.total_mass, rel=EXACT
    )
    joints = [model.getJointId(name) for name in joint_names("{leg}_{joint}_joint")]
    order = [*range(6), *(model.joints[joint].idx_v for joint in joints)]
    for seed in range(4):
        place, quaternion, angle = pose(robot, seed)
        q = np.concatenate([place, quaternion[1:], quaternion[:1], np.zeros(18)])
        q[[model.joints[joint].idx_q for joint in joints]] = angle.ravel()
        light = replace(
            robot, servo=replace(robot.servo, rotor_inertia=0.0)
        )  # a URDF has no rotor inertias
        H = np.triu(pin.crba(model, data, q))
        H = (H + H.T - np.diag(np.diag(H)))[np.ix_(order, order)]
        assert_same(H, our_mass_matrix(light, place, quaternion, angle, local_velocity=True), EXACT)
        assert_same(
            pin.centerOfMass(model, data, q),
            our_centre(robot, bodies(robot, place, quaternion, angle, *still())),
            EXACT,
        )
        pin.framesForwardKinematics(model, data, q)
        feet = [data.oMf[model.getFrameId(f"{leg}_foot")].translation for leg in LEG_NAMES]
        assert_same(
            feet, place + foot_positions(robot, angle) @ rotation_matrix(quaternion).T, EXACT
        )


def still() -> tuple[Array, Array, Array]:
    return np.zeros(3), np.zeros(3), np.zeros((6, 3))


def test_the_exported_file_loads_as_viewers_load_it(robot: Robot, tmp_path: Path) -> None:
    """Pinocchio's MeshcatVisualizer needs these three models. Every body has its mass and a visible
    shape, without any mesh.
    """
    path = export_description(robot, tmp_path / "robot.urdf", FORMATS["urdf"])
    model, _, shown = pin.buildModelsFromUrdf(str(path), root_joint=pin.JointModelFreeFlyer())
    joints = [1, *(model.getJointId(name) for name in joint_names("{leg}_{joint}_joint"))]
    assert [model.inertias[joint].mass for joint in joints] == pytest.approx(
        masses(robot).tolist(), rel=EXACT
    )
    assert {geometry.parentJoint for geometry in shown.geometryObjects} == set(joints)
    for geometry in shown.geometryObjects:
        geometry.geometry.computeLocalAABB()
        assert geometry.geometry.aabb_radius > 0.0
        assert geometry.meshPath in {"BOX", "CYLINDER", "SPHERE"}


def test_exported_files_have_the_names_and_signs_of_the_owners_urdf(tmp_path: Path) -> None:
    """The same angles by name bend the legs alike in the owner's URDF, in ours and in the MJCF."""
    (tmp_path / "spider.urdf").write_text(spider_urdf(), encoding="utf-8")
    robot = load_robot(tmp_path / "spider.urdf")
    assert robot.joints.names[:3] == ("j_c3", "j_f3", "j_t3")
    again = load_robot(export_description(robot, tmp_path / "again.urdf", FORMATS["urdf"]))
    assert (again, again.joints) == (robot, robot.joints)
    angle = dict(zip(robot.joints.names, 0.1 + 0.02 * np.arange(18), strict=True))
    shins = []
    for path in ("spider.urdf", "again.urdf"):
        model = pin.buildModelFromUrdf(str(tmp_path / path), pin.JointModelFreeFlyer())
        data, q = model.createData(), pin.neutral(model)
        joints = [model.getJointId(name) for name in robot.joints.names]
        q[[model.joints[joint].idx_q for joint in joints]] = list(angle.values())
        pin.forwardKinematics(model, data, q)
        places = np.array([data.oMi[joint].translation for joint in joints]).reshape(6, 3, 3)
        shins.append(places[:, 2] - places[:, 0])
        low, high = model.lowerPositionLimit, model.upperPositionLimit
        limits = [(low[k], high[k]) for k in (model.joints[joint].idx_q for joint in joints)]
        shins.append(np.array(limits))
    assert_same(shins[2], shins[0], 1e-4)  # the owner's quarter turns are printed as 1.5708
    assert_same(shins[3], shins[1], EXACT)
    model = mujoco.MjModel.from_xml_string(robot_to_mjcf(robot))
    data = mujoco.MjData(model)
    for name, value in angle.items():
        data.joint(name).qpos[0] = value
    mujoco.mj_forward(model, data)
    places = np.array([data.joint(name).xanchor for name in angle]).reshape(6, 3, 3)
    assert_same(places[:, 2] - places[:, 0], shins[2], EXACT)
    assert [tuple(model.actuator(name).ctrlrange) for name in angle] == list(map(tuple, shins[1]))
    assert robot.joints.signs.tolist() == [1.0] * 9 + [-1.0] * 9  # the right legs' axes
    stance = [*robot.stance[:3].ravel(), *-robot.stance[3:].ravel()]
    assert model.key("stance").ctrl.tolist() == stance


def their_mass_matrix(model: Any, data: Any) -> Array:
    H = np.zeros((model.nv, model.nv))
    for column in range(model.nv):
        mujoco.mj_mulM(model, data, H[column], np.eye(model.nv)[column])
    return H


def test_mujoco_reads_the_mjcf_as_the_robot(robot: Robot) -> None:
    model = mujoco.MjModel.from_xml_string(robot_to_mjcf(robot))
    data = mujoco.MjData(model)
    for name, mass in zip(["torso", *joint_names("{leg}_{joint}")], masses(robot), strict=True):
        assert float(model.body(name).mass[0]) == mass
    for seed in range(4):
        place, quaternion, angle = pose(robot, seed)
        data.qpos[:] = np.concatenate([place, quaternion, angle.ravel()])
        mujoco.mj_forward(model, data)
        assert_same(
            their_mass_matrix(model, data),
            our_mass_matrix(robot, place, quaternion, angle, local_velocity=False),
            PRINCIPAL_AXES,
        )
        assert_same(
            data.subtree_com[0],
            our_centre(robot, bodies(robot, place, quaternion, angle, *still())),
            EXACT,
        )
        feet = [data.site(f"{leg}_foot").xpos for leg in LEG_NAMES]
        assert_same(
            feet, place + foot_positions(robot, angle) @ rotation_matrix(quaternion).T, EXACT
        )


def test_mujocos_joints_and_servos_are_the_robots(robot: Robot) -> None:
    model = mujoco.MjModel.from_xml_string(robot_to_mjcf(robot))
    assert np.array_equal(
        model.jnt_range[1:], np.stack([robot.angle_min.ravel(), robot.angle_max.ravel()], axis=1)
    )
    assert set(model.dof_armature[6:]) == {robot.servo.rotor_inertia}
    assert set(model.dof_frictionloss[6:]) == {robot.servo.coulomb_friction}
    assert set(model.actuator_gainprm[:, 0]) == {robot.servo.kp}
    motor = robot.servo.drive == "motor"  # whose back-EMF damps, too
    damping = robot.servo.kd + (back_emf_damping(robot.servo) if motor else 0.0)
    assert set(model.actuator_biasprm[:, 2]) == {-damping}
    assert set(model.actuator_forcerange[:, 1]) == {robot.servo.torque_max}
    assert tuple(model.opt.gravity) == robot.gravity


def test_mujoco_agrees_on_how_easily_a_tibia_moves(robot: Robot) -> None:
    model = mujoco.MjModel.from_xml_string(robot_to_mjcf(robot))
    theirs = [model.body(f"{leg}_tibia").invweight0[0] for leg in LEG_NAMES]
    assert tibia_mobility(robot) == pytest.approx(np.mean(theirs), rel=PRINCIPAL_AXES)


@pytest.mark.parametrize("name", list_robots())
def test_in_mujoco_the_robot_stands_as_deep_in_the_ground_as_hertz_says(name: str) -> None:
    robot = load_robot(name)
    model = mujoco.MjModel.from_xml_string(robot_to_mjcf(robot))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("stance").id)
    for _ in range(2000):
        mujoco.mj_step(model, data)
    assert data.ncon == 6
    assert sum(contact_force(model, data, k) for k in range(6)) == pytest.approx(
        robot.weight, rel=1e-3
    )  # after the last oscillation
    tripod = (robot.weight / 3.0 / robot.contact.stiffness) ** (2.0 / 3.0)
    # a linear spring that is right at a third of the weight has half of that depth at a sixth; the
    # mobility differs by leg and pose
    assert np.mean([-contact.dist for contact in data.contact]) == pytest.approx(
        0.5 * tripod, rel=0.1
    )
    # MuJoCo's feet stick and hold legs that would spread on feet that creep; rigid legs would hold
    # the torso higher
    rigid = robot.foot.radius - foot_positions(robot, robot.stance)[:, 2].min() + robot.torso.com[2]
    height = (data.qpos[:3] + rotation_matrix(data.qpos[3:7]) @ np.array(robot.torso.com))[2]
    assert settled(robot)[0][2] - tripod < height < rigid


def contact_force(model: Any, data: Any, number: int) -> float:
    force = np.zeros(6)
    mujoco.mj_contactForce(model, data, number, force)
    return float(force[0])


def test_mujocos_ground_is_the_robots_slope() -> None:
    robot = load_robot("athena")
    robot = replace(
        robot, terrain=replace(robot.terrain, kind="slope", height=0.03, incline=0.15, heading=0.7)
    )
    model = mujoco.MjModel.from_xml_string(robot_to_mjcf(robot))
    ground = model.geom("ground")
    assert rotation_matrix(ground.quat)[:, 2] == pytest.approx(
        ground_normal(robot.terrain), abs=EXACT
    )
    assert tuple(ground.pos) == (0.0, 0.0, 0.03)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    feet = np.array([data.site(f"{leg}_foot").xpos for leg in LEG_NAMES]) - ground.pos
    assert feet @ ground_normal(robot.terrain) == pytest.approx(
        np.full(6, robot.foot.radius), abs=1e-9
    )  # m, flatness of the stance
