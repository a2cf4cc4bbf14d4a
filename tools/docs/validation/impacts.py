"""Shows impacts on the ground: requested and delivered restitution, and penetration depth."""

from __future__ import annotations

import ctypes as ct
import math

import numpy as np
from matplotlib.figure import Figure
from test_laws_impact import falling, flown_off, rigid

from hexapod_cosim.models.contact.law import CHI, achieved_restitution, exact_restitution_chi
from tools.docs.validation.shown import MARKERS, PALETTE, Shown, short

ASKED = (0.1, 0.3, 0.5, 0.7, 0.9)
SPEED = 0.4  # m/s
GRAVITY = 9.81  # m/s2
TINY = 1e-9  # m    height of the feet above the ground
CONTACT_TIME = 0.5  # s    after it the robot counts as resting on the ground
NAMES = {
    "exact_restitution": "exact restitution",
    "flores": "Flores",
    "lankarani_nikravesh": "Lankarani-Nikravesh",
    "hunt_crossley": "Hunt-Crossley",
}


def restitution(core: ct.CDLL) -> Shown:
    """Shows a robot with locked joints that falls flat on six feet, beside the closed form."""
    measured = {law: [_bounced(core, law, e) for e in ASKED] for law in NAMES}

    def draw(figure: Figure) -> None:
        axes, grid = figure.subplots(), np.linspace(0.05, 1.0, 96)
        for k, (law, name) in enumerate(NAMES.items()):
            axes.plot(
                grid,
                [achieved_restitution(CHI[law](e)) for e in grid],
                color=PALETTE[k],
                linewidth=1.2,
            )
            axes.plot(ASKED, measured[law], MARKERS[k], color=PALETTE[k], label=name, markersize=5)
        axes.set(
            xlabel="restitution asked for",
            ylabel="restitution delivered",
            xlim=(0, 1),
            ylim=(0, 1.02),
        )
        axes.legend()

    rows = []
    for law, name in NAMES.items():
        exact = [achieved_restitution(CHI[law](e)) for e in ASKED]
        gap = max(abs(got - want) for got, want in zip(measured[law], exact, strict=True))
        rows.append((name, *(f"{value:.4f}" for value in measured[law]), short(gap)))
    return Shown(
        columns=("law, asked for", *map(str, ASKED), "furthest from the closed form"),
        rows=rows,
        draw=draw,
        alt="Delivered against asked restitution: only the exact law lies on the diagonal",
    )


def _bounced(core: ct.CDLL, law: str, e: float, *, speed: float = SPEED) -> float:
    bounced = flown_off(falling(core, rigid(law, restitution=e), speed=speed), step=2e-3)
    return float(bounced.torso.velocity[2]) / speed


def under_gravity(core: ct.CDLL) -> Shown:
    """Shows the restitution of the exact law at 0.5 under gravity, by impact speed."""
    speeds, e = (0.05, 0.1, 0.2, 0.3, 0.4, 1.0), 0.5
    alone = [_bounced(core, "exact_restitution", e, speed=speed) for speed in speeds]
    heavy = [_bounced_heavily(core, e, speed) for speed in speeds]

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        axes.semilogx(
            speeds, alone, MARKERS[0], color=PALETTE[0], label="without gravity", markersize=5
        )
        axes.semilogx(
            speeds, heavy, MARKERS[1], color=PALETTE[1], label="with gravity", markersize=5
        )
        axes.set(xlabel="speed of the impact [m/s]", ylabel="restitution delivered", ylim=(0, 0.6))
        axes.legend()

    return Shown(
        columns=("e = 0.5, speed [m/s]", *(f"{speed:g}" for speed in speeds)),
        rows=[
            ("without gravity", *(f"{value:.4f}" for value in alone)),
            ("with gravity", *(f"{value:.4f}" for value in heavy)),
        ],
        draw=draw,
        size=(7.6, 2.8),
        alt="Restitution against impact speed: with gravity it falls to zero for slow impacts",
    )


def _bounced_heavily(core: ct.CDLL, e: float, speed: float) -> float:
    """Returns the restitution under gravity, 0 if the robot does not rebound."""
    robot = rigid("exact_restitution", gravity=GRAVITY, restitution=e)
    plant = falling(core, robot, clearance=TINY, speed=speed)
    try:
        bounced = flown_off(plant, step=1e-4, limit=CONTACT_TIME)
    except AssertionError:
        return 0.0
    return float(bounced.torso.velocity[2]) / speed


def penetration(core: ct.CDLL) -> Shown:
    """Shows the deepest penetration of an impact and the energy lost."""
    rows = []
    for law, chi in (
        ("exact_restitution", exact_restitution_chi(0.6)),
        ("hunt_crossley", CHI["hunt_crossley"](0.6)),
        ("hertz", 0.0),
    ):
        robot, speed = rigid(law, restitution=0.6), 0.5
        bounced = flown_off(falling(core, robot, speed=speed), step=2e-5)
        share = 1.0 / chi - math.log1p(chi) / chi**2 if chi else 0.5
        depth = (2.5 * robot.total_mass * speed**2 / (6.0 * robot.contact.stiffness) * share) ** 0.4
        energy, lost = 0.5 * robot.total_mass * speed**2, 1.0 - achieved_restitution(chi) ** 2
        deep, shares = (
            (1e3 * bounced.deepest, 1e3 * depth),
            (bounced.energy.dissipated / energy, lost),
        )
        rows.append(
            (law, *(f"{value:.6f} mm" for value in deep), *(f"{value:.6f}" for value in shares))
        )
    return Shown(
        columns=(
            "law, e = 0.6",
            "deepest penetration",
            "closed form",
            "share of energy lost",
            "closed form",
        ),
        rows=rows,
    )
