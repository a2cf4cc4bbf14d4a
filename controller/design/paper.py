"""Designs the shares of the paper's control: the largest that keep the required margins.

To take back a share of a foot's deviation under its load is a positive feedback of the force on the
foot: a share of 1 would make the leg infinitely stiff. The plant is the standing robot, linearised,
from shifts of the feet to the forces on them; the law is a smoothed, delayed matrix of the leg's
softness (C25, C47, C49). The torso's sag, the return of the feet and the suspension are no part of
this loop: they act on feet in the air, on all feet together, or by events.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import control
import numpy as np

from hexapod_cosim.controller.design.loci import (
    SLOWEST,
    LoopMargins,
    Response,
    critical_size,
    frequencies,
    response,
    tracked,
    worst_margins,
)
from hexapod_cosim.controller.gains import TRIPOD_LEGS, PaperGains, Requirements
from hexapod_cosim.controller.plane import LEGS, Array, Mask
from hexapod_cosim.controller.size import paper_gains, size_of
from hexapod_cosim.controller.walk.kinematics import LegSolver
from hexapod_cosim.models import Robot

JOINTS = 3
ANGLES = FORCES = 3 * LEGS
JUDGED = 200  # frequencies
ROUNDING = 1e-9  # 1    of a period
FREE_COORDINATES = 3  # x, y and yaw of the robot, which nothing controls
BACK_OFF, BACK_OFFS = 0.95, 60  # 1    reduction of the shares at a missed margin, and attempts


@dataclass(frozen=True, kw_only=True)
class StandingPlant:
    """The plant linearised about a pose in which some legs stand.

    system: sampled at the controller's period, with inputs held over it. Inputs: 18 angle_ref, 18
    speed_ref, 18 torque_ref. Outputs: 18 foot forces (ground on foot, world axes), then others.
    The leg is the slowest index of each group.
    """

    system: control.StateSpace
    angle: Array  # rad    (6, 3)
    force: Array  # N    (6, 3) ground on foot
    torque: Array  # N m    (6, 3) torque_ref of the servos
    standing: Mask  # (6,)

    def load(self, robot: Robot) -> Array:
        """Returns the normal forces of the standing feet (n,) in thirds of the weight [1]."""
        return np.asarray(self.force[self.standing, 2] / weight_share(robot))


def weight_share(robot: Robot) -> float:
    """Returns a third of the robot's weight [N], one leg's share while three legs stand."""
    return robot.weight / TRIPOD_LEGS


Plants = Mapping[str, StandingPlant]


def shifted(robot: Robot, plant: StandingPlant) -> control.StateSpace:
    """Returns the plant as a system from shifts (3 n) [m] to forces of the standing feet [N].

    The foot is the slowest index of both.
    """
    chosen, bends = np.repeat(plant.standing, 3), np.zeros((ANGLES, FORCES))
    for leg, jacobian in enumerate(LegSolver(robot).jacobian(plant.angle)):
        rows = slice(JOINTS * leg, JOINTS * (leg + 1))
        bends[rows, rows] = np.linalg.inv(jacobian)
    system = plant.system
    inputs = system.B[:, :ANGLES] @ bends[:, chosen]
    return control.ss(system.A, inputs, system.C[:FORCES][chosen], 0, system.dt)


def law_matrix(robot: Robot, plant: StandingPlant, gains: PaperGains) -> Array:
    """Returns the shifts (3 n) of the standing feet by steady forces on them: (3 n, 3 n) [m/N].

    The shares are those of a gait with as many standing legs.
    """
    legs, count = LegSolver(robot), int(plant.standing.sum())
    feet = legs.forward(plant.angle)
    pose = legs.pose(feet[:, 0] + 1j * feet[:, 1], feet[:, 2])
    soft = legs.softness(pose, robot.servo.kp)
    share, height_share = gains.shares(count / LEGS)
    matrix = np.zeros((3 * count, 3 * count))
    for place, leg in enumerate(np.flatnonzero(plant.standing)):
        heading = pose.heading[leg]
        out, side = [heading.real, heading.imag, 0.0], [-heading.imag, heading.real, 0.0]
        up = [0.0, 0.0, 1.0]
        block = (
            gains.yield_share * soft.sideward[leg] * np.outer(side, side)
            - share * soft.splay[leg] * np.outer(out, up)
            - height_share * soft.up[leg] * np.outer(up, up)
        )
        matrix[3 * place : 3 * place + 3, 3 * place : 3 * place + 3] = block
    return matrix


def scaled(gains: PaperGains, factor: float) -> PaperGains:
    """Returns gains whose law_matrix() is multiplied by a factor."""
    shares = ("share", "height_share", "share_limit", "yield_share")
    return replace(gains, **{name: factor * getattr(gains, name) for name in shares})


def delay_steps(needs: Requirements, *, period: float) -> int:
    """Returns the delay from a force to the command that responds to it, in whole periods."""
    return math.ceil(needs.delay_periods - ROUNDING) + math.ceil(
        needs.force_delay / period - ROUNDING
    )


def late_filter(gains: PaperGains, *, period: float, delays: int) -> control.StateSpace:
    """Returns the smoothing of a force as the controller runs it, after a delay of periods."""
    kept = math.exp(-period / gains.filter_time)
    smooth = control.ss(kept, 1.0 - kept, kept, 1.0 - kept, period)
    if not delays:
        return smooth
    chain = np.eye(delays, k=-1)
    late = control.ss(chain, np.eye(delays)[:, :1], np.eye(delays)[-1:], 0, period)
    return smooth * late


def parallel(system: control.StateSpace, count: int) -> control.StateSpace:
    """Returns `count` copies of a system of one input and one output in parallel."""
    return control.ss(
        *(np.kron(np.eye(count), matrix) for matrix in (system.A, system.B, system.C, system.D)),
        system.dt,
    )


def closed_loop(
    robot: Robot, plant: StandingPlant, gains: PaperGains, *, delays: int
) -> control.StateSpace:
    """Returns the loop from disturbing shifts (3 n) to forces of the standing feet (3 n)."""
    matrix, period = law_matrix(robot, plant, gains), plant.system.dt
    smooth = parallel(late_filter(gains, period=period, delays=delays), len(matrix))
    law = control.ss(smooth.A, smooth.B, matrix @ smooth.C, matrix @ smooth.D, period)
    return control.feedback(shifted(robot, plant), law, sign=1)


def spectral_radius(system: control.StateSpace) -> float:
    """Returns the largest magnitude of a closed loop's eigenvalues that are not 1 by construction.

    The position of the robot on the ground is not controlled: its eigenvalues are exactly 1.
    """
    values = np.linalg.eigvals(system.A)
    by_distance = np.abs(values)[np.argsort(np.abs(values - 1.0))]
    return float(by_distance[FREE_COORDINATES:].max())


@dataclass(frozen=True, kw_only=True)
class PaperDesign:
    """Gains of the paper's control, and the margins of their worst loop."""

    gains: PaperGains
    margins: LoopMargins
    radius: float  # 1    largest spectral radius of the closed loops
    binding: str  # what limited the shares


