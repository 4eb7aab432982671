"""One pass on an even clock without gaps: what heading, phase and odometry are computed from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.joint_names import REQUIRED
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import NODES, SIDES
from kinemimic.pipeline.kinematics.spans import all_finite

RATE = 60.0  # Hz
MIN_FRAMES = 8
MIN_DURATION = 0.5  # s


@dataclass(frozen=True)
class EvenPass:
    """A pass on an even clock.

    times: (T,) seconds at RATE; positions: (T, 20, 3) metres, smoothed, gaps filled linearly; a node that was
    never seen is NaN, a foot that was never seen is its ankle; seen: (T, 20) whether the frames around a time
    show the node.
    """

    times: Array
    positions: Array
    seen: Mask


def even_pass(times: Array, positions: Array) -> EvenPass | None:
    """The pass at times (T,) with positions (T, 20, 3); None if it is too short or never shows both legs."""
    finite = all_finite(positions)
    legs = finite[:, [N[name] for name in REQUIRED]]
    if len(times) < 2 or times[-1] - times[0] < MIN_DURATION or (legs.sum(axis=0) < MIN_FRAMES).any():
        return None
    clock = np.arange(times[0], times[-1] + 0.5 / RATE, 1.0 / RATE)
    out = np.full((len(clock), len(NODES), 3), np.nan)
    seen = np.zeros((len(clock), len(NODES)), dtype=np.bool_)
    after = np.searchsorted(times, clock).clip(1, len(times) - 1)
    # Half a frame of the recording: more would blur the moment at which a foot stands.
    width = 0.5 * RATE * float(np.median(np.diff(times)))
    for node in range(len(NODES)):
        known = finite[:, node]
        seen[:, node] = known[after] & known[after - 1]
        if known.sum() < 2:
            continue
        for axis in range(3):
            line = np.interp(clock, times[known], positions[known, node, axis])
            out[:, node, axis] = gaussian_filter1d(line, width, mode="nearest")
    for side in SIDES:
        foot, ankle = N[f"foot_{side}"], N[f"ankle_{side}"]
        if np.isnan(out[:, foot]).any():
            out[:, foot] = out[:, ankle]
    return EvenPass(clock, out, seen)
