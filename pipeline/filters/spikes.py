"""Remove single outliers before a filter that would smear them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.spans import all_finite, pass_spans

# A spike is at least this far (metres) from the median of five frames, and at least three times the median
# distance.
SPIKE = 0.03


def despike(positions: Array, passes: NDArray[np.int32]) -> tuple[Array, Mask]:
    """Positions (T, J, 3) with spikes replaced by the median of five frames, and a mask (T, J) of them.

    A Hampel filter. The first and last two frames of a pass have no full window and stay.
    """
    result, spikes = positions.copy(), np.zeros(positions.shape[:2], dtype=np.bool_)
    for span in pass_spans(passes):
        if span.stop - span.start < 5:
            continue
        p = positions[span]
        window = np.moveaxis(np.lib.stride_tricks.sliding_window_view(p, 5, axis=0), -1, 1)  # (T-4, 5, J, 3)
        complete = all_finite(window, (1, 3))
        median = np.median(np.where(complete[:, None, :, None], window, 0.0), axis=1)
        off = np.linalg.norm(np.where(complete[..., None], p[2:-2] - median, 0.0), axis=-1)
        scatter = [np.median(d[w]) if w.any() else 0.0 for d, w in zip(off.T, complete.T, strict=True)]
        spike = off > np.maximum(SPIKE, 3.0 * np.array(scatter))
        result[span][2:-2][spike] = median[spike]
        spikes[span][2:-2] = spike
    return result, spikes
