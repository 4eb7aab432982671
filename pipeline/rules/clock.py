"""Dropped frames and an uneven clock, from the time stamps inside passes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.clip import Clip
from kinemimic.pipeline.defect import Defect
from kinemimic.pipeline.rules.runs import frame_runs

Array = NDArray[np.float64]

# A step within this share of a whole number of usual steps is that number of steps; milliseconds are how
# finely most recorders write the time, so a step of 33 among steps of 34 is even.
WHOLE = 0.2
ROUNDING = 0.002
# Fewer uneven steps than this share are a hiccup, not an irregular clock.
HICCUP = 0.02


def check(clip: Clip) -> list[Defect]:
    """What the clock of a clip with numbered passes shows; the frames stay where they were recorded."""
    within = (clip.passes[1:] == clip.passes[:-1]) & (clip.passes[1:] >= 0)
    steps = np.diff(clip.times)
    if within.sum() < 2:
        return []
    usual = float(np.median(steps[within]))
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
                f"{missing} frames are missing in {int(skipping.sum())} places inside passes, at most "
                f"{int(multiple[skipping].max() - 1)} in a row; the frames around them keep their times",
                frame_runs(np.append(skipping, False)),
            )
        )
    if uneven.sum() > HICCUP * within.sum():
        low, high = np.percentile(steps[within], [5.0, 95.0])
        defects.append(
            Defect(
                "irregular_clock",
                int(uneven.sum()),
                "steps",
                "flagged",
                f"{int(uneven.sum())} of {int(within.sum())} steps are no multiple of the usual "
                f"{1e3 * usual:.0f} ms (5th to 95th percentile {1e3 * low:.0f} to {1e3 * high:.0f} ms); "
                "filters work on an even clock and come back to this one",
                frame_runs(np.append(uneven, False)),
            )
        )
    return defects
