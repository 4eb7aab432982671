"""What a live capture shows now and next: as it came if it is precise, else without its noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.retarget.live.pose import mixed
from kinemimic.train.prediction.coasting import coasted
from kinemimic.train.prediction.moments import FUTURE
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

    def __call__(
        self, root: Array, rotations: Array, noise: float, on_the_spot: float
    ) -> tuple[Array, Array]:
        """The newest frame and the next, root (1 + FUTURE, 3) and rotations (1 + FUTURE, 20, 4).

        root, rotations: (F, 3), (F, 20, 4), the frames until now; noise: 0, the capture is precise and its
        newest frame stays as it is, to 1, all is without noise; on_the_spot: 0, the person goes somewhere, to
        1, the motion comes to rest.
        """
        if on_the_spot >= 1.0:
            self._trajectory = None
            return coasted(root, rotations, FUTURE)
        going = self._going(root, rotations, noise)
        if on_the_spot <= 0.0:
            return going
        rests = coasted(root, rotations, FUTURE)
        return _between(going, rests, on_the_spot)

    def _going(self, root: Array, rotations: Array, noise: float) -> tuple[Array, Array]:
        """What follows if the person goes somewhere."""
        if noise <= 0.0:
            self._trajectory = None
            return self._predictor.continued(root, rotations)
        clean = self._filtered(root[-2], *self._predictor.denoised(root, rotations))
        if noise >= 1.0:
            return clean
        return _between(self._predictor.continued(root, rotations), clean, noise)

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


def _between(first: tuple[Array, Array], second: tuple[Array, Array], share: float) -> tuple[Array, Array]:
    """Root and rotations between two trajectories; share: of the second."""
    return (1.0 - share) * first[0] + share * second[0], mixed(first[1], second[1], share)
