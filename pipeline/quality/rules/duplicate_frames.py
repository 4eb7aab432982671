"""Frames that repeat the pose before bit for bit: a recorder that asked faster than the sensor answered."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Mask
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.spans import frame_runs, runs
from kinemimic.pipeline.quality.rules.defect import Defect, plural
from kinemimic.pipeline.quality.rules.frame_selection import select_frames

# Metres, mean over the joints: a body whose steps before and after a repeat are no longer than this stands
# still in a file of rounded numbers; a sensor's noise and a moving body go farther.
STILL = 0.002


def repair(clip: Clip) -> tuple[Clip, list[Defect]]:
    """The clip without the repeats inside its passes; sensor noise never gives the same pose twice, and a
    body that moves does not.

    Repeats that last (a subject who is not there) lie outside of passes and stay.
    """
    if len(clip.times) < 2:
        return clip, []
    places = clip.positions.reshape(len(clip.times), -1)
    # NaN never equals itself: the same joints may be missing in both frames.
    same = ((places[1:] == places[:-1]) | (np.isnan(places[1:]) & np.isnan(places[:-1]))).all(axis=1)
    within = (clip.passes[1:] == clip.passes[:-1]) & (clip.passes[1:] >= 0)
    repeated = _of_what_moves(clip, np.concatenate([[False], same & within]))
    count = int(repeated.sum())
    if not count:
        return clip, []
    of = int((clip.passes >= 0).sum())
    text = f"{plural(count, 'frame')} of {of} with the pose of the frame before, bit for bit; dropped"
    # What is named is the frame that stays, with its number among those that stay.
    stays = np.append(repeated[1:], False)[~repeated]
    return select_frames(clip, ~repeated), [
        Defect("duplicate_frames", count, "frames", "repaired", text, frame_runs(stays))
    ]


def _of_what_moves(clip: Clip, repeated: Mask) -> Mask:
    """The repeats (T,) but for those of a body that stands still."""
    step = np.linalg.norm(np.diff(clip.positions, axis=0), axis=-1)
    there = np.isfinite(step)
    mean = np.where(there, step, 0.0).sum(axis=1) / np.maximum(there.sum(axis=1), 1)
    moving = np.zeros_like(repeated)
    for run in runs(repeated):
        # The steps into the pose that is repeated, and out of its last repeat.
        around = mean[max(run.start - 2, 0) : max(run.start - 1, 0)], mean[run.stop - 1 : run.stop]
        moving[run] = max(map(float, np.concatenate(around)), default=np.inf) > STILL
    return moving
