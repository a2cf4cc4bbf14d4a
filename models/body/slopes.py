"""Computes derivatives of the forces on torso, knees and shanks for a linearly implicit stage
(eq. 20).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexapod_cosim.models.body.contacts import (
    body_contacts,
    body_spheres,
    sliding_robot,
)
from hexapod_cosim.models.contact import (
    contact_jacobian,
    contact_matrices,
    normal_force,
    normal_slopes,
    slip_velocity,
)
from hexapod_cosim.models.friction import friction_drag
from hexapod_cosim.models.records import Array, Robot


@dataclass(frozen=True)
class BodySlopes:
    """Derivatives of the forces of n spheres; those of the step's first stage."""

    stiffness: Array  # (n,) N/m    of the normal force by delta
    viscosity: Array  # (n,) N s/m  of the normal force by ddelta
    drag: Array  # (n,) N s/m  of friction by slip velocity


def body_slopes(robot: Robot, body: Array, damping: Array, ahead: float) -> BodySlopes:
    """Returns the derivatives at bodies (19, 13).

    They are taken at delta + ahead max(ddelta, 0), as those of the feet. damping: (n,) of the
    contacts [s/m], nan for open ones; ahead [s].
    """
    friction, rows = sliding_robot(robot).friction, []
    for contact, held in zip(body_contacts(robot, body), damping.tolist(), strict=True):
        rate = contact.approach_speed
        depth = contact.penetration + ahead * max(rate, 0.0)
        drag = friction_drag(friction, float(np.linalg.norm(slip_velocity(contact))))
        load = normal_force(robot.contact, held, depth, rate)
        rows.append([*normal_slopes(robot.contact, held, depth, rate), load * drag])
    return BodySlopes(*np.array(rows).reshape(-1, 3).T)


def body_slope_matrices(robot: Robot, body: Array, slopes: BodySlopes) -> tuple[Array, Array]:
    """Returns the parts of G_x and G_v of eq. 20, each (114, 114), of these contacts."""
    size = 6 * len(body)
    G_x, G_v = np.zeros((size, size)), np.zeros((size, size))
    contacts = body_contacts(robot, body)
    for k, (sphere, contact) in enumerate(zip(body_spheres(robot), contacts, strict=True)):
        by_x, by_v = contact_matrices(
            contact_jacobian(body, sphere.body, contact),
            contact.normal,
            stiffness=slopes.stiffness[k],
            viscosity=slopes.viscosity[k],
            drag=slopes.drag[k],
        )
        G_x += by_x
        G_v += by_v
    return G_x, G_v
