"""stable-baselines3 on vector environments: what its own list of environments gives, and a training."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

from kinemimic.evaluate.gym.imitation_env import ImitationEnv
from kinemimic.evaluate.gym.imitation_vector_env import ImitationVectorEnv
from kinemimic.evaluate.gym.stable_baselines import StableBaselinesVecEnv
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.train.config.env_config import EnvConfig

SIZE = 3
SHORT = replace(EnvConfig(), episode=6)


def pole() -> gymnasium.Env:
    return gymnasium.make("CartPole-v1", max_episode_steps=12)


def walker() -> gymnasium.Env:
    return ImitationEnv("walk", SHORT, "pybullet")


def walkers() -> VectorEnv:
    return ImitationVectorEnv(SIZE, "walk", SHORT, "pybullet", autoreset_mode="SameStep")


def poles() -> VectorEnv:
    return SyncVectorEnv([pole] * SIZE, autoreset_mode=AutoresetMode.SAME_STEP)


@pytest.mark.parametrize(("many", "single"), [(poles, pole), (walkers, walker)], ids=["CartPole", "ours"])
def test_it_is_its_own_list_of_environments(
    many: Callable[[], VectorEnv], single: Callable[[], gymnasium.Env]
) -> None:
    ours, theirs = StableBaselinesVecEnv(many()), DummyVecEnv([single] * SIZE)
    for env in (ours, theirs):
        env.seed(5)
    np.testing.assert_allclose(ours.reset(), theirs.reset(), atol=1e-6)
    theirs.action_space.seed(0)
    ends = []
    for _ in range(30):
        actions = np.array([theirs.action_space.sample() for _ in range(SIZE)])
        (seen, rewards, dones, infos), expected = ours.step(actions), theirs.step(actions)
        np.testing.assert_allclose(seen, expected[0], atol=1e-4)
        np.testing.assert_allclose(rewards, expected[1], atol=1e-5)
        assert rewards.dtype == expected[1].dtype
        np.testing.assert_array_equal(dones, expected[2])
        for info, wanted in zip(infos, expected[3], strict=True):
            assert info.keys() == wanted.keys()
            assert info["TimeLimit.truncated"] == wanted["TimeLimit.truncated"]
            if "terms" in wanted:
                assert info["terms"] == pytest.approx(wanted["terms"], abs=1e-5)
            if "terminal_observation" in wanted:
                last = (one["terminal_observation"] for one in (info, wanted))
                np.testing.assert_allclose(*last, atol=1e-4)
                ends.append(wanted["TimeLimit.truncated"])
    assert True in ends
    for env in (ours, theirs):
        env.close()


def test_ppo_trains_on_it() -> None:
    env = VecNormalize(StableBaselinesVecEnv(walkers()), norm_reward=False)
    model = PPO("MlpPolicy", env, n_steps=16, batch_size=16, n_epochs=1, seed=0, device="cpu")
    before = model.policy.action_net.weight.detach().clone()
    model.learn(2 * 16 * SIZE)
    assert model.num_timesteps == 2 * 16 * SIZE
    assert (model.policy.action_net.weight != before).any()
    assert env.get_original_obs().shape == (SIZE, 272)
    env.close()


def test_another_autoreset_is_refused() -> None:
    env = ImitationVectorEnv(1, "walk", engine="pybullet")
    with pytest.raises(KinemimicError, match="autoreset_mode: expected \"SameStep\", found 'NextStep'"):
        StableBaselinesVecEnv(env)
    env.close()


def test_options_are_of_all_environments() -> None:
    env = StableBaselinesVecEnv(walkers())
    env.set_options({"phase": 0.25})
    np.testing.assert_allclose(env.reset()[:, 0], 1.0, atol=1e-6)
    assert len(set(env.reset()[:, 0])) > 1  # only once
    env.set_options([{"phase": 0.1}, {"phase": 0.2}, {"phase": 0.3}])
    with pytest.raises(KinemimicError, match="options: expected the same for every environment"):
        env.reset()
    env.close()
