"""Detects frames that repeat the previous pose bit for bit, and drops them.

They come from a recorder that polls faster than the sensor updates. Sensor noise never gives the same pose
twice; repeats of a body that stands still in a file of rounded numbers are kept.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Mask
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.spans import frame_runs, runs
from kinemimic.pipeline.quality.rules.defect import Defect, plural
from kinemimic.pipeline.quality.rules.frame_selection import select_frames

# Metres, mean over the joints: the body stands still if its steps before and after a repeat are shorter.
MAX_STILL_STEP = 0.002


def repair(clip: Clip) -> tuple[Clip, list[Defect]]:
    """The clip without the repeats inside its passes; long repeats (no subject) lie outside and stay."""
    if len(clip.times) < 2:
        return clip, []
    places = clip.positions.reshape(len(clip.times), -1)
    # NaN never equals itself: the same joints may be missing in both frames.
    same = ((places[1:] == places[:-1]) | (np.isnan(places[1:]) & np.isnan(places[:-1]))).all(axis=1)
    within = (clip.passes[1:] == clip.passes[:-1]) & (clip.passes[1:] >= 0)
    repeated = _while_moving(clip, np.concatenate([[False], same & within]))
    count = int(repeated.sum())
    if not count:
        return clip, []
    of = int((clip.passes >= 0).sum())
    text = f"{plural(count, 'frame')} of {of} identical to the previous frame, bit for bit; dropped"
    # The frames that stay are reported, with their numbers after the removal.
    stays = np.append(repeated[1:], False)[~repeated]
    return select_frames(clip, ~repeated), [
        Defect("duplicate_frames", count, "frames", "repaired", text, frame_runs(stays))
    ]


def _while_moving(clip: Clip, repeated: Mask) -> Mask:
    """The repeats (T,) of a moving body."""
    step = np.linalg.norm(np.diff(clip.positions, axis=0), axis=-1)
    finite = np.isfinite(step)
    mean = np.where(finite, step, 0.0).sum(axis=1) / np.maximum(finite.sum(axis=1), 1)
    moving = np.zeros_like(repeated)
    for run in runs(repeated):
        # The steps into the repeated pose, and out of its last repeat.
        around = mean[max(run.start - 2, 0) : max(run.start - 1, 0)], mean[run.stop - 1 : run.stop]
        moving[run] = max(map(float, np.concatenate(around)), default=np.inf) > MAX_STILL_STEP
    return moving
