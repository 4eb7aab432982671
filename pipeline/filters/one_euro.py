"""The One-Euro filter: causal, for live display, at the cost of a lag.

Casiez, Roussel, Vogel 2012, "1 € Filter: A Simple Speed-based Low-pass Filter for Noisy Input in Interactive
Systems", CHI: a first-order low-pass whose cut-off grows with the speed, so that it is steady at rest and
responsive in motion.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.spans import all_finite, pass_spans

# Hz at rest; Hz per unit of speed (m/s of a position); Hz of the speed's own low-pass, as in the paper.
REST_CUTOFF = 2.0
SPEED_GAIN = 2.0
SPEED_CUTOFF = 1.0


def one_euro(values: Array, times: Array, passes: NDArray[np.int32]) -> Array:
    """Values (T, J, K), each filtered with past values only; NaN stay, and each run restarts the filter.

    The speed is the joint's, not one coordinate's, so that the result does not depend on the axes.
    """
    result = values.copy()
    there = all_finite(values)
    for span in pass_spans(passes):
        state, speed = values[span.start].copy(), np.zeros(values.shape[1:])
        for frame in range(span.start + 1, span.stop):
            step = float(times[frame] - times[frame - 1])
            known = (there[frame] & there[frame - 1])[:, None]
            slope = np.where(known, (values[frame] - state) / step, 0.0)
            speed = np.where(known, speed + _share(SPEED_CUTOFF, step) * (slope - speed), 0.0)
            cutoff = REST_CUTOFF + SPEED_GAIN * np.linalg.norm(speed, axis=-1, keepdims=True)
            state = np.where(known, state + _share(cutoff, step) * (values[frame] - state), values[frame])
            result[frame] = state
    return result


def _share(cutoff: Array | float, step: float) -> Array:
    """Smoothing factor of a first-order low-pass of `cutoff` Hz for a step in seconds."""
    turn = 2.0 * np.pi * np.asarray(cutoff) * step
    return np.asarray(turn / (1.0 + turn))
