"""Motions made of motions: turned, on the spot, backwards."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kinemimic.pipeline.kinematics.rotations import from_axis_angle, multiply, rotate
from kinemimic.retarget.humanoid.motion import Motion


def turned(motion: Motion, angle: float) -> Motion:
    """The motion, turned about the vertical by radians."""
    turn = from_axis_angle("Z", np.array(angle))
    rotations = motion.rotations.copy()
    rotations[:, 0] = multiply(np.broadcast_to(turn, rotations[:, 0].shape), rotations[:, 0])
    root = rotate(np.broadcast_to(turn, (len(motion.root), 4)), motion.root)
    return replace(motion, root=root, rotations=rotations, cycle_offset=rotate(turn, motion.cycle_offset))


def on_the_spot(motion: Motion) -> Motion:
    root = motion.root * [0.0, 0.0, 1.0]
    return replace(motion, root=root, cycle_offset=np.zeros(3))


def backwards(motion: Motion) -> Motion:
    return replace(motion, root=motion.root * [-1, 1, 1], cycle_offset=-motion.cycle_offset)
