"""Impacts on the ground: the restitution that each law is asked for and what it delivers, and how deep the feet sink in."""

from __future__ import annotations

import ctypes as ct
import math

import numpy as np
from matplotlib.figure import Figure
from test_laws_impact import falling, flown_off, rigid

from hexapod_cosim.models.contact import CHI, achieved_restitution, exact_restitution_chi
from tools.docs.validation.shown import MARKERS, PALETTE, Shown, short

ASKED = (0.1, 0.3, 0.5, 0.7, 0.9)
SPEED = 0.4  # m/s
NAMES = {
    "exact_restitution": "exact restitution",
    "flores": "Flores",
    "lankarani_nikravesh": "Lankarani-Nikravesh",
    "hunt_crossley": "Hunt-Crossley",
}


def restitution(core: ct.CDLL) -> Shown:
    """A robot with locked joints that falls flat on six feet: measured at the torso, beside the closed form."""
    measured = {law: [_bounced(core, law, e) for e in ASKED] for law in NAMES}

    def draw(figure: Figure) -> None:
        axes, grid = figure.subplots(), np.linspace(0.05, 1.0, 96)
        for k, (law, name) in enumerate(NAMES.items()):
            axes.plot(grid, [achieved_restitution(CHI[law](e)) for e in grid], color=PALETTE[k], linewidth=1.2)
            axes.plot(ASKED, measured[law], MARKERS[k], color=PALETTE[k], label=name, markersize=5)
        axes.set(xlabel="restitution asked for", ylabel="restitution delivered", xlim=(0, 1), ylim=(0, 1.02))
        axes.legend()

    rows = []
    for law, name in NAMES.items():
        exact = [achieved_restitution(CHI[law](e)) for e in ASKED]
        gap = max(abs(got - want) for got, want in zip(measured[law], exact, strict=True))
        rows.append((name, *(f"{value:.4f}" for value in measured[law]), short(gap)))
    return Shown(
        columns=("law, asked for", *map(str, ASKED), "furthest from the closed form"), rows=rows, draw=draw,
        alt="Delivered against asked restitution: only the exact law lies on the diagonal",
    )  # fmt: skip


def _bounced(core: ct.CDLL, law: str, e: float) -> float:
    bounced = flown_off(falling(core, rigid(law, restitution=e), speed=SPEED), step=2e-3)
    return float(bounced.torso.velocity[2]) / SPEED


def penetration(core: ct.CDLL) -> Shown:
    """The deepest penetration of an impact, and the energy it costs."""
    rows = []
    for law, chi in (("exact_restitution", exact_restitution_chi(0.6)), ("hunt_crossley", CHI["hunt_crossley"](0.6)), ("hertz", 0.0)):
        robot, speed = rigid(law, restitution=0.6), 0.5
        bounced = flown_off(falling(core, robot, speed=speed), step=2e-5)
        share = 1.0 / chi - math.log1p(chi) / chi**2 if chi else 0.5
        depth = (2.5 * robot.total_mass * speed**2 / (6.0 * robot.contact.stiffness) * share) ** 0.4
        energy, lost = 0.5 * robot.total_mass * speed**2, 1.0 - achieved_restitution(chi) ** 2
        deep, shares = (1e3 * bounced.deepest, 1e3 * depth), (bounced.energy.dissipated / energy, lost)
        rows.append((law, *(f"{value:.6f} mm" for value in deep), *(f"{value:.6f}" for value in shares)))
    return Shown(columns=("law, e = 0.6", "deepest penetration", "closed form", "share of energy lost", "closed form"), rows=rows)
