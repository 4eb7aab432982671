"""Names for the array types that the whole package uses."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Positions, rotations, angles and times of captures and motions."""

Floats = NDArray[np.float32]
"""Observations, actions and parameters of networks."""

Mask = NDArray[np.bool_]
"""Selections of frames, joints or environments."""

States = NDArray[np.uint8]
"""Tracking states: 0 missing, 1 inferred, 2 tracked."""