class PaperLoops:
    """The loops of all plants, whose responses are computed once."""

    def __init__(self, robot: Robot, plants: Plants, needs: Requirements, *, period: float) -> None:
        self.robot, self.plants, self.period = robot, plants, period
        self.delays = delay_steps(needs, period=period)
        self.omega = frequencies(period, JUDGED, slowest=SLOWEST / size_of(robot).time)
        self._responses = {
            name: response(shifted(robot, plant), self.omega) for name, plant in plants.items()
        }

    def loci(self, name: str, gains: PaperGains) -> Response:
        """Returns the eigenloci (3 n, frequencies) of a plant's loop."""
        late = response(late_filter(gains, period=self.period, delays=self.delays), self.omega)
        matrix = law_matrix(self.robot, self.plants[name], gains)
        return tracked(np.linalg.eigvals(-late[:, :1, :1] * (self._responses[name] @ matrix)))

    def worst(self, gains: PaperGains) -> tuple[LoopMargins, str]:
        """Returns the least margins of all loops, and the plant with the least gain margin."""
        found = {name: self.loci(name, gains) for name in self.plants}
        names = [name for name, loci in found.items() for _ in loci]
        loci = np.concatenate(list(found.values()))
        return worst_margins(loci, self.omega), names[int(critical_size(loci).argmax())]

    def radius(self, gains: PaperGains) -> float:
        """Returns the largest spectral radius of the closed loops [1]."""
        return max(
            spectral_radius(closed_loop(self.robot, plant, gains, delays=self.delays))
            for plant in self.plants.values()
        )


def meets(margins: LoopMargins, needs: Requirements) -> bool:
    """Returns whether all margins are at least the required ones."""
    return (
        margins.gain >= needs.gain_margin
        and margins.phase >= needs.phase_margin
        and margins.static >= needs.static_margin
    )


def design_paper(
    robot: Robot, plants: Plants, needs: Requirements, *, period: float
) -> PaperDesign:
    """Returns the gains with the asked shares, or smaller ones that keep the required margins."""
    loops = PaperLoops(robot, plants, needs, period=period)
    gains, binding = paper_gains(robot, needs), "the shares asked for"
    for _ in range(BACK_OFFS):
        margins, name = loops.worst(gains)
        radius = loops.radius(gains)
        if meets(margins, needs) and radius < 1.0:
            break
        binding = f"the margins ({name})"
        gains = scaled(gains, BACK_OFF)
    return PaperDesign(gains=gains, margins=margins, radius=radius, binding=binding)
