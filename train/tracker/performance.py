"""Evaluation episodes of a tracker on many motions at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.gait.curve_metrics import joint_fits
from kinemimic.retarget.humanoid.motion import joint_angles
from kinemimic.train.config.env_config import EnvConfig, RewardConfig
from kinemimic.train.reference.reference_library import FollowedReference, ReferenceLibrary
from kinemimic.train.rollout.evaluation import CYCLIC_FRAMES, Episode
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.rollout.rollout import node_rotations, roll_out
from kinemimic.train.sim.engines import open_world
from kinemimic.train.sim.world import CONTROL_RATE
from kinemimic.train.task.env import ImitationBatch

PHASE = 1.0 / 26.0  # of a loop's start: as on one motion, no phase that is reported


def perform(
    policy: Policy,
    library: ReferenceLibrary,
    motions: NDArray[np.intp],
    config: EnvConfig,
    reward: RewardConfig,
    engine: str,
    phase: float = PHASE,
) -> list[Episode]:
    """One episode of each of these motions (N,) of a library: a loop for CYCLIC_FRAMES, others to their end.

    phase: at which a loop starts. R² of an episode with a fall is 0.
    """
    if not len(motions):
        return []
    cyclic, durations = library.cyclic[motions], library.durations[motions]
    of = np.where(cyclic, CYCLIC_FRAMES, np.maximum(1, (durations * CONTROL_RATE + 1e-6).astype(int)))
    batch = ImitationBatch(
        open_world(len(motions), engine), FollowedReference(library, np.array(motions)), config
    )
    batch.reward = reward
    batch.reset(np.arange(len(motions)), np.where(cyclic, phase, 0.0))
    rewards, simulated, expected = [], [], []

    def record(*_: object) -> None:
        rewards.append(batch.terms().sum(axis=1))
        simulated.append(node_rotations(batch.bodies))
        expected.append(batch.reference.nodes(batch.phases))

    fallen_at = roll_out(batch, policy.act, int(of.max()), record)
    batch.world.close()
    upright = np.minimum(fallen_at, of)
    gained, largest = np.array(rewards), sum(reward.weights.values())
    reached = np.array(simulated), np.array(expected)  # (T, N, 20, 4), T until everyone fell
    episodes = []
    for k, (frames, total) in enumerate(zip(upright.tolist(), of.tolist(), strict=True)):
        knee = hip = 0.0
        if frames == total:
            moved, wanted = (joint_angles(rotations[:total, k]) for rotations in reached)
            fits = joint_fits(wanted, moved)
            knee, hip = (fits[joint].both.r2_upright for joint in ("knee", "hip"))
        episodes.append(Episode(frames, total, float(gained[:frames, k].sum()) / total / largest, knee, hip))
    return episodes
