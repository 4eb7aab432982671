"""A corrected policy: one network for policy and corrections."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from kinemimic.evaluate.policies.recipe import POLICIES
from kinemimic.retarget.formats.motion_json import read_motion_json
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.learning_control import LearningControl
from kinemimic.train.learning_control.corrections import Corrections, joint, steps_of_cycle
from kinemimic.train.learning_control.corrector import Corrector, correction_samples
from kinemimic.train.learning_control.distillation import distilled
from kinemimic.train.learning_control.learning import LONG, SHARES
from kinemimic.train.learning_control.response import PROBES
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.sim.engines import open_world, resolve
from kinemimic.train.task.env import ACTION_SCALE, ACTIONS, ImitationBatch

QUICK = LearningControl(iterations=2, environments=4, cycles=1, rounds=1, steps=1)
AT_MOST = (4 * (3 + len(SHARES) * LONG + 6) + 2 * PROBES) * 38


class Fixed:
    """An algorithm that learns nothing."""

    def __init__(self, policy: Policy, config: TrainConfig) -> None:
        self.now, self.config = policy, config

    def policy(self) -> Policy:
        return self.now

    def begin_from(self, policy: Policy) -> None:
        self.now = policy


def test_a_distilled_policy_acts_as_with_the_corrections(tracker: tuple[Policy, TrainConfig]) -> None:
    policy, count = tracker[0], 16
    reference = Reference(read_motion_json(POLICIES / "walk" / "motion.json"))
    batch = ImitationBatch(open_world(count, "pybullet"), reference, tracker[1].measured_env)
    rows = steps_of_cycle(batch.reference)
    table = np.zeros((rows, ACTIONS))
    table[:, joint("shin_left")] = 0.1 * np.sin(2.0 * np.pi * np.arange(rows) / rows)
    corrections = Corrections(table)
    found = distilled(policy, corrections, batch, seed=1)
    assert found.shape == policy.shape
    batch.reset(np.arange(count), (np.arange(count) + 0.4) / count)
    missing, asked = [], []
    for _ in range(rows):
        observations = batch.observe()
        change = batch.reflected(corrections.at(batch.phases))
        asked.append(change * ACTION_SCALE)
        missing.append((found.act(observations) - policy.act(observations) - change) * ACTION_SCALE)
        batch.step(policy.act(observations) + change)
    batch.world.close()
    assert np.square(missing).sum() < 0.35 * np.square(asked).sum()


def test_a_correction_takes_the_samples_that_it_says_and_repeats_to_the_bit(
    tracker: tuple[Policy, TrainConfig],
) -> None:
    motion = read_motion_json(POLICIES / "walk" / "motion.json")
    config = replace(tracker[1], learning_control=QUICK)
    layers = []
    for _ in range(2):
        algorithm = Fixed(tracker[0], config)
        corrector = Corrector(algorithm, motion, resolve("auto"))
        taken: list[int] = []

        def proceed(samples: int, taken: list[int] = taken) -> bool:
            taken.append(samples)
            return True

        corrected = corrector.correct(proceed)
        assert corrected is not None
        assert sum(taken) == AT_MOST - (len(SHARES) - 1) * LONG * 4 * 38
        layers.append(corrected.layers)
        assert algorithm.now is tracker[0]
        corrector.adopt(corrected)
        assert algorithm.now is corrected
        corrector.close()
    for one, other in zip(*layers, strict=True):
        np.testing.assert_array_equal(one[0], other[0])
        np.testing.assert_array_equal(one[1], other[1])


def test_the_samples_follow_from_the_settings() -> None:
    motion = read_motion_json(POLICIES / "walk" / "motion.json")
    assert correction_samples(motion, QUICK) == AT_MOST


def test_a_configuration_without_one_has_no_corrector(tracker: tuple[Policy, TrainConfig]) -> None:
    with pytest.raises(ValueError, match="expected a configuration with learning control"):
        Corrector(Fixed(*tracker), read_motion_json(POLICIES / "walk" / "motion.json"), "pybullet")
