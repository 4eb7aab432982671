"""A calibration pose at the start: arms held out for a frame or a few, then a jump into the motion."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.kinematics.body_points import beside_the_body, between, nodes_of, unit
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.quality.rules.frame_selection import select_frames

# A T-pose is one frame, at most a few; the arms point to the sides within this angle, straight.
MOST = 5
ARMS = np.radians(25.0)
# From the pose into the motion the joints go many times as far as they usually do, and this far (metres, as
# seen from the body).
TIMES = 5.0
FAR = 0.10


def repair(clip: Clip) -> tuple[Clip, list[Defect]]:
    """The clip without such frames. Euler captures too: frames are left out, nothing else changes."""
    if len(clip.times) < MOST + 3:
        return clip, []
    step = np.linalg.norm(beside_the_body(np.diff(clip.positions, axis=0)), axis=-1)
    step = np.where(np.isfinite(step), step, 0.0).mean(axis=1)
    lead = int(np.argmax(step[:MOST])) + 1
    if step[lead - 1] < max(FAR, TIMES * float(np.median(step[lead:]))):
        return clip, []
    points = nodes_of(clip)[:lead]
    left = unit(between(points, "shoulder_right", "shoulder_left"))
    for side, sign in (("left", 1.0), ("right", -1.0)):
        for start, end in ((f"shoulder_{side}", f"elbow_{side}"), (f"elbow_{side}", f"wrist_{side}")):
            held = sign * np.sum(unit(between(points, start, end)) * left, axis=-1)
            if not np.all(held > np.cos(ARMS)):
                return clip, []
    frames = "frame 0 is a T-pose" if lead == 1 else f"frames 0 to {lead - 1} are a T-pose"
    text = f"{frames}, dropped: the joints then jump by {step[lead - 1]:.2f} m on average"
    rest = select_frames(clip, np.arange(len(clip.times)) >= lead)
    return rest, [Defect("calibration_frames", lead, "frames", "repaired", text)]
