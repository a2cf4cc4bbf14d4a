"""Names of the types of arrays and tuples."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Vector3 = tuple[float, float, float]
Vector6 = tuple[float, float, float, float, float, float]
