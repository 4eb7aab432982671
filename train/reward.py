"""Terms of the imitation reward (the paper's Eq. 1-5): pure functions of simulated and reference bodies.

Each gives an error (E,); `rewards` turns errors into Σ w exp(-k e).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.rotations import angle_between
from kinemimic.retarget.body import BODY_NAMES
from kinemimic.train.config import POSE_WEIGHTS, RewardConfig
from kinemimic.train.world import BodyStates

Array = NDArray[np.float64]

_WEIGHTS: Array = np.array([POSE_WEIGHTS[name] for name in BODY_NAMES])


def pose_angles(sim: BodyStates, ref: BodyStates) -> Array:
    """Angles (E, 15) between simulated and reference: pelvis in the world, joints locally, rad."""
    root = angle_between(sim.rotations[:, :1], ref.rotations[:, :1])
    return np.concatenate([root, angle_between(sim.joints, ref.joints)], axis=1)


def errors(sim: BodyStates, ref: BodyStates, config: RewardConfig) -> dict[str, Array]:
    """The errors eᵢ (E,) of the terms that have a weight, in the form of the configuration."""
    angles = pose_angles(sim, ref)
    linear, angular = sim.linear - ref.linear, sim.angular - ref.angular
    height = sim.positions[:, 0, 2] - ref.positions[:, 0, 2]
    path = sim.positions[:, 0, :2] - ref.positions[:, 0, :2]
    if config.form == "squares":
        every = {
            "pose": angles**2 @ _WEIGHTS,
            "linear": np.mean(np.sum(linear**2, axis=-1), axis=-1),
            "angular": np.mean(np.sum(angular**2, axis=-1), axis=-1),
            "height": height**2,
            "path": np.sum(path**2, axis=-1),
        }
    else:
        every = {
            "pose": np.linalg.norm(angles, axis=-1),
            "linear": np.linalg.norm(linear, axis=(1, 2)),
            "angular": np.linalg.norm(angular, axis=(1, 2)),
            "height": np.abs(height),
            "path": np.linalg.norm(path, axis=-1),
        }
    return {name: every[name] for name in config.weights}


def rewards(sim: BodyStates, ref: BodyStates, config: RewardConfig) -> Array:
    """Weighted terms (E, K) in the sequence of the configuration's weights; their sum is the reward."""
    found = errors(sim, ref, config)
    return np.stack(
        [weight * np.exp(-config.scales[name] * found[name]) for name, weight in config.weights.items()],
        axis=-1,
    )
