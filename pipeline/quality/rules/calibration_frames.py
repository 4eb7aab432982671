"""Detects a T-pose in the first frames, followed by a jump into the motion; drops those frames."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.body_points import between, nodes_of, relative_to_body
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.vectors import unit
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.quality.rules.frame_selection import select_frames

# Both arm segments point sideways within this angle.
ARM_TOLERANCE = np.radians(25.0)
# The jump into the motion is this many times the usual step of the joints, and at least this long (metres,
# relative to the body).
MIN_JUMP_RATIO = 5.0
MIN_JUMP = 0.10
# Until then the joints move, within a quarter of a second, at most this share of what they move after it: who
# walks with the arms out, and whose clock or sides jump, holds no pose. From frame to frame, noise is larger.
MAX_SHARE, STILL_TIME = 0.5, 0.25
FEWEST_FRAMES = 8


def repair(clip: Clip) -> tuple[Clip, list[Defect]]:
    """The clip without the calibration frames, Euler captures included."""
    if len(clip.times) < FEWEST_FRAMES:
        return clip, []
    held = _held_out(clip)
    if not held[0]:
        return clip, []
    step = _moved(clip.positions, 1)
    leading = len(held) if held.all() else int(np.argmin(held))
    lead = int(np.argmax(step[:leading])) + 1
    motion = step[lead:]
    if not len(motion) or step[lead - 1] < max(MIN_JUMP, MIN_JUMP_RATIO * float(np.median(motion))):
        return clip, []
    lag = min(lead - 1, len(motion), round(STILL_TIME / float(np.median(np.diff(clip.times)))))
    if lag > 0:
        held_still, moves = (np.median(_moved(part, lag)) for part in np.split(clip.positions, [lead]))
        if held_still > MAX_SHARE * moves:
            return clip, []
    frames = "frame 0 is a T-pose" if lead == 1 else f"frames 0 to {lead - 1} are a T-pose"
    text = f"{frames}, dropped: the joints then jump by {step[lead - 1]:.2f} m on average"
    rest = select_frames(clip, np.arange(len(clip.times)) >= lead)
    return rest, [Defect("calibration_frames", lead, "frames", "repaired", text)]


def _moved(positions: Array, lag: int) -> Array:
    """How far the joints (T, J, 3) move within `lag` frames, relative to the body: means (T - lag,), m."""
    way = np.linalg.norm(relative_to_body(positions[lag:] - positions[:-lag]), axis=-1)
    return np.asarray(np.where(np.isfinite(way), way, 0.0).mean(axis=1))


def _held_out(clip: Clip) -> Mask:
    """Frames (T,) in which both arms are held out to the sides."""
    points = nodes_of(clip)
    left = unit(between(points, "shoulder_right", "shoulder_left"))
    out = np.ones(len(clip.times), dtype=np.bool_)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        for start, end in ((f"shoulder_{side}", f"elbow_{side}"), (f"elbow_{side}", f"wrist_{side}")):
            out &= sign * np.sum(unit(between(points, start, end)) * left, axis=-1) > np.cos(ARM_TOLERANCE)
    return out
