"""Static balance: the centre of mass over the feet that stand, and the vertical that puts it there.

A sensor without a floor or an accelerometer does not know the vertical, and some place the ankles behind the
heels. A body that stands with its centre of mass outside its feet would fall, so it cannot have leaned as
recorded: it is turned about the ankles by the least angle at which the centre of mass comes over the feet.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.rotations import conjugate, from_rotvec, multiply, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.retarget.feet.contact import sole_positions
from kinemimic.retarget.feet.scale import body_kinematics
from kinemimic.retarget.humanoid.body import BODY_CENTERS, BODY_MASSES, BODY_NODES, TOTAL_MASS

MARGIN = 0.02  # m by which the centre of mass comes inside the soles, if it is outside
# m of the edges of the soles within which no simulated body stands for long: it would stand on its toes. Of a
# foot of 16 cm, the middle 5 cm remain.
EDGE = 0.055
LARGEST_LEAN = np.radians(15.0)  # of a sensor that stands on a table or hangs on a wall
# m of the centre of mass above the ankles, below which nobody stands: a person lies, or is on their hands.
LOWEST_CENTRE = 0.3
_SMALLEST_LEAN = np.radians(0.5)
# When a body counts as standing on the spot: share of the frames with a foot in contact, and the travel of
# the hips, m. A jump or a roll leans as its dynamics ask for.
STANDING_SHARE = 0.8
ON_THE_SPOT = 0.5
# m/s of the hips from the first frame to the last: in a short part of a walk they do not come far.
WALKING = 0.3


def centre_of_mass(positions: Array, frames: Array) -> Array:
    """Centre of mass (T, 3) of the body with node positions (T, 20, 3) and frames (T, 20, 4), metres."""
    found: Array = np.einsum("b,tbi->ti", BODY_MASSES, body_centres(positions, frames)) / TOTAL_MASS
    return found


def body_centres(positions: Array, frames: Array) -> Array:
    """Centres of mass (T, 15, 3) of the bodies, with arguments as for `centre_of_mass`, metres."""
    world = frames[:, BODY_NODES]
    arms = rotate(world, np.broadcast_to(BODY_CENTERS, (len(world), *BODY_CENTERS.shape)))
    return np.asarray(positions[:, BODY_NODES] + arms)


def on_the_spot(root: Array, contacts: Mask, rate: float) -> bool:
    """Whether a body with this root (T, 3) and contacts (T, 2) at `rate` Hz stands where it is."""
    speed = rate * np.linalg.norm((root[-1] - root[0])[:2]) / max(len(root) - 1, 1)
    travels = speed > WALKING or np.ptp(root[:, :2], axis=0).max() > ON_THE_SPOT
    return bool(contacts.any(axis=1).mean() >= STANDING_SHARE and not travels)


def upright(
    rotations: Array, root: Array, contacts: Mask, rate: float = 60.0, edge: float = 0.0
) -> tuple[Array, Array, float]:
    """Rotations (T, 20, 4) and root (T, 3) of a body that leans as it can while it stands, and by how many
    radians it was turned. The feet keep their orientation in the world.

    contacts: (T, 2); rate: frames per second; edge: m of the soles' edges that count as outside. Nothing
    changes for a body that does not stand on the spot, nor for one whose centre of mass is hardly above its
    ankles, as of a person who lies, nor if the centre of mass is over the soles that stand
    in at least half of the frames in which any does, nor by less than half a degree.
    """
    if not on_the_spot(root, contacts, rate):
        return rotations, root, 0.0
    standing = contacts.any(axis=1)
    turned, path, total = rotations, root, np.zeros(3)
    for _ in range(3):
        positions, frames = body_kinematics(turned, path)
        off = outside_soles(positions[standing], frames[standing], contacts[standing], edge)
        if np.linalg.norm(np.median(off, axis=0)) < 1e-3:
            break
        height = float(np.median((centre_of_mass(positions, frames) - ankle_middle(positions))[standing, 2]))
        if height < LOWEST_CENTRE:
            return rotations, root, 0.0
        x, y = np.median(off, axis=0) / height
        total += [-y, x, 0.0]
        size = float(np.linalg.norm(total))
        if size > LARGEST_LEAN:
            total *= LARGEST_LEAN / size
        turned, path = leaned(rotations, root, from_rotvec(total))
    size = float(np.linalg.norm(total))
    return (turned, path, size) if size > _SMALLEST_LEAN else (rotations, root, 0.0)


def leaned(rotations: Array, root: Array, turn: Array, about: Array | None = None) -> tuple[Array, Array]:
    """Rotations (T, 20, 4) and root (T, 3) of the body turned by `turn` (4,) about a point (3,), the origin
    by default. The feet keep their orientation in the world."""
    about = np.zeros(3) if about is None else about
    frames = body_kinematics(rotations)[1]
    every = np.broadcast_to(turn, rotations[:, 0].shape)
    turned, path = rotations.copy(), about + rotate(every, root - about)
    turned[:, 0] = multiply(every, rotations[:, 0])
    for side in SIDES:
        knee, ankle = N[f"knee_{side}"], N[f"ankle_{side}"]
        turned[:, ankle] = multiply(conjugate(multiply(every, frames[:, knee])), frames[:, ankle])
    return turned, path


def ankle_middle(positions: Array) -> Array:
    """The middle (T, 3) between the ankles."""
    return 0.5 * (positions[:, N["ankle_left"]] + positions[:, N["ankle_right"]])


def outside_soles(positions: Array, frames: Array, contacts: Mask, edge: float) -> Array:
    """Vector (T, 2) from the centre of mass to the nearest point within the soles that stand, in the world,
    metres: zero where it is inside. They count as a rectangle along the heading of the pelvis, without its
    edge."""
    ahead = rotate(frames[:, 0], np.broadcast_to([1.0, 0.0, 0.0], (len(frames), 3)))[:, :2]
    ahead = ahead / np.linalg.norm(ahead, axis=-1, keepdims=True)
    axes = np.stack([ahead, np.stack([-ahead[:, 1], ahead[:, 0]], axis=-1)], axis=1)  # (T, 2, 2)
    centre = centre_of_mass(positions, frames)[:, None, None, :2]
    offsets = np.einsum("tai,tfci->tfca", axes, sole_positions(positions, frames)[..., :2] - centre)
    stands = contacts[:, :, None, None]
    least = np.where(stands, offsets, np.inf).min(axis=(1, 2))
    most = np.where(stands, offsets, -np.inf).max(axis=(1, 2))
    bare = np.minimum(edge, 0.5 * (most - least))
    least, most = least + bare, most - bare
    margin = np.minimum(MARGIN, 0.5 * (most - least))
    inward = np.where(least > 0.0, least + margin, np.where(most < 0.0, most - margin, 0.0))
    found: Array = np.einsum("ta,tai->ti", inward, axes)
    return found
