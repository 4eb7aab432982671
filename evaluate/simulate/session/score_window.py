"""The last seconds of a session, for the score that a page shows."""

from __future__ import annotations

from collections import deque

import numpy as np

from kinemimic.evaluate.scoring.metrics.scores import advance_along
from kinemimic.evaluate.simulate.session.frame import Frame, Score
from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.gait.curve_metrics import joint_fits
from kinemimic.retarget.humanoid.motion import joint_angles
from kinemimic.train.sim.world import CONTROL_RATE

WINDOW = 10 * CONTROL_RATE  # control steps of the score
MIN_SCORED = CONTROL_RATE


class ScoreWindow:
    """The last WINDOW control steps; roots: positions (2, 3) of the roots of humanoid and reference, m."""

    def __init__(self) -> None:
        # Rotations (20, 4) of humanoid and reference, whether it stood, and how far their roots went (2, 3).
        self._steps: deque[tuple[Array, Array, bool, Array]] = deque(maxlen=WINDOW)
        self._roots: Array = np.zeros((2, 3))

    def clear(self) -> None:
        """Forget all steps."""
        self._steps.clear()

    def move(self, roots: Array) -> None:
        """The roots were put elsewhere: the next step starts from there."""
        self._roots = roots

    def add(self, frame: Frame, roots: Array) -> None:
        """A control step was done."""
        displacement = roots - self._roots
        self._steps.append((frame.rotations, frame.reference_rotations, not frame.fallen, displacement))
        self._roots = roots

    def score(self) -> Score | None:
        """The score of the steps; None before MIN_SCORED of them."""
        if len(self._steps) < MIN_SCORED:
            return None
        moved, wanted, upright, steps = (np.array(column) for column in zip(*self._steps, strict=True))
        fits = joint_fits(joint_angles(wanted), joint_angles(moved), upright)
        return Score(
            frames=len(upright),
            upright=int(upright.sum()),
            knee=fits["knee"].both.r2_upright,
            hip=fits["hip"].both.r2_upright,
            speed=speed_ratio(steps[..., :2]),
        )


def speed_ratio(steps: Array) -> float:
    """How far the humanoid went along its reference's path, as a share of that path, from steps (N, 2, 2) of
    humanoid and reference, m; NaN where the reference stands or returns."""
    went, wanted = steps.sum(axis=0)
    advance = advance_along(went, steps[:, 1])
    return float("nan") if advance is None else advance / float(np.linalg.norm(wanted))
