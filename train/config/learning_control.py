"""Settings of iterative learning control, for a policy that already walks."""

from __future__ import annotations

from dataclasses import dataclass

from kinemimic.train.config.baseline_config import require_counts


@dataclass(frozen=True)
class LearningControl:
    """Settings of `train/learning_control`, for a motion that repeats itself.

    iterations: of the learning; environments: number of humanoids; cycles: of the motion that each walks in
    an iteration. knee, hip_swing, hip_stance: shares of a joint's mean error by which its correction changes
    in an iteration; harmonics: of the cycle, at which the change is damped to 61 %; largest: correction, rad.
    goal: R² of knee and hip at which the training ends; meanwhile: samples in total by which the policy is
    also corrected between the rounds, 0 for none.
    """

    iterations: int = 20
    environments: int = 16
    cycles: int = 2
    knee: float = 0.3
    hip_swing: float = 0.09
    hip_stance: float = 0.03
    harmonics: float = 8.0
    largest: float = 0.6
    goal: float = 0.98
    meanwhile: int = 0

    def __post_init__(self) -> None:
        require_counts(self, "iterations", "environments", "cycles")
