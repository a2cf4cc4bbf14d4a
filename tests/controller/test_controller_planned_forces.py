"""The plan of a walking controller, given to the multibody twin: its torques and foot forces
make the planned motion.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from gains import PERIOD, make_gains, unwatched, weight
from states import changed, with_links
from twin_motion import Motion, Z, twin_needs

from hexapod_cosim.controller import BodyCommand, Controller, Gait, Measurement, Parts, make_gait
from hexapod_cosim.controller.comply.load_plan import LoadPlan
from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.actuator import GEAR_SPEED
from hexapod_cosim.models.dynamics import mass_matrix
from hexapod_cosim.models.kinematics import foot_centres

ROBOTS = ("athena", "phantomx_mk4")
POINT = (1e-12, 1e-12, 1e-12, 0.0, 0.0, 0.0)  # kg m2
BEGUN = 250  # steps    a cycle to ramp the command up, and some
COMMANDS = {
    "straight": BodyCommand(vx=0.08),
    "sideways": BodyCommand(vx=0.03, vy=0.03),
    "turning": BodyCommand(vx=0.04, yaw_rate=0.2),
    "leaning": BodyCommand(vx=0.05, height=0.01, roll=0.05, pitch=-0.04),
}
CARRIED = (
    0.01  # N    of 55: the feet that touch are so few that RIDGE still shows, and no foot pulls
)
# m    from the path, along which the shares are reckoned, to the contact point of the foot that
# rolls on it
ROLLED = 1.2e-3
# N m    of 12 links of up to 5e-4 kg m2 at some 10 rad/s2, half of them against the others
LEGS_SWING = 0.015
SWEPT = 1e-5  # N m    the twin's axes turn by (h w)^2 in a period
LINK_TURNS = 0.01  # N m    5e-4 kg m2 x 20 rad/s2: what is left out of a joint's torque
INERTIAS = {"points": SWEPT, "real": LINK_TURNS}


class Step(NamedTuple):
    """A step of a walk: what it asks of the laws, and the planned motion of which it is the
    middle.
    """

    plan: LoadPlan
    motion: Motion


def walker(robot: Robot, gait: Gait) -> Controller:
    """A controller whose joint speeds are the planned ones."""
    parts = Parts(touchdown=False)
    return unwatched(
        Controller(robot, period=PERIOD, gait=gait, gains=make_gains(robot), parts=parts)
    )


def present(controller: Controller) -> Step | None:
    """The present step; None where a section of the walk begins or ends."""
    before, now, after = controller.plan.before, controller.plan.now, controller.plan.after
    if before is None or after is None:
        return None
    compliant, steps = controller.compliant, (before, now, after)
    assert compliant is not None
    way, yaw = (
        np.array([step.feet.way for step in steps]),
        np.array([step.feet.turn for step in steps]),
    )
    posture, angle = (
        np.array([step.value[3:] for step in steps]),
        np.array([step.pose.angle for step in steps]),
    )
    speed = np.array([np.full((6, 3), np.nan), controller._out.speed_ref, np.full((6, 3), np.nan)])
    return Step(compliant.present.load, Motion(PERIOD, way, yaw, posture, angle, speed))


def planned(robot: Robot, command: BodyCommand, gait: Gait | None = None) -> list[Step]:
    """The inner steps of a section of a walk, from a lift-off or touch-down to the next."""
    controller, steps, found = (
        walker(robot, make_gait(robot, step_height=0.02) if gait is None else gait),
        0,
        list[Step](),
    )
    while steps < BEGUN or not found or controller.plan.after is not None:
        controller.step(steps * PERIOD, command, Measurement())
        steps += 1
        if steps < BEGUN:
            continue
        step = present(controller)
        if step is not None and (found or controller.plan.at == 2):
            found.append(step)
    return found


def given_and_needed(robot: Robot, step: Step) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(24,) what the plan gives the twin, (24,) what its motion needs, and the mass matrix (24,
    24) of torso and joints.
    """
    plan, motion, at = step.plan, step.motion, 1
    needed, body, reach = twin_needs(robot, motion, at)
    c, s = np.cos(motion.yaw[at]), np.sin(motion.yaw[at])
    force = plan.shares.forces() @ np.array([[c, s, 0.0], [-s, c, 0.0], Z])
    given, moves = np.zeros(24), reach.reshape(19, 6, 24)
    for leg, (f, centre) in enumerate(zip(force, foot_centres(robot, body), strict=True)):
        tibia = 3 * leg + 3
        arm = centre - robot.foot.radius * Z - body[tibia, :3]
        given += moves[tibia, :3].T @ f + moves[tibia, 3:].T @ np.cross(arm, f)
    gear = robot.servo.coulomb_friction * np.tanh(motion.speed[at] / GEAR_SPEED)
    given[6:] += (plan.own + plan.carry - gear).ravel()
    return given, needed, reach.T @ mass_matrix(robot, body) @ reach


@pytest.mark.parametrize("inertias", INERTIAS)
@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("name", ROBOTS)
def test_planned_torques_and_forces_move_the_twin_as_planned(
    name: str, command: str, inertias: str
) -> None:
    robot, leans = load_robot(name), command == "leaning"
    if inertias == "points":
        robot = changed(robot, torso={"inertia": POINT})
        for joint in range(3):
            robot = with_links(robot, joint, inertia=POINT)
    steps = planned(robot, COMMANDS[command])
    for at in np.linspace(0, len(steps) - 1, 3, dtype=int).tolist():
        given, needed, inertia = given_and_needed(robot, steps[at])
        error = given - needed
        assert np.abs(error[:3]).max() < CARRIED
        assert np.abs(error[3:5]).max() < weight(robot) * ROLLED + (
            0.0 if inertias == "points" else LEGS_SWING
        )
        # the contact point is sought below the foot along the torso's axis
        aslant = 0.5 * weight(robot) * robot.foot.radius * 0.07 if leans else 0.0
        assert np.abs(error[6:]).max() < INERTIAS[inertias] + aslant
        assert abs(error[5]) < (CARRIED if inertias == "points" else LEGS_SWING)
        acceleration = np.linalg.solve(inertia, error)
        assert np.abs(acceleration[:3]).max() < 0.01  # m/s2
        assert (
            np.abs(acceleration[3:6]).max() < 0.7
        )  # rad/s2    unplanned, a leg's swing alone makes 5
        assert leans or np.abs(acceleration[6:]).max() < 0.7  # of up to 30


@pytest.mark.parametrize("name", ROBOTS)
def test_standing_still_is_planned_to_round_off(name: str) -> None:
    robot = load_robot(name)
    controller = walker(robot, make_gait(robot))
    for k in range(3):
        controller.step(k * PERIOD, BodyCommand(), Measurement())
    step = present(controller)
    assert step is not None
    given, needed, _ = given_and_needed(robot, step)
    # N m    two hundredths of a millimetre of lowering shift the mass of the legs, and the shares
    # stand on the stance
    indented = 5e-6
    np.testing.assert_allclose(given, needed, atol=indented)
