"""Frames as reports name them: inclusive runs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.spans import runs

# A list of more runs than this is for a program, not a person; the counts are whole all the same.
_MOST = 100


def frame_runs(mask: NDArray[np.bool_]) -> tuple[tuple[int, int], ...]:
    """The first runs (first, last), inclusive, of True frames in a mask (T,), at most a hundred."""
    found = ((span.start, span.stop - 1) for span in runs(mask))
    return tuple(run for run, _ in zip(found, range(_MOST), strict=False))
