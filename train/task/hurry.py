"""A reference that hurries: a humanoid that is pushed takes its next step sooner.

With a clock, the next step comes when it is due, however fast the humanoid falls. People who are pushed step
at once (A. L. Hof et al., "Balance responses to lateral perturbations in human treadmill walking", Journal of
Experimental Biology 213, 2010). So the reference runs faster while the humanoid is faster than it, or moves
to a side.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.train.sim.world import BodyStates

TOLERATED = 0.4  # m/s: in most steps, an undisturbed walk differs by less
LARGEST = 1.5  # factor on the speed of the reference


def hurry(bodies: BodyStates, target: BodyStates) -> Array:
    """(E,) factors on the speed of the references, from 1 to LARGEST: it grows by 1 for each m/s by which a
    pelvis is faster than its target along the target's path, or moves to a side, beyond TOLERATED."""
    wanted = target.linear[:, 0, :2]
    along = wanted / np.maximum(np.linalg.norm(wanted, axis=-1, keepdims=True), 1e-6)
    off = bodies.linear[:, 0, :2] - wanted
    faster = np.maximum(np.einsum("ei,ei->e", off, along), 0.0)
    aside = np.abs(off[:, 0] * along[:, 1] - off[:, 1] * along[:, 0])
    found: Array = np.clip(1.0 + faster + aside - TOLERATED, 1.0, LARGEST)
    return found
