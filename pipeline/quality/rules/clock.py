"""Dropped frames and an uneven clock, from the time stamps inside passes."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.spans import frame_runs
from kinemimic.pipeline.quality.rules.defect import Defect, plural

# A step within this share of a whole number of usual steps is that number of steps; milliseconds are how
# finely most recorders write the time, so a step of 33 among steps of 34 is even.
WHOLE = 0.2
ROUNDING = 0.002
# Fewer uneven steps than this share are a hiccup, not an irregular clock; and where more frames than this
# are missing, what is left has no even clock either.
HICCUP = 0.02
SPARSE = 0.25


def detect(clip: Clip) -> list[Defect]:
    """What the clock of a clip with numbered passes shows; the frames stay where they were recorded."""
    within = (clip.passes[1:] == clip.passes[:-1]) & (clip.passes[1:] >= 0)
    steps = np.diff(clip.times)
    if within.sum() < 2:
        return []
    usual = _usual(steps[within])
    multiple = np.maximum(np.round(steps / usual), 1.0)
    uneven = within & (np.abs(steps - multiple * usual) > WHOLE * usual + ROUNDING)
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
                f"passes, at most {int(multiple[skipping].max() - 1)} in a row; the others "
                "keep their times",
                frame_runs(np.append(skipping, False)),
            )
        )
    other = uneven | skipping
    if uneven.sum() > HICCUP * within.sum() or skipping.sum() > SPARSE * within.sum():
        low, high = np.percentile(steps[within], [5.0, 95.0])
        defects.append(
            Defect(
                "irregular_clock",
                int(other.sum()),
                "steps",
                "flagged",
                f"{int(other.sum())} of {int(within.sum())} steps differ from the usual {1e3 * usual:.0f} ms "
                f"(5th to 95th percentile {1e3 * low:.0f} to {1e3 * high:.0f} ms); filters work on an even "
                "clock and come back to this one",
                frame_runs(np.append(other, False)),
            )
        )
    return defects


def _usual(steps: Array) -> float:
    """The step of the clock: the median; or, if that is a multiple of a shorter step that explains more of
    them, the shorter one (every second frame missing, or more)."""
    middle = float(np.median(steps))
    shorter = steps[steps < 0.75 * middle]
    if len(shorter) < 0.05 * len(steps):
        return middle
    least = float(np.median(shorter))
    return least if _explained(steps, least) > _explained(steps, middle) + HICCUP else middle


def _explained(steps: Array, usual: float) -> float:
    """The share of steps that are whole multiples of `usual`."""
    multiple = np.maximum(np.round(steps / usual), 1.0)
    return float(np.mean(np.abs(steps - multiple * usual) <= WHOLE * usual + ROUNDING))
