"""Shares the force of a foot among faces, edges and corners of blocks that are close on it.

Two contacts of a sphere act independently if they are far apart on it, such as a floor and a wall.
Where they come close, as at a step that is lower than the foot is deep, the sum of both forces
would carry the foot twice. The share w_i of a contact, by which its force is multiplied, follows
from the depths delta_i and the normals n_i of all contacts of the foot:

    G_ij = (n_i . n_j) phi(|n_i - n_j|/rho),  phi(r) = (1 - r)^4 (4 r + 1) for r < 1, else 0,
    rho^2 = 25 delta/(R - 2 delta) with the largest depth,
    lambda >= 0,  s = G lambda - delta >= 0,  lambda_i s_i = 0,  w_i = lambda_i/delta_i.

G is positive definite for different normals, so that lambda is unique and continuous. One contact,
and contacts far apart, have the share 1. A contact whose nearest point lies behind the tangent
plane of a deeper one has the share 0 if no depth is larger than R/2: phi is there larger than the
ratio of its depth to that of the deeper one. So the force is continuous at all places and heights,
and a step whose height goes to 0 becomes the plane. phi is Wendland's function with compact support
(Advances in Computational Mathematics 4, 1995).

plant_fmu/src/ground/sharing.h is the fast form.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from hexapod_cosim.models.arrays import Array

REACH = 25.0  # 1  of rho^2; 20 gives phi the slope of a hidden depth, more is on the safe side
SINGULAR = 1e-9  # 1  least determinant of a G whose contacts count as different


def overlap(first: Array, second: Array, reach: float) -> float:
    """Returns G_ij of two unit normals (3,).

    reach: 1/rho^2, or 0 where rho is infinite.
    """
    square = float(np.sum((first - second) ** 2))
    ratio = np.sqrt(square * reach)
    if ratio >= 1.0:
        return 0.0
    return float((1.0 - 0.5 * square) * (1.0 - ratio) ** 4 * (4.0 * ratio + 1.0))


def contact_shares(depth: Array, normal: Array, radius: float) -> Array:
    """Returns the shares (n,) of contacts of one sphere, 0 to 1.

    Args:
        depth: (n,) m, > 0.
        normal: (n, 3) out of the ground.
        radius: of the sphere [m].
    """
    count, deepest = len(depth), float(np.max(depth, initial=0.0))
    if count < 2:
        return np.ones(count)
    reach = max((radius - 2.0 * deepest) / (REACH * deepest), 0.0)
    G = np.array([[overlap(a, b, reach) for b in normal] for a in normal])
    best, shares = -1.0, np.ones(count)
    for size in range(1, count + 1):
        for chosen in combinations(range(count), size):
            part, right = G[np.ix_(chosen, chosen)], depth[list(chosen)]
            if np.linalg.det(part) <= SINGULAR:
                continue
            force = np.linalg.solve(part, right)
            if np.all(force >= 0.0) and float(force @ right) > best:
                best, shares = float(force @ right), np.zeros(count)
                shares[list(chosen)] = force / right
    return shares
