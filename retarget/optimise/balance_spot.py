"""Balance of a motion on the spot: the root is displaced as in a walk's loop, to and fro in time.

A depth sensor places hips, trunk and arms centimetres off, so that the centre of mass of a person who lifts
an arm or a foot comes over the toes, or beside the foot that stands. Played forward and then backward, a
motion is a loop, whose zero-moment point `zero_moment_point.balanced` brings over the soles: reversed in
time, a motion has the same accelerations, and so the same point.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.retarget.feet.zero_moment_point import Balance, Series, balanced, distance_from_soles
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.optimise.refine import refine

# Highest frequencies, Hz, of the momentum, of the displacement and of contact.
MOMENTUM, DISPLACEMENT, CONTACT = 1.0, 0.7, 4.0
LARGEST = 0.05  # m, of the displacement along an axis
RIDGE = 0.1  # of a harmonic of 1 Hz
# Of the soles' length and width: no simulated body stands for long on the rest.
SOLE = (0.35, 0.5)

# s. The series grow with the duration, and memory and time with its square: 2 GB and 45 s here.
LONGEST = 180.0


def balance_spot(motion: Motion, seen: Array, *, refined: bool = True) -> tuple[Motion, Balance | None]:
    """A motion on the spot that is balanced, and then, if `refined`, refined again with `seen`
    (`refine.refine`).

    Unchanged, with None, where the zero-moment point is not nearer to the middle of the soles after both, and
    beyond LONGEST.
    """
    if motion.duration > LONGEST:
        return motion, None
    there_and_back = _there_and_back(motion)
    series = _series(there_and_back.duration)
    moved, balance = balanced(there_and_back, series)
    if balance is None:
        return motion, None
    frames = len(motion.root)
    root = moved.root[:frames] - [*moved.root[0, :2], 0.0]
    found = replace(motion, root=root, rotations=moved.rotations[:frames])
    found = refine(found, seen) if refined else found
    outside = distance_from_soles(_there_and_back(found), series)
    if outside >= balance.outside_before:
        return motion, None
    return found, replace(balance, outside=outside)


def _there_and_back(motion: Motion) -> Motion:
    """The loop of a motion and its reverse."""
    root, rotations, contacts = (
        np.concatenate([values, values[::-1]]) for values in (motion.root, motion.rotations, motion.contacts)
    )
    return replace(motion, root=root, rotations=rotations, contacts=contacts, cyclic=True)


def _series(period: float) -> Series:
    momentum, displacement, contact = (
        max(2, round(highest * period)) for highest in (MOMENTUM, DISPLACEMENT, CONTACT)
    )
    return Series(momentum, displacement, contact, (1.0, 1.0), LARGEST, RIDGE / period**4, SOLE)
