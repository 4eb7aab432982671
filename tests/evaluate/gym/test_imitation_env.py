"""One humanoid in Gymnasium: its checkers have nothing to say, and the task is ours."""

from __future__ import annotations

import subprocess
import sys
import warnings
from dataclasses import replace
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.utils import seeding
from gymnasium.utils.env_checker import check_env
from stable_baselines3.common.env_checker import check_env as check_for_stable_baselines

from kinemimic.evaluate.gym.imitation_env import ImitationEnv
from kinemimic.evaluate.gym.task import ACTION_LIMIT, spaces
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.data_folder import DATASETS
from kinemimic.retarget.formats.motion_json import read_motion_json
from kinemimic.train.config.env_config import DomainRandomization, EnvConfig
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.scenario.scenario import Load, Range, Scenario
from kinemimic.train.sim.engines import open_world
from kinemimic.train.task.domain_randomization import draw
from kinemimic.train.task.env import ACTIONS, ImitationBatch
from kinemimic.train.task.observation import observation_size

WALK = DATASETS / "policies" / "walk"


def made(**options: object) -> gymnasium.Env:
    return gymnasium.make("kinemimic/Imitation-v0", motion="walk", engine="pybullet", **options)


def test_both_checkers_pass_without_a_warning() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = made().unwrapped
        check_env(env)
        check_for_stable_baselines(env)
        env.close()


@pytest.mark.parametrize(
    "program",
    [
        # Both ways that Gymnasium documents to name the package that registers an environment.
        "import kinemimic.evaluate.gym\nname = 'kinemimic/Imitation-v0'",
        "name = 'kinemimic.evaluate.gym:kinemimic/Imitation-v0'",
    ],
)
def test_gymnasium_finds_it_where_its_package_is_named(program: str) -> None:
    program = (
        f"import sys, gymnasium\n{program}\n"
        "print(sorted(name for name in sys.modules if name.startswith('kinemimic.')))\n"
        "env = gymnasium.make(name, motion='walk', engine='pybullet')\n"
        "print(env.reset(seed=0)[0].shape, env.action_space.shape)"
    )
    printed = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True)
    imported, shapes = printed.stdout.splitlines()
    assert imported in ("[]", "['kinemimic.evaluate', 'kinemimic.evaluate.gym']")
    assert shapes == "(272,) (42,)"


def test_a_shipped_policy_walks_in_it() -> None:
    """Its actions fit into [-1, 1], and its observations into their bounds."""
    policy, _ = Policy.load(WALK / "policy.safetensors")
    env = made(config=replace(EnvConfig(), episode=60), disable_env_checker=True)
    observation, _ = env.reset(seed=0)
    rewards, truncated = [], False
    while not truncated:
        action = policy.act(observation[None])[0] / ACTION_LIMIT
        assert action in env.action_space
        observation, reward, terminated, truncated, info = env.step(action)
        assert observation in env.observation_space
        assert not terminated
        assert sum(info["terms"].values()) == pytest.approx(reward)
        rewards.append(reward)
    assert len(rewards) == 60
    assert np.mean(rewards) > 0.8
    env.close()


def test_an_episode_has_full_domain_randomization() -> None:
    """Drawn at full strength from Gymnasium's seed."""
    hard = EnvConfig(start_anywhere=False, domain_randomization=DomainRandomization(tilt=0.1, spin=0.5))
    env = made(config=hard)
    observation, _ = env.reset(seed=7)
    motion = read_motion_json(WALK / "motion.json")
    batch = ImitationBatch(open_world(1, "pybullet"), Reference(motion), hard)
    drawn = draw(hard.domain_randomization, 1.0, seeding.np_random(7)[0])
    batch.reset(np.array([0]), np.array([0.0]), drawn)
    np.testing.assert_allclose(observation, batch.observe()[0], atol=1e-5)
    env.close()
    batch.world.close()


def test_it_applies_its_scenario() -> None:
    push = Load("torso", Range.of(0.2), Range.of(0.2), force=Range.of(900.0, 0.0, 0.0))
    shove = Scenario("shove", phase=Range.of(0.0), loads=(push,))
    ends = []
    for scenario in (shove, None):
        config = EnvConfig(scenario=scenario, start_anywhere=scenario is not None)
        env = ImitationEnv("walk", config, "pybullet")
        env.reset(seed=0)
        for _ in range(8):
            observation, *_ = env.step(np.zeros(ACTIONS, np.float32))
        ends.append(observation)
        env.close()
    assert np.abs(ends[0] - ends[1]).max() > 0.1


