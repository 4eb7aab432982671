"""The batch of humanoids in Gymnasium, against its definition: `SyncVectorEnv` over single environments."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import data_equivalence
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv

from kinemimic.evaluate.gym import ENVIRONMENT
from kinemimic.evaluate.gym.imitation_env import ImitationEnv
from kinemimic.evaluate.gym.imitation_vector_env import ImitationVectorEnv
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.train.config.env_config import DomainRandomization, EnvConfig
from kinemimic.train.task.env import ACTIONS

SIZE, STEPS = 4, 25
# Some episodes fall, some run out of time.
CONFIG = EnvConfig(
    episode=9, max_rotation_error=0.5, domain_randomization=DomainRandomization(tilt=0.1, spin=1.0)
)


def batch(mode: AutoresetMode, size: int = SIZE) -> ImitationVectorEnv:
    return ImitationVectorEnv(size, "walk", CONFIG, "pybullet", autoreset_mode=mode)


def definition(mode: AutoresetMode) -> SyncVectorEnv:
    return SyncVectorEnv([lambda: ImitationEnv("walk", CONFIG, "pybullet")] * SIZE, autoreset_mode=mode)


@pytest.fixture(params=AutoresetMode, ids=lambda mode: mode.value)
def both(request: pytest.FixtureRequest) -> Iterator[tuple[ImitationVectorEnv, SyncVectorEnv]]:
    pair = batch(request.param), definition(request.param)
    yield pair
    for env in pair:
        env.close()


def assert_equal(ours: tuple[Any, ...], theirs: tuple[Any, ...]) -> None:
    """Numbers up to rounding: matrix products of other sizes differ in the last digits."""
    for one, other in zip(ours, theirs, strict=True):
        assert data_equivalence(plain(one), plain(other)), (one, other)


def plain(value: Any) -> Any:
    """Comparable: arrays of objects as lists, single floats apart from the last digits."""
    if isinstance(value, dict):
        return {key: plain(part) for key, part in sorted(value.items())}
    if isinstance(value, np.ndarray) and value.dtype == object:
        return [plain(part) for part in value]
    return value


def test_every_mode_is_as_gymnasium_defines_it(both: tuple[VectorEnv, SyncVectorEnv]) -> None:
    mode = both[0].metadata["autoreset_mode"]
    random = np.random.default_rng(0)
    assert_equal(*(env.reset(seed=11) for env in both))
    seen = {"terminated": 0, "truncated": 0}
    for _ in range(STEPS):
        actions = random.uniform(-0.8, 0.8, (SIZE, ACTIONS)).astype(np.float32)
        ours, theirs = (env.step(actions) for env in both)
        assert_equal(ours, theirs)
        _, _, terminated, truncated, infos = ours
        ended = terminated | truncated
        seen["terminated"] += terminated.sum()
        seen["truncated"] += truncated.sum()
        assert ("final_obs" in infos) == (mode is AutoresetMode.SAME_STEP and ended.any())
        if mode is AutoresetMode.DISABLED and ended.any():
            # SyncVectorEnv takes the mask out of the options that it is given.
            assert_equal(*(env.reset(options={"reset_mask": ended}) for env in both))
    assert min(seen.values()) > 0, "expected falls and episodes that run out of time"


def test_only_the_masked_are_reset_and_only_from_their_seeds(both: tuple[VectorEnv, SyncVectorEnv]) -> None:
    mask = np.array([True, False, True, False])
    for env in both:
        env.reset(seed=[3, 1, 4, 1])
        env.step(np.zeros((SIZE, ACTIONS), np.float32))
    results = [env.reset(seed=20, options={"reset_mask": mask, "phase": 0.25}) for env in both]
    assert_equal(*results)
    np.testing.assert_allclose(results[0][0][mask, 0], 1.0, atol=1e-6)  # the sine at a quarter of the cycle
    actions = np.full((SIZE, ACTIONS), 0.1, np.float32)
    for _ in range(2):
        assert_equal(*(env.step(actions) for env in both))


def test_ended_without_a_reset_is_refused() -> None:
    env = batch(AutoresetMode.DISABLED)
    with pytest.raises(ResetNeeded, match=r"a reset of environments \[0, 1, 2, 3\]"):
        env.step(np.zeros((SIZE, ACTIONS), np.float32))
    env.reset(seed=0)
    ended = np.zeros(SIZE, dtype=bool)
    while not ended.any():
        _, _, terminated, truncated, _ = env.step(np.ones((SIZE, ACTIONS), np.float32))
        ended = terminated | truncated
    with pytest.raises(ResetNeeded):
        env.step(np.ones((SIZE, ACTIONS), np.float32))
    env.close()


def test_make_vec_makes_it_without_a_warning() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = gymnasium.make_vec(
            ENVIRONMENT,
            num_envs=3,
            vectorization_mode="vector_entry_point",
            motion="walk",
            engine="pybullet",
            autoreset_mode="SameStep",
            max_episode_steps=5,
        )
    assert isinstance(env, ImitationVectorEnv)
    assert env.observation_space.shape == (3, 272)
    assert env.action_space.contains(np.ones((3, ACTIONS), np.float32))
    assert env.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    assert env.render() is None
    assert env.spec is not None and env.spec.id == ENVIRONMENT
    env.reset(seed=0)
    steps = [env.step(np.zeros((3, ACTIONS), np.float32))[3].all() for _ in range(5)]
    assert steps == [False] * 4 + [True]
    env.close()
    env.close()


def test_the_engines_threads_change_nothing() -> None:
    pytest.importorskip("kinemimic_native", reason="the native engine is not built here")
    found = []
    for threads in (1, 2):
        env = ImitationVectorEnv(SIZE, "walk", replace(CONFIG, episode=30), "native", threads=threads)
        env.reset(seed=2)
        random = np.random.default_rng(1)
        for _ in range(15):
            observations, *_ = env.step(0.3 * random.standard_normal((SIZE, ACTIONS)).astype(np.float32))
        found.append(observations)
        env.close()
    np.testing.assert_array_equal(*found)


def test_wrong_arguments_are_refused_by_name() -> None:
    with pytest.raises(KinemimicError, match="expected one of NextStep, SameStep, Disabled, found 'same'"):
        ImitationVectorEnv(2, "walk", engine="pybullet", autoreset_mode="same")
    with pytest.raises(KinemimicError, match="num_envs: expected at least 1, found 0"):
        ImitationVectorEnv(0, "walk")
    env = batch(AutoresetMode.NEXT_STEP, 2)
    for mask in ([True], np.zeros(2, bool), np.ones(2)):
        with pytest.raises(KinemimicError, match="options: expected reset_mask, 2 booleans"):
            env.reset(options={"reset_mask": mask})
    with pytest.raises(KinemimicError, match="seed: expected one or 2, found 3"):
        env.reset(seed=[1, 2, 3])
    with pytest.raises(KinemimicError, match="or one for each of 2, found"):
        env.reset(options={"phase": [0.0, 0.5, 0.7]})
    with pytest.raises(KinemimicError, match=r"shape \(2, 42\), found them of shape \(42,\)"):
        env.reset()
        env.step(np.zeros(ACTIONS, np.float32))
    env.close()
