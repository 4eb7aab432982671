"""What the workers send: whole, in few bytes, and each figure for itself."""

from __future__ import annotations

import multiprocessing
import os
import signal
from dataclasses import fields, replace

import numpy as np
import pytest
from peers.constant import constant

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.env_config import DomainRandomization, EnvConfig
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.sampling import sampler as sampling
from kinemimic.train.sampling.sampler import Sampler, Samples
from kinemimic.train.sampling.workers import Workers
from kinemimic.train.task.env import ACTIONS

NOISE = np.full(ACTIONS, 0.3, dtype=np.float32)
SHORT = replace(EnvConfig(), episode=5)


def idle() -> Policy:
    """Never corrects anything, however many figures it acts for."""
    return constant()


def sample(motion: Motion, seeds: list[np.random.SeedSequence], steps: int = 12) -> Samples:
    sampler = Sampler(motion, SHORT, seeds, "pybullet")
    return sampler.sample(idle(), NOISE, SHORT.reward, 0.0, steps)


@pytest.fixture(scope="module")
def seeds() -> list[np.random.SeedSequence]:
    return np.random.SeedSequence(4).spawn(3)


@pytest.fixture(scope="module")
def samples(motion: Motion, seeds: list[np.random.SeedSequence]) -> Samples:
    return sample(motion, seeds)


def test_an_episode_goes_on_from_where_the_last_step_led(samples: Samples) -> None:
    ended = (samples.terminated | samples.truncated)[:-1]
    goes_on = (samples.observations[1:] == samples.next_observations[:-1]).all(axis=-1)
    np.testing.assert_array_equal(goes_on, ~ended)
    assert ended.any()
    assert len(samples.episode_lengths) == (samples.terminated | samples.truncated).sum()
    assert samples.episode_lengths.max() <= SHORT.episode


def test_what_is_packed_is_unpacked(samples: Samples) -> None:
    packed = samples.packed()
    assert packed.next_observations.size < 0.5 * samples.next_observations.size
    for f in fields(Samples):
        np.testing.assert_array_equal(getattr(packed.unpacked(), f.name), getattr(samples, f.name))


def test_a_figure_does_not_know_how_many_others_there_are(
    motion: Motion, seeds: list[np.random.SeedSequence], samples: Samples
) -> None:
    alone = sample(motion, seeds[1:2])
    for f in fields(Samples):
        if f.name not in ("episode_lengths", "exploded"):
            np.testing.assert_array_equal(getattr(alone, f.name)[:, 0], getattr(samples, f.name)[:, 1])


def test_what_begins_with_the_same_figures_goes_the_same_way(engine: str, motion: Motion) -> None:
    """Also where hardships were drawn and contacts lent their forces, which the engine forgets."""
    hard = replace(
        SHORT,
        domain_randomization=DomainRandomization(
            push=(10.0, 90.0), rest=(0.05, 0.1), delay=(0.0, 0.02), tilt=0.1
        ),
    )
    here, there = (Sampler(motion, hard, np.random.SeedSequence(k).spawn(3), engine) for k in (1, 2))
    here.sample(idle(), NOISE, hard.reward, 1.0, 8)
    env_states = here.env_states()
    there.sample(idle(), NOISE, hard.reward, 0.5, 5)
    there.set_env_states(env_states)
    ours, theirs = (sampler.sample(idle(), NOISE, hard.reward, 1.0, 9) for sampler in (here, there))
    for f in fields(Samples):
        np.testing.assert_array_equal(getattr(ours, f.name), getattr(theirs, f.name))
    ours, theirs = here.env_states(), there.env_states()
    for name in ours:
        np.testing.assert_array_equal(ours[name], theirs[name])


def test_a_generator_comes_back_in_the_midst_of_a_draw() -> None:
    one, other = (np.random.Generator(np.random.PCG64(seed)) for seed in (1, 2))
    one.integers(10, dtype=np.uint32)  # keeps the other half of 64 bits
    sampling._set_generator_state(other, sampling._generator_state(one).tolist())
    assert one.bit_generator.state == other.bit_generator.state
    assert one.random(3).tolist() == other.random(3).tolist()


def test_exploded_figures_are_counted_once_and_start_again(
    motion: Motion, seeds: list[np.random.SeedSequence], puppets, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Exploding(puppets):
        steps = 0

        def step(self, *arguments):
            self.steps += 1
            self.lost[1] = self.steps in (2, 3)
            return super().step(*arguments)

    monkeypatch.setattr(sampling, "open_world", lambda size, engine, threads: Exploding(size))
    # Puppets are nowhere near their reference: nothing but an explosion ends an episode.
    blind = replace(EnvConfig(), max_height_error=1e9, max_rotation_error=1e9, max_drift=1e9)
    found = Sampler(motion, blind, seeds, "puppets").sample(idle(), NOISE, blind.reward, 0.0, 6)
    assert found.exploded == 2
    np.testing.assert_array_equal(np.argwhere(found.terminated), [[1, 1], [2, 1]])
    assert found.episode_lengths.tolist() == [2, 1]
    assert (found.terms[found.terminated] == 0.0).all()


def test_the_time_of_a_sample_is_put_down_to_its_parts(
    motion: Motion, seeds: list[np.random.SeedSequence]
) -> None:
    sampler = Sampler(motion, SHORT, seeds, "pybullet")
    sampler.sample(idle(), NOISE, SHORT.reward, 0.0, 2)
    assert set(sampler.seconds) == {
        "simulation",
        "observation and reward",
        "inference",
        "bookkeeping",
    }
    assert min(sampler.seconds.values()) > 0.0


def test_a_worker_that_is_killed_is_one_line(motion: Motion) -> None:
    policy = idle()
    with Workers(motion, SHORT, 2, 0, 2, "pybullet") as workers:
        assert workers.sample(policy, NOISE, SHORT.reward, 0.0, 2).actions.shape == (2, 2, ACTIONS)
        victim = multiprocessing.active_children()[0]
        os.kill(victim.pid or 0, signal.SIGKILL)
        victim.join()
        with pytest.raises(KinemimicError, match=r"2 worker processes, .* one ended, status -9"):
            workers.sample(policy, NOISE, SHORT.reward, 0.0, 2)


def test_robust_returns_are_those_of_the_numbers_asked_for(motion: Motion, engine: str) -> None:
    hard = replace(
        EnvConfig(), episode=20, domain_randomization=DomainRandomization(push=(50.0, 200.0), rest=(0.1, 0.2))
    )

    def returns(sampler: Sampler, *numbers: int) -> list[float]:
        return sampler.robust_returns(idle(), hard.reward, numbers)

    seeds = np.random.SeedSequence(0).spawn(1)
    one = Sampler(motion, hard, seeds, engine)
    fresh = {numbers: returns(Sampler(motion, hard, seeds, engine), *numbers) for numbers in ((0, 1), (2, 3))}
    assert fresh[0, 1] != fresh[2, 3]
    for numbers in ((0, 1), (2, 3), (2, 3), (0, 1)):
        assert returns(one, *numbers) == fresh[numbers]
    assert returns(one) == []
