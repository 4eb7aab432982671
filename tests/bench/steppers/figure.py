"""What every stepper of our own figure is asked to do: the same march in place, the same fall."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, multiply
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.retarget.humanoid.body import STANDING_HEIGHT
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.reference.reference import Reference
from kinemimic.train.sim.world import CONTROL_RATE, SUBSTEPS, TIME_STEP, Poses

PERIOD = 30  # control steps: one second
DROP = 0.3  # m from the hip centre to the ground where a fall begins


def march() -> Motion:
    """Hips and knees swing by 10 and 20 degrees, the two legs in turn."""
    rotations = np.tile([0.0, 0.0, 0.0, 1.0], (PERIOD, 20, 1))
    swing = np.sin(2.0 * np.pi * np.arange(PERIOD) / PERIOD)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        lift = np.radians(10.0) * (1.0 + sign * swing)
        rotations[:, NODE_INDEX[f"hip_{side}"]] = from_axis_angle("Y", -lift)
        rotations[:, NODE_INDEX[f"knee_{side}"]] = from_axis_angle("Y", 2.0 * lift)
        rotations[:, NODE_INDEX[f"ankle_{side}"]] = from_axis_angle("Y", -lift)
    root = np.tile([0.0, 0.0, STANDING_HEIGHT], (PERIOD, 1))
    return Motion(float(CONTROL_RATE), root, rotations, np.ones((PERIOD, 2), dtype=bool), cyclic=True)


def targets(reference: Reference, figures: int) -> list[tuple[Array, Array]]:
    """What `World.step` takes, for each control step of the period."""
    steps = np.arange(PERIOD)[:, None] / CONTROL_RATE + (1 + np.arange(SUBSTEPS)) * TIME_STEP
    joints, velocities = reference.joints(steps)
    return [
        (np.tile(q, (figures, 1, 1, 1)), np.tile(v, (figures, 1, 1, 1)))
        for q, v in zip(joints, velocities, strict=True)
    ]


def standing(reference: Reference, figures: int) -> Poses:
    return reference.poses(np.zeros(figures))


def falling(reference: Reference, figures: int) -> Poses:
    """Standing upright, but for being turned on the back, just over the ground."""
    poses = standing(reference, figures)
    root = np.tile([0.0, 0.0, DROP], (figures, 1))
    back = multiply(np.tile(from_axis_angle("Y", np.array(-0.5 * np.pi)), (figures, 1)), poses.root_rotation)
    return replace(poses, root=root, root_rotation=back)
