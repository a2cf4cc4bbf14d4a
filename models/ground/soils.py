"""Names of soils and their rows in the table of a grid file's materials.

Pressure-sinkage parameters: Wong, Theory of Ground Vehicles, as transcribed in public files; the
shear displacement, the unloading stiffness and the damping are those of the transcribers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hexapod_cosim.models.ground.surface import MATERIAL_COLUMNS, Array

MU, MU_STATIC, STIFFNESS, LAW = range(4)  # columns of a material; the soil's parameters follow
BEKKER = 1  # number of the law
UNLOADING, DAMPING = 4e8, 3e4  # Pa/m, Pa s/m


@dataclass(frozen=True)
class Soil:
    """A soil with pressure (Kc/b + Kphi) z^n and shear strength c + p tan(phi)."""

    about: str
    kphi: float  # kN/m^(n+2)
    kc: float  # kN/m^(n+1)
    n: float  # 1
    c: float  # kPa
    phi: float  # deg
    shear: float  # mm   displacement at 63 % of the shear strength

    def columns(self) -> Array:
        """Returns law and parameters, columns 3 to 15 of a material."""
        row = np.zeros(MATERIAL_COLUMNS)
        tangent = math.tan(math.radians(self.phi))
        row[LAW:12] = (
            BEKKER,
            1e3 * self.kphi,
            1e3 * self.kc,
            self.n,
            1e3 * self.c,
            tangent,
            1e-3 * self.shear,
            UNLOADING,
            DAMPING,
        )
        return row[LAW:]


SOILS = {
    "dry_sand": Soil("dry sand", 1528.43, 0.99, 1.1, 1.04, 28.0, 25.0),
    "sandy_loam": Soil("sandy loam, 15 % water", 1515.04, 5.27, 0.7, 1.72, 29.0, 20.0),
    "clay": Soil("clayey soil, 38 % water", 692.15, 13.19, 0.5, 4.14, 13.0, 20.0),
    "lete_sand": Soil("LETE sand", 5301.0, 102.0, 0.793, 1.3, 31.1, 12.0),
    "snow": Soil("snow, US", 196.72, 4.37, 1.6, 1.03, 19.7, 30.0),
    "lunar": Soil("lunar soil, nominal", 820.0, 1.4, 1.0, 0.17, 35.0, 18.0),
    "mars_simulant": Soil("DLR Mars simulant", 180.0, 5.79, 0.8, 0.3, 17.8, 10.0),
}
