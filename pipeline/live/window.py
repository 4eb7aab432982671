"""The recent past of a live capture, cleaned as a whole at every step: a smoother with a fixed lag.

The estimate is that of the offline Kalman smoother (`filters/kalman.py`), over the last WINDOW seconds alone.
A frame is read from it once `lag` seconds of later frames are there, so that it is smoothed from both sides;
nothing that comes later changes it.
"""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from kinemimic.pipeline.arrays import Array, Mask, States
from kinemimic.pipeline.filters.fill import LONGEST_GAP
from kinemimic.pipeline.filters.kalman import HEADROOM, INFERRED_WEIGHT, MAX_CUTOFF, TOLERANCE, Chain
from kinemimic.pipeline.kinematics.skeleton import NODES, TRACKED

WINDOW = 1.8  # s
MAX_FRAMES = 128  # in the window: a faster sender is thinned out
MIN_STEP = 0.012  # s between frames; those of a faster sender are left out
# Metres: no smaller error is assumed, no outlier is nearer to the others.
MIN_ERROR, MIN_OUTLIER = 0.002, 0.03
FIRST_CUTOFF = 6.0  # Hz, until the likelihood has chosen one


class Window:
    """The last frames on the 20 nodes, in the order of their times."""

    def __init__(self) -> None:
        self._frames: deque[tuple[float, Array, States]] = deque(maxlen=MAX_FRAMES)
        self._cutoffs = np.full(len(NODES), FIRST_CUTOFF)
        self._errors = np.full(len(NODES), MIN_ERROR)
        self._turn = 0

    def __len__(self) -> int:
        return len(self._frames)

    @property
    def newest(self) -> float | None:
        """Time of the newest frame."""
        return self._frames[-1][0] if self._frames else None

    def clear(self) -> None:
        """Forget the frames."""
        self._frames.clear()

    def add(self, time: float, positions: Array, states: States) -> None:
        """A frame of positions (20, 3), NaN where missing, and states (20,), at least MIN_STEP later than the
        one before."""
        self._frames.append((time, positions, states))
        while self._frames[-1][0] - self._frames[0][0] > WINDOW:
            self._frames.popleft()

    def at(self, times: Array) -> Array:
        """Positions (T, 20, 3) at ascending times (T,), NaN where a node was not seen for LONGEST_GAP."""
        out = np.full((len(times), len(NODES), 3), np.nan)
        if len(self._frames) < 4:
            return out
        clock = np.array([frame[0] for frame in self._frames])
        measured = np.array([frame[1] for frame in self._frames])
        weights = np.where(np.array([frame[2] for frame in self._frames]) == TRACKED, 1.0, INFERRED_WEIGHT)
        seen = np.isfinite(measured).all(axis=-1)
        # Nodes that are seen in the same frames share the equations' matrix.
        for pattern in np.unique(seen, axis=1).T:
            nodes = np.flatnonzero((seen == pattern[:, None]).all(axis=0))
            if pattern.sum() >= 4:
                out[:, nodes] = self._smoothed(
                    nodes, clock[pattern], measured[pattern][:, nodes], weights[pattern][:, nodes], times
                )
        self._turn += 1
        return out

    def _smoothed(
        self, nodes: NDArray[np.intp], clock: Array, measured: Array, weights: Array, times: Array
    ) -> Array:
        """Positions (T, K, 3) of nodes at `times`, from measurements (M, K, 3) at `clock` (M,)."""
        step = float(np.median(np.diff(clock)))
        everywhere = np.ones(len(clock), dtype=np.bool_)
        chain = Chain.of(clock, np.zeros(len(clock), dtype=np.int32), everywhere, step)
        paths = np.empty(measured.shape)
        for k, node in enumerate(nodes):
            y, weight = measured[:, k], weights[:, k]
            stiffness = chain.stiffness(min(self._cutoffs[node], MAX_CUTOFF / step))
            path = chain.estimate(y, weight, stiffness)
            off = np.sqrt(np.einsum("mi,mi->m", y - path, y - path))
            scale = max(TOLERANCE * self._errors[node] * np.sqrt(3.0), MIN_OUTLIER)
            weight = weight / (1.0 + (off / scale) ** 2)
            paths[:, k] = chain.estimate(y, weight, stiffness)
            if self._turn % len(NODES) == node and len(clock) >= 12:
                # The likelihood of one node at a time: it takes as long as everything else.
                cutoff, error = chain.likely_cutoff(y, weight)
                self._cutoffs[node] = min(HEADROOM * cutoff, MAX_CUTOFF / step)
                self._errors[node] = max(error, MIN_ERROR)
        curve = CubicHermiteSpline(clock, paths, np.gradient(paths, clock, axis=0))
        found = curve(np.clip(times, clock[0], clock[-1]))
        found[_far(times, clock)] = np.nan
        return np.asarray(found)


def _far(times: Array, clock: Array) -> Mask:
    """Times (T,) in a gap of `clock` (M,) longer than LONGEST_GAP, or that far beyond its ends."""
    after = np.searchsorted(clock, times).clip(1, len(clock) - 1)
    gap = clock[after] - clock[after - 1]
    inside = (times >= clock[0]) & (times <= clock[-1])
    beyond = np.maximum(clock[0] - times, times - clock[-1])
    return np.asarray(np.where(inside, gap > LONGEST_GAP + 0.05, beyond > LONGEST_GAP))
