"""Standing still, which a tracker of walks has never learned: balance by ankles and hips.

The point to which the body would fall, centre of mass plus velocity over the frequency of the pendulum (the
"extrapolated centre of mass" of Hof et al. 2005, The condition for dynamic stability, Journal of Biomechanics
38), is kept over the feet: forward and back by the ankles, to the sides by the hips, which shift the load
between the feet.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.gravity import GRAVITY
from kinemimic.pipeline.kinematics.rotations import rotate
from kinemimic.retarget.humanoid.body import BODIES, BODY_INDEX, BODY_MASSES
from kinemimic.train.sim.world import BodyStates
from kinemimic.train.task.env import ACTION_SCALE, ACTIONS

# Radians of the target for a metre that the point is off. The stable PD treats a foot on the ground as free,
# so it delivers a twentieth of its stiffness; the gains are that large to compensate.
ANKLE_PITCH, ANKLE_ROLL, HIP_ROLL = 14.0, 8.0, 3.0
MAX_ANKLE, MAX_HIP = 1.5, 0.6
BEHIND_MIDDLE = 0.03  # m of the middle of the feet: a centimetre before the ankles
# Metres that the point may be off for ankles and hips to hold the body.
HOLDS = (0.14, 0.10)
_FEET = [BODY_INDEX["foot_left"], BODY_INDEX["foot_right"]]


def off_balance(bodies: BodyStates) -> Array:
    """Where the first humanoid would fall to, (ahead, left) in metres of where it stands best."""
    mass = BODY_MASSES / BODY_MASSES.sum()
    centre, velocity = mass @ bodies.positions[0], mass @ bodies.linear[0]
    height = max(float(centre[2]), 0.3)
    off = (centre - bodies.positions[0, _FEET].mean(axis=0) + velocity * np.sqrt(height / GRAVITY))[:2]
    ahead = rotate(bodies.rotations[0, 0], np.array([1.0, 0.0, 0.0]))[:2]
    ahead = ahead / max(float(np.linalg.norm(ahead)), 1e-6)
    left = np.array([-ahead[1], ahead[0]])
    return np.array([off @ ahead + BEHIND_MIDDLE, off @ left])


def holds(bodies: BodyStates) -> bool:
    """Whether the first humanoid can keep its balance without a step."""
    return bool((np.abs(off_balance(bodies)) < HOLDS).all())


def balance_actions(bodies: BodyStates) -> Array:
    """Actions (1, 42) that keep the first humanoid over its feet."""
    ahead, left = off_balance(bodies)
    turns = np.zeros((len(BODIES) - 1, 3))
    for side in ("left", "right"):
        turns[BODY_INDEX[f"foot_{side}"] - 1, :2] = (
            np.clip(-ANKLE_ROLL * left, -1.0, 1.0),
            np.clip(ANKLE_PITCH * ahead, -MAX_ANKLE, MAX_ANKLE),
        )
        turns[BODY_INDEX[f"thigh_{side}"] - 1, 0] = np.clip(HIP_ROLL * left, -MAX_HIP, MAX_HIP)
    return turns.reshape(1, ACTIONS) / ACTION_SCALE
