"""Left and right put in each other's place for some frames: all that a clip knows of the joints together."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from kinemimic.pipeline.arrays import Mask
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.nodes import normalised


def opposite_sides(names: tuple[str, ...]) -> list[int]:
    """Index (J,) of each name's counterpart on the other side; a name of the middle is its own."""
    index = {normalised(name): position for position, name in enumerate(names)}
    return [
        next((index[other] for other in _renamed(normalised(name)) if other in index), position)
        for position, name in enumerate(names)
    ]


def swap_sides(clip: Clip, where: Mask, joints: Collection[int], curves: Collection[str]) -> Clip:
    """The clip with these joints and curves, and their counterparts, exchanged in the frames `where` (T,).

    joints: indices; curves: names of `clip.angles`. Rotations that a recorder gave these joints were found
    for the other side's body: no exchange makes them this one's, so they are left out (NaN).
    """
    other = opposite_sides(clip.skeleton.names)
    here = sorted({*joints, *(other[joint] for joint in joints)})
    there = [other[joint] for joint in here]
    rows = np.flatnonzero(where)[:, None]
    positions, states, rotations = clip.positions.copy(), clip.states.copy(), clip.rotations
    positions[rows, here] = clip.positions[rows, there]
    states[rows, here] = clip.states[rows, there]
    if rotations is not None:
        rotations = rotations.copy()
        rotations[rows, here] = np.nan
    angles = clip.angles
    if angles:
        names = tuple(angles)
        pairs = {name: names[one] for name, one in zip(names, opposite_sides(names), strict=True)}
        both = {*curves, *(pairs[name] for name in curves)}
        angles = {
            name: np.where(where, angles[pairs[name]], curve) if name in both else curve
            for name, curve in angles.items()
        }
    return replace(clip, positions=positions, states=states, rotations=rotations, angles=angles)


def _renamed(name: str) -> list[str]:
    """What the other side's joint may be called: leftknee and kneeleft, lknee and kneel."""
    names = [name.replace(side, other, 1) for side, other in _WORDS if side in name]
    for side, other in _LETTERS:
        names += [other + name[1:]] if name.startswith(side) else []
        names += [name[:-1] + other] if name.endswith(side) else []
    return names


_WORDS = (("left", "right"), ("right", "left"))
_LETTERS = (("l", "r"), ("r", "l"))
