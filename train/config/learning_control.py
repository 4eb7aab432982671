"""Settings of iterative learning control, for a policy that already walks."""

from __future__ import annotations

from dataclasses import dataclass

from kinemimic.train.config.baseline_config import require_counts


@dataclass(frozen=True)
class LearningControl:
    """Settings of `train/learning_control`, for a motion that repeats itself.

    environments: number of humanoids; cycles: of the motion that each walks in a measurement. iterations: in
    which a correction changes by a share of its joint's mean error: knee, hip_swing, hip_stance; harmonics:
    of the cycle, at which the change is damped to 61 %. rounds: in which the response is identified; steps:
    along it in each round, which go a share of the way. largest: correction, rad. interval: samples between
    two corrections, 0 for a first and a last one only. episodes: of an evaluation, from as many phases; goal:
    R² of knee and hip in all of them at which the training ends.
    """

    iterations: int = 10
    environments: int = 16
    cycles: int = 2
    knee: float = 0.3
    hip_swing: float = 0.09
    hip_stance: float = 0.03
    harmonics: float = 8.0
    largest: float = 0.6
    rounds: int = 3
    steps: int = 3
    share: float = 0.5
    interval: int = 0
    episodes: int = 6
    goal: float = 0.98

    def __post_init__(self) -> None:
        require_counts(self, "environments", "cycles", "episodes")
