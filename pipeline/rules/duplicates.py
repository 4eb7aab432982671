"""Frames that repeat the pose before bit for bit: a recorder that asked faster than the sensor answered."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.clip import Clip
from kinemimic.pipeline.defect import Defect
from kinemimic.pipeline.rules.frames import kept
from kinemimic.pipeline.rules.runs import frame_runs
from kinemimic.pipeline.rules.words import several


def check(clip: Clip) -> tuple[Clip, list[Defect]]:
    """The clip without the repeats inside its passes; sensor noise never gives the same pose twice.

    Repeats that last (a subject who is not there) lie outside of passes and stay.
    """
    if len(clip.times) < 2:
        return clip, []
    places = clip.positions.reshape(len(clip.times), -1)
    # NaN never equals itself: the same joints may be missing in both frames.
    same = ((places[1:] == places[:-1]) | (np.isnan(places[1:]) & np.isnan(places[:-1]))).all(axis=1)
    within = (clip.passes[1:] == clip.passes[:-1]) & (clip.passes[1:] >= 0)
    repeated = np.concatenate([[False], same & within])
    count = int(repeated.sum())
    if not count:
        return clip, []
    of = int((clip.passes >= 0).sum())
    text = f"{several(count, 'frame')} of {of} with the pose of the frame before, bit for bit; dropped"
    # What is named is the frame that stays, with its number among those that stay.
    stays = np.append(repeated[1:], False)[~repeated]
    return kept(clip, ~repeated), [
        Defect("duplicate_frames", count, "frames", "repaired", text, frame_runs(stays))
    ]
