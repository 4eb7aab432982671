"""Balance on standing feet, by ankles and hips: added to a policy's actions where it performs on the spot.

The point to which the body would fall, centre of mass plus velocity over the frequency of the pendulum (the
"extrapolated centre of mass" of Hof et al. 2005, The condition for dynamic stability, Journal of Biomechanics
38), is kept over the feet: forward and back by the ankles, to the sides by the ankles and by the hips, which
shift the load between the feet.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.gravity import GRAVITY
from kinemimic.pipeline.kinematics.rotations import rotate
from kinemimic.retarget.humanoid.body import BODIES, BODY_INDEX, BODY_MASSES, FEET
from kinemimic.train.sim.world import BodyStates

# Radians of the target for a metre that the point is off. The stable PD treats a foot on the ground as free,
# so it delivers a twentieth of its stiffness; the gains are that large to compensate.
ANKLE_PITCH, ANKLE_ROLL, HIP_ROLL = 14.0, 8.0, 3.0
MAX_ANKLE_PITCH, MAX_ANKLE_ROLL, MAX_HIP = 1.5, 1.0, 0.6
BEHIND_MIDDLE = 0.03  # m of the middle of the feet: a centimetre before the ankles
STANDING = 0.03  # m: a foot that much above the lower one, at most, stands
FOLLOWED = 0.7  # share of the way from the middle to a foot up to which the sway of a reference is followed
_THIGHS = [BODY_INDEX["thigh_left"], BODY_INDEX["thigh_right"]]
_SHARES: Array = BODY_MASSES / BODY_MASSES.sum()
_LOWEST_PENDULUM = 0.3  # m
_NARROWEST = 0.05  # m between the feet


def standing_feet(bodies: BodyStates) -> Array:
    """(E, 2) of left and right foot: 1 for one that stands, 0 for one in the air."""
    heights = bodies.positions[:, FEET, 2]
    lowest = heights.min(axis=1, keepdims=True)
    return np.asarray(heights <= lowest + STANDING, dtype=np.float64)


def off_balance(bodies: BodyStates, standing: Array | None = None) -> Array:
    """(E, 2) where the humanoids would fall to, (ahead, left) in metres of where they stand best.

    standing: (E, 2) the feet that carry them, 1 or 0; both by default.
    """
    centre, velocity = (np.einsum("b,ebi->ei", _SHARES, part) for part in (bodies.positions, bodies.linear))
    fall = np.sqrt(np.maximum(centre[:, 2:], _LOWEST_PENDULUM) / GRAVITY)
    off = _in_heading(bodies, centre - _base(bodies, standing) + velocity * fall)
    off[:, 0] += BEHIND_MIDDLE
    return off


def balance_turns(bodies: BodyStates, target: BodyStates | None = None) -> Array:
    """(E, 14, 3) rotation vectors on the targets of the joints, rad, that keep humanoids over their feet.

    target: the reference now, whose feet say which of theirs carry them, and whose sway they follow between
    two of them; None: both feet, and the middle between them.
    """
    count = len(bodies.positions)
    standing = np.ones((count, 2)) if target is None else standing_feet(target)
    ahead, left = off_balance(bodies, standing).T
    if target is not None:
        left = left - _sway(target, standing)
    loads = np.where(standing.all(axis=1, keepdims=True), _loads(bodies), standing)
    turns = np.zeros((count, len(BODIES) - 1, 3))
    for side, (foot, thigh) in enumerate(zip(FEET, _THIGHS, strict=True)):
        on = standing[:, side]
        turns[:, foot - 1, 0] = on * np.clip(-ANKLE_ROLL * left, -MAX_ANKLE_ROLL, MAX_ANKLE_ROLL)
        turns[:, foot - 1, 1] = on * np.clip(ANKLE_PITCH * ahead, -MAX_ANKLE_PITCH, MAX_ANKLE_PITCH)
        # The hip of a leg that carries less than half would swing the leg instead of the body.
        carries = np.minimum(2.0 * loads[:, side], 1.0)
        turns[:, thigh - 1, 0] = carries * np.clip(HIP_ROLL * left, -MAX_HIP, MAX_HIP)
    return turns


def _sway(target: BodyStates, standing: Array) -> Array:
    """(E,) how far to the left of the middle its reference stands, m: 0 on one foot."""
    between = np.abs(_in_heading(target, target.positions[:, FEET[0]] - target.positions[:, FEET[1]])[:, 1])
    most = FOLLOWED * 0.5 * between * standing.all(axis=1)
    swayed: Array = np.clip(off_balance(target, standing)[:, 1], -most, most)
    return swayed


def _loads(bodies: BodyStates) -> Array:
    """(E, 2) shares of the weight on the left and the right foot of humanoids that stand still on both."""
    centre = np.einsum("b,ebi->ei", _SHARES, bodies.positions)
    left, right = (_in_heading(bodies, bodies.positions[:, foot] - centre)[:, 1] for foot in FEET)
    share = np.clip(-right / np.maximum(left - right, _NARROWEST), 0.0, 1.0)
    return np.stack([share, 1.0 - share], axis=1)


def _base(bodies: BodyStates, standing: Array | None) -> Array:
    """(E, 3) the middle of the feet that carry them."""
    feet = np.ones((len(bodies.positions), 2)) if standing is None else standing
    base: Array = np.einsum("ef,efi->ei", feet / feet.sum(axis=1, keepdims=True), bodies.positions[:, FEET])
    return base


def _in_heading(bodies: BodyStates, vectors: Array) -> Array:
    """(E, 2) the parts ahead and to the left of vectors (E, 3) in the world."""
    ahead = rotate(bodies.rotations[:, 0], np.array([1.0, 0.0, 0.0]))[:, :2]
    ahead = ahead / np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), 1e-6)
    x, y = vectors[:, 0], vectors[:, 1]
    return np.stack([x * ahead[:, 0] + y * ahead[:, 1], y * ahead[:, 0] - x * ahead[:, 1]], axis=1)
