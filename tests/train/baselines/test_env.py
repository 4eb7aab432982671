"""The figures as stable-baselines3 has them: its expectations of a `VecEnv`, and our task unchanged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from stable_baselines3.common.vec_env import VecNormalize

from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.baselines.env import ImitationVecEnv
from kinemimic.train.baselines.replay_memory import RescalingReplayBuffer
from kinemimic.train.config.env_config import DomainRandomization, EnvConfig
from kinemimic.train.config.presets import PRESETS
from kinemimic.train.reference.reference import Reference
from kinemimic.train.sampling.sampler import Sampler
from kinemimic.train.sim.engines import open_world
from kinemimic.train.task.env import ACTIONS, ImitationBatch
from kinemimic.train.task.observation import OBSERVATIONS

FIGURES = 3
CONFIG = replace(PRESETS["ddpg"], num_envs=FIGURES, env=replace(PRESETS["ddpg"].env, episode=5))


def figures(motion: Motion, env: EnvConfig = CONFIG.env, seed: int = 4) -> ImitationVecEnv:
    seeds = np.random.SeedSequence(seed).spawn(FIGURES)
    made = ImitationVecEnv(Sampler(motion, env, seeds, "pybullet"), replace(CONFIG, env=env))
    made.begin_round(env.reward, 0.0)
    return made


def test_it_is_what_stable_baselines3_takes(motion: Motion) -> None:
    env = figures(motion)
    assert env.num_envs == FIGURES
    assert env.observation_space.shape == (OBSERVATIONS,)
    assert env.action_space.shape == (ACTIONS,)
    assert (env.action_space.low == -0.5).all() and (env.action_space.high == 0.5).all()
    seen = env.reset()
    assert seen.dtype == np.float32 and seen.shape == (FIGURES, OBSERVATIONS)
    seen, rewards, dones, infos = env.step(np.zeros((FIGURES, ACTIONS), np.float32))
    assert seen.dtype == rewards.dtype == np.float32
    assert rewards.shape == dones.shape == (FIGURES,)
    assert dones.dtype == np.bool_
    assert len(infos) == FIGURES
    assert env.env_is_wrapped(VecNormalize) == [False] * FIGURES
    assert not env.has_attr("phases")


def test_same_action_same_reward_as_the_batch(motion: Motion) -> None:
    env, random = figures(motion), np.random.default_rng(0)
    batch = ImitationBatch(open_world(FIGURES, "pybullet"), Reference(motion), CONFIG.env)
    here = env.sampler.batch.snapshot()
    batch.restore(here)
    env.sampler.batch.restore(here)
    for _ in range(4):
        actions = random.normal(0, 0.05, (FIGURES, ACTIONS)).astype(np.float32)
        seen, rewards, dones, infos = env.step(actions)
        step = batch.step(actions.astype(np.float64))
        assert not dones.any()
        np.testing.assert_array_equal(seen, step.observations.astype(np.float32))
        np.testing.assert_array_equal(rewards, step.terms.sum(axis=1).astype(np.float32))
        np.testing.assert_array_equal([info["terms"] for info in infos], step.terms)


def test_an_episode_that_ends_by_time_is_told_from_a_fall_and_the_next_begins_at_once(motion: Motion) -> None:
    env = figures(motion)
    still = np.zeros((FIGURES, ACTIONS), np.float32)
    for _ in range(4):
        seen, _, dones, infos = env.step(still)
        assert not dones.any()
        assert not any("terminal_observation" in info for info in infos)
    before = env.sampler.batch.phases.copy()
    seen, _, dones, infos = env.step(still)
    assert dones.all()
    for k, info in enumerate(infos):
        assert info["TimeLimit.truncated"] is True
        assert info["terminal_observation"].shape == (OBSERVATIONS,)
        assert not np.array_equal(info["terminal_observation"], seen[k])
    np.testing.assert_array_equal(seen, env.sampler.batch.observe().astype(np.float32))
    assert (env.sampler.batch.ages == 0).all()
    assert not np.allclose(env.sampler.batch.phases, before + env.sampler.batch._increment)
    assert env.statistics.episode_lengths == [5] * FIGURES


def test_a_fall_is_no_matter_of_time_and_earns_nothing(motion: Motion) -> None:
    env = figures(motion, replace(CONFIG.env, max_drift=0.0))
    _, rewards, dones, infos = env.step(np.zeros((FIGURES, ACTIONS), np.float32))
    assert dones.all()
    assert (rewards == 0.0).all()
    assert [info["TimeLimit.truncated"] for info in infos] == [False] * FIGURES


def test_figures_begin_where_those_of_our_ppo_begin(motion: Motion) -> None:
    """The same seed draws the same phases and hardships, however they are stepped."""
    hard = replace(
        CONFIG.env, domain_randomization=DomainRandomization(push=(10.0, 90.0), rest=(0.05, 0.1), tilt=0.1)
    )
    env = figures(motion, hard)
    sampler = Sampler(motion, hard, np.random.SeedSequence(4).spawn(FIGURES), "pybullet")
    sampler.begin_round(hard.reward)
    np.testing.assert_array_equal(env.sampler.batch.phases, sampler.batch.phases)
    env.begin_round(hard.reward, 1.0)
    env.reset()
    sampler.restart(np.arange(FIGURES), 1.0)
    np.testing.assert_array_equal(env.sampler.batch.phases, sampler.batch.phases)
    np.testing.assert_array_equal(env.sampler.batch.observe(), sampler.batch.observe())


def test_old_samples_are_told_under_the_reward_in_force(motion: Motion) -> None:
    """As if they had been sampled under it."""
    env, random = figures(motion), np.random.default_rng(0)
    early, late = CONFIG.reward(0), CONFIG.final_reward
    assert early != late
    spaces, terms = (env.observation_space, env.action_space), len(early.weights)
    memory = RescalingReplayBuffer(30, *spaces, "cpu", FIGURES, terms=terms)
    wanted = []
    memory.set_reward(early)
    for k in range(8):
        actions = random.normal(0, 0.3, (FIGURES, ACTIONS)).astype(np.float32)
        before, (seen, rewards, dones, infos) = env.reset(), env.step(actions)
        memory.add(before, seen, actions, rewards, dones, infos)
        batch = env.sampler.batch
        batch.reward = late
        wanted.append(np.where(dones, 0.0, batch.terms().sum(axis=1)))
        batch.reward = early
        assert memory.rewards[k] == pytest.approx(rewards)
    memory.set_reward(late)
    assert memory.rewards[:8] == pytest.approx(np.array(wanted), rel=1e-4)
    assert not (memory.rewards[8:]).any()


def test_a_full_memory_comes_back_as_it_was(motion: Motion) -> None:
    env = figures(motion)
    one, other = (
        RescalingReplayBuffer(7 * FIGURES, env.observation_space, env.action_space, "cpu", FIGURES, terms=5)
        for _ in range(2)
    )
    one.set_reward(CONFIG.reward(0))
    before = env.reset()
    for _ in range(10):
        seen, rewards, dones, infos = env.step(np.zeros((FIGURES, ACTIONS), np.float32))
        following = seen.copy()
        for k in np.flatnonzero(dones):
            following[k] = infos[k]["terminal_observation"]
        one.add(before, following, np.zeros((FIGURES, ACTIONS), np.float32), rewards, dones, infos)
        before = seen
    assert one.full
    tensors = one.tensors()
    # Most of what follows is what the next step begins with, and is stored once.
    assert len(tensors["next_at_breaks"]) < 0.6 * one.next_observations[..., 0].size
    other.restore(tensors, one.pos)
    assert (other.pos, other.full) == (one.pos, True)
    for name in ("observations", "next_observations", "actions", "rewards", "dones", "timeouts", "errors"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
