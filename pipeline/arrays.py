"""Names for the array types that the whole package uses."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""What the pipeline computes with."""

Floats = NDArray[np.float32]
"""What networks learn with and what the simulation's observations are."""

Mask = NDArray[np.bool_]
"""Which frames, joints or environments are meant."""

States = NDArray[np.uint8]
"""Tracking states: 0 missing, 1 inferred, 2 tracked."""
