"""Settings of a training that starts from a tracker and goes on with one motion."""

from __future__ import annotations

from dataclasses import replace

from kinemimic.train.config.config import DomainRandomization, TrainConfig

POLISH = "polish"
POLISH_BUDGET = 200_000  # samples


def polish(tracker: TrainConfig, start: str, seed: int = 0) -> TrainConfig:
    """Settings for the policy with hash `start`, which was trained with the settings `tracker`.

    The task stays that of the tracker, since the network knows no other, without its domain randomization;
    its episodes end where a walker has left its path. What is left to learn is to follow the joints, so the
    pose counts much from the start. Rounds are half as long as in `default`, and each may change the policy
    four times as much: it stays upright already, and has few rounds.
    """
    env = replace(tracker.env, max_drift=0.6, domain_randomization=DomainRandomization())
    return TrainConfig(
        preset=POLISH,
        env=env,
        hidden=tracker.hidden,
        horizon=32,
        kl_target=0.4,
        action_std=((0, 0.08), (180_000, 0.03)),
        scales={"pose": ((0, 64.0), (180_000, 128.0))},
        budget=POLISH_BUDGET,
        seed=seed,
        start=start,
    )
