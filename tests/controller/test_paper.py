"""The paper's control: deviations of the feet, each of its corrections, and its limits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gains import PAPER, PERIOD, make_gains, unwatched

from hexapod_cosim.controller import (
    BodyCommand,
    Controller,
    LegSolver,
    Measurement,
    Parts,
    make_gait,
)
from hexapod_cosim.controller.comply.paper import Paper, Step
from hexapod_cosim.controller.walk.inverse_dynamics import InverseDynamics
from hexapod_cosim.cosim.run.single_run import simulate
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.models import HexapodError, load_robot

ATHENA = load_robot("athena")
LEGS = LegSolver(ATHENA)
HOME = LEGS.forward(ATHENA.stance)  # m
SHARE = ATHENA.weight / 6.0  # N    on each foot
SETTLED = 1000  # periods    5 s, ten time constants of the smoothed weight
STANDING = np.zeros(6, dtype=np.bool_)
NONE = Parts(paper_share=False, paper_pid=False, paper_suspension=False)


def with_parts(**on: bool) -> Parts:
    return replace(NONE, **on)


def law(parts: Parts, *, gait: str = "tripod") -> Paper:
    return Paper(
        ATHENA, make_gait(ATHENA, gait), make_gains(ATHENA), parts, legs=LEGS, period=PERIOD
    )


def stand(
    paper: Paper,
    force: np.ndarray,
    *,
    angle: np.ndarray | None = None,
    swinging: np.ndarray = STANDING,
    height: float = 0.0,
    rise: float = 0.0,
    steps: int = SETTLED,
) -> None:
    """Advances a law by some steps in the stance, under constant forces (6, 3) [N]."""
    step = Step(
        pose=LEGS.pose(HOME[:, 0] + 1j * HOME[:, 1], HOME[:, 2]),
        planned=HOME,
        height=np.where(swinging, height, 0.0),
        rise=np.where(swinging, rise, 0.0),
        swinging=swinging,
        angle=ATHENA.stance if angle is None else angle,
        force=force,
    )
    for _ in range(steps):
        paper.step(step)


def loads(*newtons: float) -> np.ndarray:
    """Returns forces (6, 3) with these normal forces [N]."""
    force = np.zeros((6, 3))
    force[:, 2] = newtons
    return force


def test_the_softness_is_that_of_the_jacobian() -> None:
    angle = ATHENA.stance + np.array([0.2, -0.1, 0.15])
    jacobian, foot = LEGS.jacobian(angle), LEGS.forward(angle)
    pose = LEGS.pose(foot[:, 0] + 1j * foot[:, 1], foot[:, 2])
    soft, matrix = LEGS.softness(pose, 40.0), jacobian @ jacobian.transpose(0, 2, 1) / 40.0
    out = np.column_stack([pose.heading.real, pose.heading.imag, np.zeros(6)])
    side = np.column_stack([-pose.heading.imag, pose.heading.real, np.zeros(6)])
    np.testing.assert_allclose(soft.outward, np.einsum("ki,kij,kj->k", out, matrix, out), 1e-12)
    np.testing.assert_allclose(soft.sideward, np.einsum("ki,kij,kj->k", side, matrix, side), 1e-12)
    np.testing.assert_allclose(soft.up, matrix[:, 2, 2], rtol=1e-12)
    np.testing.assert_allclose(soft.splay, np.einsum("ki,ki->k", out, matrix[:, :, 2]), 1e-12)


def test_a_share_of_one_puts_the_loaded_foot_of_a_spring_leg_where_it_was_planned() -> None:
    """Joints of stiffness kp under a force f deflect by J^T f / kp; the angles tell the same."""
    gains = make_gains(ATHENA)
    paper = Paper(
        ATHENA,
        make_gait(ATHENA, "tripod"),
        replace(gains, paper=replace(PAPER, share=1.0, height_share=1.0, share_limit=1.0)),
        with_parts(paper_share=True),
        legs=LEGS,
        period=PERIOD,
    )
    force = loads(*[SHARE] * 6)
    stand(paper, force)
    jacobian = LEGS.jacobian(ATHENA.stance)
    deflection = (jacobian.transpose(0, 2, 1) @ force[:, :, None])[:, :, 0] / ATHENA.servo.kp
    commanded = LEGS.inverse(
        HOME + np.column_stack([paper.shift.real, paper.shift.imag, paper.lift])
    )
    reached = LEGS.forward(commanded + deflection)
    bent = LEGS.forward(ATHENA.stance + deflection)
    assert np.abs(bent - HOME).max() > 1e-3
    # the rest is of second order in the deflection
    assert np.abs(reached - HOME).max() < 0.05 * np.abs(bent - HOME).max()


def test_the_shares_grow_with_the_duty_of_the_gait_to_their_limit() -> None:
    tripod, amble, wave = (
        law(with_parts(paper_share=True), gait=g) for g in ("tripod", "amble", "wave")
    )
    assert (tripod.share, tripod.height_share) == (0.38, 0.5)
    assert amble.share == pytest.approx(0.66)  # 0.38 (4/3)^2 = 0.676 is limited
    assert wave.height_share == 0.66


def test_a_foot_yields_sidewards_to_the_force_and_outwards_only_in_the_air() -> None:
    heading = np.exp(1j * LEGS.hip_yaw)
    soft = LEGS.softness(LEGS.pose(HOME[:, 0] + 1j * HOME[:, 1], HOME[:, 2]), ATHENA.servo.kp)
    pull = (2.0 + 3.0j) * heading  # N    outwards, sidewards
    force = np.column_stack([pull.real, pull.imag, np.full(6, SHARE)])
    swinging = np.array([True, False] * 3)
    paper = law(with_parts(paper_pid=True))
    stand(paper, force, swinging=swinging)
    local = paper.shift * heading.conj()
    np.testing.assert_allclose(local.imag, 0.3 * 3.0 * soft.sideward, rtol=1e-9)
    np.testing.assert_allclose(
        local.real, np.where(swinging, 0.3 * 2.0 * soft.outward, 0.0), atol=1e-15
    )


def test_the_feet_return_together_at_the_given_rate() -> None:
    """Joints that lag by one angle move the feet by one way, which the return takes back."""
    paper = law(with_parts(paper_pid=True))
    ahead = HOME + np.array([0.001, 0.0, 0.0])
    stand(paper, loads(*[SHARE] * 6), angle=LEGS.inverse(ahead), steps=20)
    np.testing.assert_allclose(paper.shift, np.full(6, -3.0 * 0.1 * 0.001), rtol=1e-6)


def test_feet_in_the_air_are_lifted_by_the_plane_through_the_standing_feet() -> None:
    paper = law(with_parts(paper_share=True))
    swinging = np.array([True, False, True, False, True, False])
    soft_ground = (8.0 / ATHENA.contact.stiffness) ** (2.0 / 3.0)
    lifted = HOME.copy()
    lifted[~swinging, 2] += 1e-3
    stand(
        paper,
        loads(0.0, 8.0, 0.0, 8.0, 0.0, 8.0),
        angle=LEGS.inverse(lifted),
        swinging=swinging,
        height=0.02,
    )
    np.testing.assert_allclose(paper.lifted[swinging], 1e-3 + soft_ground, rtol=1e-6)
    assert not paper.lifted[~swinging].any()
    stand(
        paper,
        loads(0.0, 8.0, 0.0, 8.0, 0.0, 8.0),
        angle=LEGS.inverse(lifted + np.array([0.0, 0.0, 0.01])),
        swinging=swinging,
        height=0.02,
    )
    assert (paper.lifted <= 0.002).all()  # the limit


def test_a_foot_that_meets_the_ground_early_stops_and_keeps_its_height_while_it_stands() -> None:
    paper, swinging = law(with_parts(paper_suspension=True)), np.array([True] + [False] * 5)
    stand(paper, loads(0.0, *[11.0] * 5), swinging=swinging, height=0.02)
    stand(paper, loads(30.0, *[5.0] * 5), swinging=swinging, height=0.02, rise=-0.1, steps=20)
    assert paper.lift[0] == pytest.approx(0.1 * 20 * PERIOD)  # it follows the descent of its path
    assert not paper.lift[1:].any()
    stand(paper, loads(*[SHARE] * 6), steps=60)
    assert 0.9 * 0.01 < paper.lift[0] < 0.01  # 0.3 s of a return in 3 s
    stand(paper, loads(0.0, *[11.0] * 5), swinging=swinging, height=0.02, steps=60)
    assert paper.lift[0] < 1e-4


def test_a_foot_without_ground_extends_after_a_while_at_a_limited_speed_to_the_limit() -> None:
    paper, missing = law(with_parts(paper_suspension=True)), loads(0.0, *[11.0] * 5)
    stand(paper, loads(*[SHARE] * 6))
    stand(paper, missing, steps=8)  # 40 ms
    assert not paper.lift.any()
    stand(paper, missing, steps=10)
    assert paper.lift[0] == pytest.approx(-0.08 * 10 * PERIOD)
    stand(paper, missing, steps=200)
    assert paper.lift[0] == -0.03


def controller(parts: Parts | None = None, *, gains: bool = True) -> Controller:
    return unwatched(
        Controller(
            ATHENA,
            period=PERIOD,
            gait=make_gait(ATHENA),
            gains=make_gains(ATHENA) if gains else None,
            parts=parts or Parts(),
            law="paper",
        )
    )


def walk(walker: Controller, steps: range, force: np.ndarray) -> list[np.ndarray]:
    """Returns the commanded angles (6, 3) [rad] of steps under constant forces (6, 3) [N]."""
    measurement = Measurement(angle=ATHENA.stance, foot_force=force)
    found = []
    for k in steps:
        out = walker.step(k * PERIOD, BodyCommand(vx=0.05), measurement)
        assert not out.torque_ref.any()
        found.append(out.angle_ref.copy())
    return found


def test_the_angles_are_the_inverse_kinematics_of_the_corrected_feet() -> None:
    walker, force = controller(), np.tile([2.0, 1.0, SHARE], (6, 1))
    for k in range(300):
        (angle,) = walk(walker, range(k, k + 1), force)
        shown = walker.diagnostics
        wanted = shown.planned + np.column_stack([shown.shift.real, shown.shift.imag, shown.lift])
        reached = ~shown.unreachable
        assert reached.sum() >= 5
        found = walker.legs.forward(angle)
        np.testing.assert_allclose(found[reached], wanted[reached], atol=1e-9)


def test_without_its_parts_it_is_kinematic_control() -> None:
    force = np.tile([3.0, 3.0, SHARE], (6, 1))
    ours, theirs = (
        walk(one, range(400), force) for one in (controller(NONE), controller(gains=False))
    )
    np.testing.assert_array_equal(ours, theirs)


def test_an_unknown_law_is_refused_with_the_nearest_one() -> None:
    with pytest.raises(HexapodError, match="paper"):
        Controller(
            ATHENA, period=PERIOD, gait=make_gait(ATHENA), gains=make_gains(ATHENA), law="papr"
        )


@pytest.mark.usefixtures("plant_build")
def test_forces_and_angles_of_a_standing_robot_tell_the_same_deviations() -> None:
    """They differ by the legs' own weight, which no foot feels, and by the friction of the gears:
    0.05 N m over 40 N m/rad at a lever of 0.2 m at most.
    """
    settings = ["control=kinematic", "command.vx=0", "duration=2", "outputs.plots=false"]
    recording = simulate(load_scenario("walk_flat", overrides=settings)).outcome.recording
    angle, command = (recording.joints(name)[-1].reshape(6, 3) for name in ("angle", "angle_ref"))
    force = recording.foot_vectors("force")[-1].reshape(6, 3)
    jacobian = LEGS.jacobian(angle)
    by_angle = LEGS.forward(angle) - LEGS.forward(command)
    own = InverseDynamics(ATHENA, LEGS, period=PERIOD).rest().torque
    torque = (jacobian.transpose(0, 2, 1) @ force[:, :, None])[:, :, 0] - own
    by_force = (jacobian @ torque[:, :, None])[:, :, 0] / ATHENA.servo.kp
    assert np.abs(by_angle[:, 2]).min() > 0.7e-3
    assert np.abs(by_angle - by_force).max() < 0.25e-3
