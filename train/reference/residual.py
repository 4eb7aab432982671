"""How far a motion is from one that a body on level ground can perform."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.gravity import GRAVITY
from kinemimic.retarget.humanoid.body import TOTAL_MASS
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.reference.reference import Reference
from kinemimic.train.reference.reference_library import LIBRARY_TABLE_RATE

RATE = 60.0  # Hz at which the motion is sampled


def residual(motion: Motion) -> float:
    """Mean size of the force that a motion needs and its contacts cannot give, as a share of the weight.

    It is what the inverse dynamics (`dynamics.py`) leave at the root: the "residual force" of Delp et al.
    2007, "OpenSim: open-source software to create and analyze dynamic simulations of movement". Of the walks
    that this was developed with, optical ones have 0.02 to 0.16, those of a Kinect v1 0.05 to 0.3; runs 0.26
    to 0.64.
    """
    reference = Reference(motion, LIBRARY_TABLE_RATE)
    count = max(2, round(RATE * motion.duration))
    at = np.linspace(0.0, 1.0, count, endpoint=not motion.cyclic)
    missing = reference.dynamics_at(at).missing[:, :3]
    return float(np.linalg.norm(missing, axis=-1).mean() / (TOTAL_MASS * GRAVITY))
