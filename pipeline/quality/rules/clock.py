"""Detects dropped frames and an irregular clock from the time stamps inside passes. Flagged only.

The time stamps stay as recorded: filters resample to an even clock and back, and never change them.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.spans import frame_runs
from kinemimic.pipeline.plural import plural
from kinemimic.pipeline.quality.rules.defect import Defect

# A time step is even if it is within this share of a whole multiple of the usual step, plus the rounding
# (seconds) of recorders that write milliseconds.
STEP_TOLERANCE = 0.2
ROUNDING = 0.002
# Of the median step: a nominal one is longer. Some recorders write a repeated time a microsecond later.
LEAST_SHARE = 0.1
# The clock is irregular if more than this share of the steps is uneven, or more than this share skips frames.
MAX_UNEVEN_SHARE = 0.02
MAX_SKIPPING_SHARE = 0.25


def detect(clip: Clip) -> list[Defect]:
    """The defects "dropped_frames" and "irregular_clock" of a clip with numbered passes, flagged."""
    within = (clip.passes[1:] == clip.passes[:-1]) & (clip.passes[1:] >= 0)
    steps = np.diff(clip.times)
    if within.sum() < 2:
        return []
    usual = _usual(steps[within])
    multiple = np.maximum(np.round(steps / usual), 1.0)
    # The step after a stamp that nearly coincides with the one before makes up for it.
    multiple[1:] -= (multiple[1:] > 1.0) & (steps[:-1] < LEAST_SHARE * usual) & within[:-1]
    uneven = within & (np.abs(steps - multiple * usual) > STEP_TOLERANCE * usual + ROUNDING)
    skipping = within & ~uneven & (multiple > 1)
    defects = []
    if skipping.any():
        missing = int((multiple[skipping] - 1).sum())
        defects.append(
            Defect(
                "dropped_frames",
                missing,
                "frames",
                "flagged",
                f"{plural(missing, 'frame')} missing in {plural(int(skipping.sum()), 'place')} inside "
                f"passes, at most {int(multiple[skipping].max() - 1)} in a row; the other frames "
                "keep their times",
                frame_runs(np.append(skipping, False)),
            )
        )
    other = uneven | skipping
    if uneven.sum() > MAX_UNEVEN_SHARE * within.sum() or skipping.sum() > MAX_SKIPPING_SHARE * within.sum():
        low, high = np.percentile(steps[within], [5.0, 95.0])
        defects.append(
            Defect(
                "irregular_clock",
                int(other.sum()),
                "steps",
                "flagged",
                f"{int(other.sum())} of {int(within.sum())} steps differ from the usual {1e3 * usual:.0f} ms "
                f"(5th to 95th percentile {1e3 * low:.0f} to {1e3 * high:.0f} ms); filters resample to an "
                "even clock and back",
                frame_runs(np.append(other, False)),
            )
        )
    return defects


def _usual(steps: Array) -> float:
    """The nominal step of the clock in seconds: the median step, or a shorter one that explains more steps.

    The median is a multiple of the nominal step where every second frame, or more, is missing.
    """
    middle = float(np.median(steps))
    shorter = steps[steps < 0.75 * middle]
    if len(shorter) < 0.05 * len(steps):
        return middle
    least = float(np.median(shorter))
    if least < LEAST_SHARE * middle:
        return middle
    return least if _explained(steps, least) > _explained(steps, middle) + MAX_UNEVEN_SHARE else middle


def _explained(steps: Array, usual: float) -> float:
    """Share of the steps that are whole multiples of `usual`."""
    multiple = np.maximum(np.round(steps / usual), 1.0)
    return float(np.mean(np.abs(steps - multiple * usual) <= STEP_TOLERANCE * usual + ROUNDING))
