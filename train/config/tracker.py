"""Settings of the trainings of trackers: for gaits, and for motions on the spot."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.env_config import DomainRandomization, EnvConfig, RewardConfig, Tracking

TRACKER, STANDING = "tracker", "standing"


# Learning rate of the actor when training starts from a tracker: until it adapts, the usual rate would undo
# what the tracker has learned.
START_RATE = 4e-5


def tracker_config() -> TrainConfig:
    """Settings of the tracker that ships for walks and runs.

    The preview reaches 0.4 s ahead. Exploration narrows, and the pose counts more, as the tracker learns to
    stay upright. Then come what makes it keep up with walks that it has never seen: starts beside the
    reference, references whose path is faster or slower than their steps, and a path that counts more. They
    would slow the first hours.
    """
    return TrainConfig(
        preset=TRACKER,
        env=EnvConfig(
            reward=RewardConfig(
                weights={"pose": 0.45, "linear": 0.18, "angular": 0.12, "height": 0.10, "path": 0.20}
            ),
            preview=(1, 4, 12),
            # An arm that is held as in no motion of the training made trackers without this limit fall.
            tracking=Tracking(max_body_error=0.5, leash=0.3, limit=3.0, arm_limit=1.0),
            max_drift=float("1e9"),
            domain_randomization=DomainRandomization(
                tilt=0.03, spin=0.15, displacement=0.3, pace=(0.95, 1.1)
            ),
        ),
        num_envs=256,
        horizon=64,
        kl_target=0.05,
        minibatch=2048,
        epochs=5,
        discount=0.97,
        action_std=((0, 0.08), (3_000_000, 0.05), (40_000_000, 0.04), (60_000_000, 0.03)),
        # The target of an ankle moves the body a quarter (pitch) to a fiftieth (roll) as much as a hip's:
        # the stable PD treats the foot as free, also on the ground.
        ankle_exploration=4.0,
        scales={
            "pose": ((6_000_000, 8.0), (30_000_000, 32.0), (54_000_000, 48.0)),
            "path": ((38_000_000, 8.0), (39_000_000, 16.0)),
        },
        strength=((38_000_000, 0.0), (39_000_000, 1.0)),
        # Training of the shipped tracker ended before this shrinks.
        body_error=((54_000_000, 0.5), (60_000_000, 0.4)),
        budget=60_000_000,
    )


def standing_config() -> TrainConfig:
    """Settings of the tracker that ships for motions on the spot.

    Balance is part of the task. Starts are on the reference: from beside it, the humanoid would have to walk.
    """
    config = tracker_config()
    return replace(
        config,
        preset=STANDING,
        env=replace(
            config.env,
            balance=True,
            tracking=Tracking(max_body_error=0.5, leash=0.3, limit=3.0, arm_limit=3.0),
            domain_randomization=DomainRandomization(tilt=0.03, spin=0.15),
        ),
        hidden=(256, 128),
        num_envs=512,
        action_std=((0, 0.05), (20_000_000, 0.03)),
        scales={"pose": ((1_000_000, 8.0), (6_000_000, 24.0))},
        strength=((0, 1.0),),
        body_error=(),
        budget=32_600_000,
    )


# Settings by the name of the preset.
TRACKER_PRESETS: Mapping[str, Callable[[], TrainConfig]] = {
    TRACKER: tracker_config,
    STANDING: standing_config,
}
