"""Frames between two phases, with edges that do not depend on the processor's rounding.

An edge is often the phase of a frame itself, computed in another way: at the end of a pass, or where a line
replaces the phase. Compared exactly, the last bit would decide whether that frame counts.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array, Mask

EDGE = 1e-9  # cycles by which a frame may be off an edge and still be on it


def frames_between(phase: Array, start: float, end: float) -> slice:
    """Frames of an increasing phase (T,) from `start`, with a frame on it, to `end`, without one on it."""
    first, stop = np.searchsorted(phase, (start - EDGE, end - EDGE))
    return slice(int(first), int(stop))


def within(phase: Array, start: float, end: float) -> Mask:
    """Mask (T,) of the frames from `start` to `end`, with frames on either edge."""
    return np.asarray((phase >= start - EDGE) & (phase <= end + EDGE))
