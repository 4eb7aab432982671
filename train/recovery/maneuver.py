"""A maneuver: what is added to a policy's actions in the first one and a half seconds after a push."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.retarget.humanoid.body import BODY_INDEX
from kinemimic.train.task.env import ACTION_SCALE, ACTIONS

KNOTS = 10
EVERY = 4  # control steps from one knot to the next
STEPS = EVERY * (KNOTS + 1)  # zero before the first knot, and from the end on
_ROLL, _PITCH, _YAW = range(3)
# The joints that take a step: trunk, hips, knees and ankles. Arms and head hardly matter.
_TURNS = {
    "torso": (_ROLL, _PITCH),
    **{f"thigh_{side}": (_ROLL, _PITCH, _YAW) for side in SIDES},
    **{f"shin_{side}": (_PITCH,) for side in SIDES},
    **{f"foot_{side}": (_ROLL, _PITCH) for side in SIDES},
}
# Columns of an action that a maneuver changes.
COLUMNS = [3 * (BODY_INDEX[body] - 1) + axis for body, axes in _TURNS.items() for axis in axes]


def actions(knots: Array) -> Array:
    """What to add to the actions, (STEPS, N, 42) in their unit, for knots (N, KNOTS, C) in rad, one for each
    of COLUMNS; linear in between. It is for the humanoid as it is: `ImitationBatch.reflected` reflects it
    where the policy sees the mirror image."""
    padded = np.pad(knots, ((0, 0), (1, 1), (0, 0)))
    place = np.arange(STEPS) / EVERY
    before = place.astype(np.int64)
    share = (place - before)[:, None, None]
    turns = (1.0 - share) * padded[:, before].swapaxes(0, 1) + share * padded[:, before + 1].swapaxes(0, 1)
    found = np.zeros((STEPS, len(knots), ACTIONS))
    found[..., COLUMNS] = turns
    found /= ACTION_SCALE
    return found
