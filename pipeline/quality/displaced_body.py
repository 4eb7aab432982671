"""Jumps of the whole body: to another body, or for some frames to another place and back."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.quality.rules.repeated_poses import MAX_ABSENCE

# m/s and metres. No human has run faster than 12.4 m/s: a body that moves faster, by more than the noise, is
# a different one, or an error.
TOP_SPEED = 12.5
JUMP_NOISE = 0.1
# The body is back if its distance from its last place is less than this share of that of the frames between;
# else it is another one.
MAX_RETURN_RATIO = 0.4


def body_jumps(clip: Clip, present: Mask) -> Mask:
    """Frames (T,) that most joints reached faster than a human can, from the last frame with a subject."""
    jumps = np.zeros(len(present), dtype=np.bool_)
    frames = np.flatnonzero(present)
    if len(frames) < 2:
        return jumps
    moved = _moved(clip.positions[frames[:-1]], clip.positions[frames[1:]])
    jumps[frames[1:]] = moved > TOP_SPEED * np.diff(clip.times[frames]) + JUMP_NOISE
    return jumps


def displaced_frames(clip: Clip, present: Mask) -> Mask:
    """Frames (T,) in which the whole body is in another place, between frames at most MAX_ABSENCE apart."""
    displaced = np.zeros(len(present), dtype=np.bool_)
    jumps = body_jumps(clip, present)
    frames = np.flatnonzero(present)
    for first in np.flatnonzero(jumps[frames]).tolist():
        if displaced[frames[first - 1]] or displaced[frames[first]]:
            continue
        last, away = frames[first - 1], np.inf
        for then in range(first + 1, len(frames)):
            back, seconds = frames[then], clip.times[frames[then]] - clip.times[last]
            if seconds > MAX_ABSENCE + 1e-6:
                break
            away = min(away, float(_moved(clip.positions[[last]], clip.positions[[frames[then - 1]]])[0]))
            near = float(_moved(clip.positions[[last]], clip.positions[[back]])[0])
            if jumps[back] and near < min(TOP_SPEED * seconds + JUMP_NOISE, MAX_RETURN_RATIO * away):
                displaced[frames[first:then]] = True
                break
    return displaced


def _moved(before: Array, after: Array) -> Array:
    """Median distance (T,) over the joints seen in both of positions (T, J, 3); -1 without any."""
    step = np.linalg.norm(after - before, axis=-1)
    step[np.isnan(step)] = -1.0
    count = (step >= 0).sum(axis=1)
    # The joints that are not seen sort to the front.
    middle = np.maximum(step.shape[1] - 1 - count // 2, 0)
    median = np.take_along_axis(np.sort(step, axis=1), middle[:, None], axis=1)[:, 0]
    return np.where(count > 0, median, -1.0)
