"""The exact cycle of a gait along a straight line: a walk of the virtual Kinect without variability."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, rotate
from kinemimic.pipeline.virtual_kinect.subject import Gait, GroundTruth, observed_body


def straight_walk(gait: Gait, elapsed: Array, *, start: Array, heading: float, phase: float) -> GroundTruth:
    """The motion at times (T,) in seconds after passing `start` (2,) at `phase` in cycles."""
    cycles = phase + elapsed / gait.period
    root, rotations = gait.pose(cycles)
    root[:, 0] -= phase * gait.stride
    root = rotate(from_axis_angle("Z", heading), root) + np.append(start, 0.0)
    return observed_body(gait.skeleton, root, rotations, np.full(len(cycles), heading), cycles)