def test_time_up_truncates_and_a_fall_terminates() -> None:
    env = ImitationEnv(WALK, replace(EnvConfig(), episode=3), engine="pybullet")
    env.reset(seed=0, options={"phase": 0.0})
    ends = [env.step(np.zeros(ACTIONS, dtype=np.float32))[2:4] for _ in range(3)]
    assert ends == [(False, False), (False, False), (False, True)]
    env.close()
    limp = ImitationEnv(WALK, engine="pybullet")
    limp.reset(seed=0, options={"phase": 0.0})
    for _ in range(100):
        _, reward, terminated, truncated, _ = limp.step(np.full(ACTIONS, 1.0, dtype=np.float32))
        if terminated or truncated:
            break
    assert terminated
    assert not truncated
    assert reward == 0.0
    limp.close()


def test_an_action_beyond_the_limits_is_clipped() -> None:
    found = []
    for size in (1.0, 3.0):
        env = ImitationEnv("walk", engine="pybullet")
        env.reset(seed=0)
        found.append(env.step(np.full(ACTIONS, size, dtype=np.float32))[0])
        env.close()
    np.testing.assert_array_equal(*found)


@pytest.mark.parametrize(
    ("motion", "told"),
    [
        ("wlak", "motion: expected a motion.json, a run folder or a shipped policy .*walk.*found 'wlak'"),
        ("kinect_walk", "found 'kinect_walk'"),  # its motion does not ship
        (WALK / "scores.json", "scores.json: "),
    ],
)
def test_what_is_no_motion_is_refused(motion: str | Path, told: str) -> None:
    with pytest.raises(KinemimicError, match=told):
        ImitationEnv(motion, engine="pybullet")


def test_a_picture_shows_both_figures_where_they_are() -> None:
    """Orange and blue near the centre, and again after five steps."""
    env = made(render_mode="rgb_array", disable_env_checker=True)
    env.reset(seed=0, options={"phase": 0.0})
    orange = []
    for _ in range(2):
        shown = env.render()
        assert shown.shape == (480, 480, 3) and shown.dtype == np.uint8
        red, _, blue = shown.astype(int).transpose(2, 0, 1)
        ours, reference = red - blue > 60, blue - red > 20
        assert 0.02 < ours.mean() < 0.2
        assert reference.sum() > 100
        orange.append(np.argwhere(ours).mean(axis=0))
        for _ in range(5):
            env.step(np.zeros(ACTIONS, np.float32))
    np.testing.assert_allclose(orange, 240, atol=60)
    env.close()
    silent = ImitationEnv("walk", engine="pybullet")
    silent.reset()
    assert silent.render() is None
    silent.close()
    with pytest.raises(KinemimicError, match="render_mode: expected rgb_array or none, found 'human'"):
        ImitationEnv("walk", render_mode="human")


def test_wrong_arguments_are_refused_by_name() -> None:
    env = ImitationEnv("walk", engine="pybullet")
    with pytest.raises(KinemimicError, match="options: expected phase, found 'fase'"):
        env.reset(options={"fase": 0.5})
    with pytest.raises(KinemimicError, match=r"options: expected a finite phase, .* found nan"):
        env.reset(options={"phase": np.nan})
    env.reset(seed=0)
    with pytest.raises(KinemimicError, match=r"actions: expected finite numbers of shape \(1, 42\)"):
        env.step(np.zeros(41, np.float32))
    with pytest.raises(KinemimicError, match="found them not finite"):
        env.step(np.full(ACTIONS, np.nan, np.float32))
    env.close()


def test_what_is_observed_of_obstacles_is_within_the_space() -> None:
    config = replace(
        EnvConfig(), observed_obstacles=3, domain_randomization=DomainRandomization(obstacles=1.0)
    )
    space, _ = spaces(config)
    env = ImitationEnv("walk", config=config, engine="pybullet")
    observation, _ = env.reset(seed=0)
    assert space.shape == observation.shape == (observation_size(config),)
    seen = np.zeros(space.shape, dtype=bool)
    for _ in range(60):
        assert space.contains(observation)
        seen |= observation != 0.0
        observation, *_ = env.step(np.zeros(ACTIONS, dtype=np.float32))
    assert seen[-32:].any()
    env.close()
