"""The direction in which a reference moves."""

from __future__ import annotations

import math

import numpy as np

from kinemimic.pipeline.kinematics.rotations import rotate
from kinemimic.retarget.humanoid.body import BODY_INDEX
from kinemimic.train.reference.reference import Reference

_MIN_SPEED = 0.1  # m/s: the heading of a slower reference is that of its pelvis


def heading(reference: Reference, phase: float) -> float:
    """Heading of the reference at a phase, in radians about the vertical from the x-axis.

    The direction of its root over the cycle around the phase (over one second of a non-cyclic motion), or of
    its pelvis if the root hardly moves.
    """
    seconds = reference.duration if reference.cyclic else 1.0
    around = phase + np.array([-0.5, 0.5]) * seconds / reference.duration
    before, after = reference.root(around)
    way = after - before
    if math.hypot(way[0], way[1]) < _MIN_SPEED * seconds:
        pelvis = reference.bodies(np.array([phase])).rotations[:, BODY_INDEX["pelvis"]]
        way = rotate(pelvis, np.array([[1.0, 0.0, 0.0]]))[0]
    return math.atan2(way[1], way[0])
