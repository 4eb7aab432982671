"""Gaits that turn: a loop that is walked for a few seconds along a winding path, and never straight ahead."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.kinematics.rotations import continuous, from_axis_angle, multiply, rotate
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.optimise.refine import refine

SECONDS = (3.0, 5.0)
RATE = 0.8  # rad/s, largest speed of turning
BENDS = (0.5, 2.0)  # s between two random speeds of turning


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
