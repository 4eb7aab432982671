"""The presets.

`default` follows its reference most closely, `robust` resists disturbances, `paper` has the published values.
The others train `default`'s task with an algorithm of stable-baselines3 (`baseline_config.py`).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.train.config.baseline_config import A2c, Ddpg, Sac, StablePpo, Td3
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.env_config import DomainRandomization, EnvConfig, RewardConfig

PRESETS: dict[str, TrainConfig] = {
    "default": TrainConfig(),
    # For pushes, low friction, other masses and late actions. Episodes tolerate larger errors before they
    # end; robustness costs fit. A push moves the humanoid half a metre off its path, where the path term of
    # `default` is nearly zero and has no gradient: it would walk on too slowly. So the term has a longer
    # range, and a larger weight, since the same distance then changes it less.
    "robust": TrainConfig(
        preset="robust",
        env=EnvConfig(
            reward=RewardConfig(
                weights={"pose": 0.45, "linear": 0.18, "angular": 0.12, "height": 0.10, "path": 0.45}
            ),
            max_height_error=0.35,
            max_rotation_error=1.3,
            max_drift=1.5,
            domain_randomization=DomainRandomization(
                push=(0.0, 300.0),
                rest=(1.0, 3.0),
                friction=(0.5, 1.0),
                mass=(0.9, 1.1),
                delay=(0.0, 0.0125),
                tilt=0.05,
                spin=0.2,
            ),
        ),
        action_std=((0, 0.08), (400_000, 0.05), (1_600_000, 0.03)),
        strength=((400_000, 0.0), (1_400_000, 1.0)),
        scales={
            "pose": ((300_000, 8.0), (500_000, 32.0), (1_100_000, 64.0)),
            "path": ((400_000, 8.0), (1_400_000, 2.0)),
        },
        budget=3_000_000,
    ),
    # Networks, rates, discount, batch, epochs, clip and entropy as published; one batch per epoch. The paper
    # does not give the KL target η and the constants θ, ω, wᵢ; it has no torque feed-forward and no
    # mirroring.
    "paper": TrainConfig(
        preset="paper",
        env=EnvConfig(
            reward=RewardConfig(
                form="norm",
                weights={"pose": 0.5, "linear": 0.2, "angular": 0.15, "height": 0.15},
                scales={"pose": 1.0, "linear": 0.2, "angular": 0.05, "height": 10.0},
            ),
            max_drift=float("1e9"),
            torque_feedforward=False,
            mirror=False,
        ),
        hidden=(1024, 512),
        minibatch=4096,
        epochs=10,
        kl_penalty=True,
        kl_target=0.01,
        adapt_rate=False,
        discount=0.99,
        learn_action_std=True,
        action_std=((0, 0.15),),
        scales={},
        entropy=0.01,
        entropy_decay=0.95,
        budget=1_000_000,
    ),
    # The baselines, on `default`'s task with its networks, environments, discount and schedules of action_std
    # and reward, except where a search (`evaluate/compare/variants.py`) found better values.
    "ddpg": TrainConfig(
        preset="ddpg", action_std=((0, 0.2), (400_000, 0.1), (1_000_000, 0.05)), baseline=Ddpg()
    ),
    "td3": TrainConfig(
        preset="td3", action_std=((0, 0.2), (400_000, 0.1), (1_000_000, 0.05)), baseline=Td3()
    ),
    "sac": TrainConfig(preset="sac", baseline=Sac()),
    # A quarter of the environments with four times the horizon: gradient steps on 64 new samples are four
    # times as many as on 256, and A2C takes only one for each.
    "a2c": TrainConfig(preset="a2c", num_envs=16, horizon=256, baseline=A2c()),
    "sb3-ppo": TrainConfig(preset="sb3-ppo", baseline=StablePpo()),
}


def preset(name: str, **changes: Any) -> TrainConfig:
    """The settings of a preset with some fields replaced; KinemimicError for an unknown name.

    changes: fields of `TrainConfig`, for example preset("default", seed=1, budget=300_000).
    """
    if name not in PRESETS:
        raise KinemimicError(f"expected a preset among {', '.join(PRESETS)}, found {name!r}")
    return replace(PRESETS[name], **changes)
