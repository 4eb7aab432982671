"""Detects frames that repeat the previous pose bit for bit, and drops them.

They come from a recorder that polls faster than the sensor updates, or from a sensor that froze: then the
frames stay, without positions. Sensor noise never gives the same pose twice; repeats of a body that stands
still in a file of rounded numbers are kept.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Mask
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.spans import frame_runs, runs
from kinemimic.pipeline.plural import plural
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.quality.rules.frame_selection import empty_frames, select_frames
from kinemimic.pipeline.quality.rules.repeated_poses import (
    CLOCK_GAP,
    MAX_ABSENCE,
    MAX_STILL_STEP,
    LongRepeats,
    body_steps,
    long_repeats,
    repeated_frames,
    steps_around,
)

_SHOWN_TIMES = 5  # at most, in a text


def repair(clip: Clip) -> tuple[Clip, list[Defect]]:
    """The clip without the repeats inside its passes; long repeats are left to `mark_frozen`.

    Euler channels cannot be missing: their frozen frames are dropped as well.
    """
    if len(clip.times) < 2:
        return clip, []
    within = np.concatenate([[False], (clip.passes[1:] == clip.passes[:-1]) & (clip.passes[1:] >= 0)])
    long = long_repeats(clip)
    kept = long.stands | long.nobody | (long.frozen & (clip.euler is None))
    repeated = _while_moving(clip, repeated_frames(clip) & within & ~kept)
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


def mark_frozen(clip: Clip, repeats: LongRepeats) -> tuple[Clip, list[Defect]]:
    """The clip with missing positions where the sensor froze.

    repeats: of the clip, whose passes are numbered.
    """
    found = []
    if (frozen := repeats.frozen & (clip.passes >= 0)).any():
        count, places = int(frozen.sum()), list(runs(frozen))
        text = (
            f"the sensor froze in {plural(len(places), 'place')} ({_at(clip, frozen)}): the same pose for "
            f"{MAX_ABSENCE} to {CLOCK_GAP} s although the body moves; {plural(count, 'frame')} emptied"
        )
        clip = empty_frames(clip, frozen)
        found.append(Defect("duplicate_frames", count, "frames", "repaired", text, frame_runs(frozen)))
    return clip, found


def _at(clip: Clip, frames: Mask) -> str:
    """The times at which runs of frames begin: "at 1.23, 2.34 s"."""
    times = [f"{clip.times[run.start]:.2f}" for run in runs(frames)]
    more = ", …" if len(times) > _SHOWN_TIMES else ""
    return f"at {', '.join(times[:_SHOWN_TIMES])}{more} s"


def _while_moving(clip: Clip, repeated: Mask) -> Mask:
    """The repeats (T,) of a moving body."""
    steps = body_steps(clip)
    moving = np.zeros_like(repeated)
    for run in runs(repeated):
        moving[run] = max(steps_around(steps, run), default=np.inf) > MAX_STILL_STEP
    return moving
