"""Swap left and right joints of a clip in selected frames, with states, rotations and recorded angles."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from kinemimic.pipeline.arrays import Mask
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.joint_names import words


def opposite_sides(names: tuple[str, ...]) -> list[int]:
    """Index (J,) of each name's counterpart on the other side; a midline name is its own counterpart."""
    known = words(names)
    index = {word: position for position, word in enumerate(known)}
    return [
        next((index[other] for other in _renamed(word) if other in index), position)
        for position, word in enumerate(known)
    ]


def swap_sides(clip: Clip, where: Mask, joints: Collection[int], curves: Collection[str]) -> Clip:
    """The clip with these joints and curves swapped with their counterparts in the frames `where` (T,).

    joints: indices; curves: names in `clip.angles`. Recorded rotations of these joints become NaN: the sensor
    computed them for the wrong side, and swapping does not correct them.
    """
    other = opposite_sides(clip.skeleton.names)
    joints_to_swap = sorted({*joints, *(other[joint] for joint in joints)})
    counterparts = [other[joint] for joint in joints_to_swap]
    rows = np.flatnonzero(where)[:, None]
    positions, states, rotations = clip.positions.copy(), clip.states.copy(), clip.rotations
    positions[rows, joints_to_swap] = clip.positions[rows, counterparts]
    states[rows, joints_to_swap] = clip.states[rows, counterparts]
    if rotations is not None:
        rotations = rotations.copy()
        rotations[rows, joints_to_swap] = np.nan
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
    """Possible names of the counterpart: leftknee and kneeleft, lknee and kneel."""
    names = [name.replace(side, other, 1) for side, other in _WORDS if side in name]
    for side, other in _LETTERS:
        names += [other + name[1:]] if name.startswith(side) else []
        names += [name[:-1] + other] if name.endswith(side) else []
    return names


_WORDS = (("left", "right"), ("right", "left"))
_LETTERS = (("l", "r"), ("r", "l"))
