"""Poses that repeat bit for bit for long: a person who stands, a sensor that froze, or nobody in view.

Formats without a code for "nobody" make recorders repeat the last pose until a subject returns. After a
freeze, the body is where it has moved to in the meantime. Held poses of an animation count as standing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.spans import runs

# Seconds. A pass ends at a jump of the clock longer than CLOCK_GAP, or if nobody is seen for MAX_ABSENCE.
CLOCK_GAP = 0.5
MAX_ABSENCE = 0.2
# Metres, mean over the joints: the body stands still if its steps before and after a repeat are shorter.
MAX_STILL_STEP = 0.002


@dataclass(frozen=True)
class LongRepeats:
    """Frames that repeat the previous pose, bit for bit, in a run longer than MAX_ABSENCE.

    stands: (T,) of a body that holds still; frozen: (T,) of a body that was recorded in motion before and
    after, at most CLOCK_GAP apart; nobody: (T,) the others, and all frames of a recording without movement.
    """

    stands: Mask
    frozen: Mask
    nobody: Mask


def repeated_frames(clip: Clip) -> Mask:
    """Frames (T,) that repeat the previous one. NaN equals NaN: the same joints may be missing in both."""
    places = clip.positions.reshape(len(clip.times), -1)
    same = ((places[1:] == places[:-1]) | (np.isnan(places[1:]) & np.isnan(places[:-1]))).all(axis=1)
    return np.concatenate([np.zeros(min(len(places), 1), dtype=np.bool_), same])


def body_steps(clip: Clip) -> Array:
    """Mean distance (T - 1,) in metres that the joints move from frame to frame."""
    step = np.linalg.norm(np.diff(clip.positions, axis=0), axis=-1)
    finite = np.isfinite(step)
    return np.asarray(np.where(finite, step, 0.0).sum(axis=1) / np.maximum(finite.sum(axis=1), 1))


def steps_around(steps: Array, run: slice) -> list[float]:
    """Those of `body_steps` into a repeated pose and out of its last repeat; fewer at the ends of a clip."""
    return [
        *steps[max(run.start - 2, 0) : max(run.start - 1, 0)].tolist(),
        *steps[run.stop - 1 : run.stop].tolist(),
    ]


def long_repeats(clip: Clip) -> LongRepeats:
    """The long repeats of a clip, by what they mean."""
    times = clip.times
    same = repeated_frames(clip) & np.isfinite(clip.positions).any(axis=(1, 2))
    found = LongRepeats(*(np.zeros(len(times), dtype=np.bool_) for _ in range(3)))
    if len(times) > 1 and same[1:].all():
        # A sensor's noise never gives the same pose twice; channels that are all zero were not recorded.
        held = clip.euler is not None and bool(np.any(clip.euler))
        (found.stands if held else found.nobody)[:] = True
        return found
    steps = body_steps(clip)
    for run in runs(same):
        before = run.start - 1
        if times[run.stop - 1] - times[before] <= MAX_ABSENCE:
            continue
        around = steps_around(steps, run)
        goes_on = before > 0 and run.stop < len(times) and times[run.stop] - times[before] <= CLOCK_GAP
        if max(around) <= MAX_STILL_STEP:
            found.stands[run] = True
        elif goes_on:
            found.frozen[run] = True
        else:
            found.nobody[run] = True
    return found
