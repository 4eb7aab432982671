"""Random variants of motions that are no loops: excerpts of recordings, and gaits that turn.

An excerpt of a recording plays at another pace, with other arms and another trunk. A turning gait is a loop
that is walked several times along a winding path, so that the body never goes straight ahead.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import (
    continuous,
    from_axis_angle,
    from_rotvec,
    multiply,
    normalize,
    rotate,
)
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.retarget.humanoid.limits import LIMITS, clamp_to_limits
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.optimise.refine import refine

SECONDS = (3.0, 5.0)
PACE = (0.85, 1.15)  # factor on the speed of an excerpt: a jump allows no more
RATE = 0.8  # rad/s, largest speed of turning
BENDS = (0.5, 2.0)  # s between two random speeds of turning
# Standard deviations of an offset about X, Y, Z, rad, left side, with one side's own by the second number.
OFFSETS = {
    "spine": ((0.03, 0.05, 0.03), 0.0),
    "shoulder_center": ((0.03, 0.08, 0.05), 0.0),
    "shoulder": ((0.15, 0.20, 0.20), 0.5),
    "elbow": ((0.0, 0.25, 0.0), 0.5),
}
_MIRROR = np.array([-1.0, 1.0, -1.0])


def excerpt(motions: Sequence[Motion], seed: int, number: int) -> Motion:
    """A random excerpt of one of `motions`, none of which is cyclic; ValueError without motions."""
    if not motions:
        raise ValueError("no motions that are kept as recorded")
    random = np.random.default_rng([seed, 102, number])
    motion = motions[int(random.integers(len(motions)))]
    pace = random.uniform(*PACE)
    count = min(len(motion.root), round(random.uniform(*SECONDS) * motion.rate * pace))
    first = int(random.integers(len(motion.root) - count + 1))
    rows = slice(first, first + count)
    rotations = _with_offsets(motion.rotations[rows], random)
    root = motion.root[rows] - motion.root[first] * [1.0, 1.0, 0.0]
    return refine(
        Motion(
            rate=motion.rate * pace,
            root=root,
            rotations=rotations,
            contacts=motion.contacts[rows],
            cyclic=False,
        )
    )


def turning(loop: Motion, random: np.random.Generator) -> Motion:
    """A loop walked along a winding path for a few seconds."""
    count = round(random.uniform(*SECONDS) * loop.rate)
    at = np.arange(count) + int(random.integers(len(loop.root)))
    laps, rows = np.divmod(at, len(loop.root))
    straight = loop.root[rows] + laps[:, None] * loop.cycle_offset
    knots = np.cumsum([0.0, *random.uniform(*BENDS, 12)])
    speeds = random.uniform(-RATE, RATE, len(knots))
    heading = np.cumsum(np.interp(np.arange(count) / loop.rate, knots, speeds)) / loop.rate
    turn = from_axis_angle("Z", heading)
    steps = np.diff(straight, axis=0, prepend=straight[:1])
    path = np.cumsum(rotate(turn, steps), axis=0)
    path[:, 2] = straight[:, 2]
    rotations = loop.rotations[rows].copy()
    rotations[:, 0] = multiply(turn, rotations[:, 0])
    return refine(
        Motion(
            rate=loop.rate,
            root=path - path[0] * [1.0, 1.0, 0.0],
            rotations=continuous(rotations),
            contacts=loop.contacts[rows],
            cyclic=False,
        )
    )


def _with_offsets(rotations: Array, random: np.random.Generator) -> Array:
    """Rotations (T, 20, 4) with other mean angles of trunk and arms."""
    found = rotations.copy()
    for joint, (spread, own) in OFFSETS.items():
        offset = np.array(spread) * random.standard_normal(3)
        if joint in NODE_INDEX:
            sides = {joint: offset}
        else:
            other = offset + own * np.array(spread) * random.standard_normal(3)
            sides = {f"{joint}_left": offset, f"{joint}_right": other * _MIRROR}
        for name, turn in sides.items():
            node = NODE_INDEX[name]
            turned = normalize(multiply(found[:, node], from_rotvec(turn)))
            found[:, node] = clamp_to_limits(name, turned) if name in LIMITS else turned
    return continuous(found)
