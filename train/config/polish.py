"""Settings of a training that starts from a tracker and goes on with one motion."""

from __future__ import annotations

from dataclasses import replace

from kinemimic.train.config.config import DomainRandomization, TrainConfig

POLISH = "polish"
POLISH_BUDGET = 200_000  # samples


def polish(tracker: TrainConfig, start: str, seed: int = 0) -> TrainConfig:
    """Settings for the policy with hash `start`, which was trained with the settings `tracker`.

    The task stays that of the tracker, since the network knows no other, without its domain randomization;
    its episodes end where a walker has left its path. The exploration is that of a tracker's end, and the
    pose counts more and more, as at the end of the preset `default`.
    """
    env = replace(tracker.env, max_drift=0.6, domain_randomization=DomainRandomization())
    return TrainConfig(
        preset=POLISH,
        env=env,
        hidden=tracker.hidden,
        actor_rate=1e-4,
        action_std=((0, 0.03), (POLISH_BUDGET, 0.02)),
        scales={"pose": ((0, 32.0), (POLISH_BUDGET, 64.0))},
        budget=POLISH_BUDGET,
        seed=seed,
        start=start,
    )
