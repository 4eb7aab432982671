"""What a live capture shows now and next: as it came if it is precise, else without its noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.retarget.live.pose import mixed
from kinemimic.train.prediction.predictor import Predictor

# Weight of what the newest frames say against what was predicted before them. At 1 the humanoid would follow
# the remaining noise from frame to frame; lower weights flatten the strides.
GAIN = 0.35


@dataclass(frozen=True)
class _Trajectory:
    """steps: (F, 2) m over the ground to each frame from the one before; heights: (F,) m; rotations:
    (F, 20, 4)."""

    steps: Array
    heights: Array
    rotations: Array


class LivePrediction:
    """Follows one capture, frame by frame: a recursive filter, whose predictions the next frames correct."""

    def __init__(self, predictor: Predictor) -> None:
        self._predictor = predictor
        self._trajectory: _Trajectory | None = None

    def __call__(self, root: Array, rotations: Array, noise: float) -> tuple[Array, Array]:
        """The newest frame and the next, root (1 + FUTURE, 3) and rotations (1 + FUTURE, 20, 4).

        root, rotations: (F, 3), (F, 20, 4), the frames until now; noise: 0, the capture is precise and its
        newest frame stays as it is, to 1, all is without noise.
        """
        if noise <= 0.0:
            self._trajectory = None
            return self._predictor.continued(root, rotations)
        clean = self._filtered(root[-2], *self._predictor.denoised(root, rotations))
        if noise >= 1.0:
            return clean
        came = self._predictor.continued(root, rotations)
        return (1.0 - noise) * came[0] + noise * clean[0], mixed(came[1], clean[1], noise)

    def _filtered(self, before: Array, root: Array, rotations: Array) -> tuple[Array, Array]:
        """The trajectory that was predicted one frame ago, corrected by the one from now; before: (3,) m."""
        steps = np.diff(root[:, :2], axis=0, prepend=before[None, :2])
        heights, rotations = root[:, 2].copy(), rotations.copy()
        if (then := self._trajectory) is not None:
            steps[:-1] = (1.0 - GAIN) * then.steps[1:] + GAIN * steps[:-1]
            heights[:-1] = (1.0 - GAIN) * then.heights[1:] + GAIN * heights[:-1]
            rotations[:-1] = mixed(then.rotations[1:], rotations[:-1], GAIN)
        self._trajectory = _Trajectory(steps, heights, rotations)
        return np.column_stack([before[:2] + np.cumsum(steps, axis=0), heights]), rotations
