"""The part of a capture that is kept as recorded: a bout of walking, or a whole pass."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, multiply, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.pipeline.locomotion.bouts import Bout
from kinemimic.pipeline.locomotion.leg_pose import impossible_legs, leg_bones
from kinemimic.pipeline.locomotion.phase.harmonic import walking_direction


@dataclass(frozen=True)
class Excerpt:
    """Frames of one pass.

    frames: (M,) indices into the clip; positions: (M, 20, 3) metres, with X ahead: of a walk, in each frame
    (its path is straightened), else in the first; turn: (M, 4) rotations from the capture's axes to these;
    yaw: (M,) radians by which the walker has turned since the first frame and is to turn in the motion, zero
    to walk straight; bout: the walk, None for another motion.
    """

    pass_number: int
    frames: NDArray[np.intp]
    positions: Array
    turn: Array
    yaw: Array
    bout: Bout | None = None


def excerpt_of_pass(clip: Clip, number: int) -> Excerpt:
    """A whole pass of a clip on the 20 nodes, whatever the person does."""
    frames = np.flatnonzero(clip.passes == number)
    heading = walking_direction(clip.positions[frames])
    turn = np.tile(from_axis_angle("Z", -heading), (len(frames), 1))
    return Excerpt(number, frames, rotate(turn[:, None], clip.positions[frames]), turn, np.zeros(len(frames)))


def excerpt_of_bout(bout: Bout, *, straighten: bool) -> Excerpt:
    """A bout of walking, straightened or with its turns.

    Legs in a pose that no walker takes are tracking errors and become NaN.
    """
    positions = bout.positions.copy()
    bones = np.nanmedian(leg_bones(positions), axis=0)
    middle = 0.5 * (positions[:, [N["hip_left"]]] + positions[:, [N["hip_right"]]])
    bad = impossible_legs(positions - middle, bones, running=bout.running, precise=bout.precise)
    for k, side in enumerate(SIDES):
        for joint in ("knee", "ankle", "foot"):
            positions[bad[:, k], N[f"{joint}_{side}"]] = np.nan
    yaw = np.zeros(len(bout.frames)) if straighten else bout.heading - bout.heading[0]
    return Excerpt(bout.pass_number, bout.frames, positions, bout.turn, yaw, bout)


def with_turns(rotations: Array, root: Array, yaw: Array) -> tuple[Array, Array]:
    """Local rotations (T, 20, 4) and root (T, 3) of a straight walk, turned by yaw (T,) radians.

    Each step of the root is taken in its own direction, so the path becomes the curve that was walked.
    """
    back = from_axis_angle("Z", yaw)
    turned = rotations.copy()
    turned[:, N["hip_center"]] = multiply(back, rotations[:, N["hip_center"]])
    halfway = from_axis_angle("Z", 0.5 * (yaw[1:] + yaw[:-1]))
    path = np.concatenate([root[:1], root[:1] + np.cumsum(rotate(halfway, np.diff(root, axis=0)), axis=0)])
    return turned, path
