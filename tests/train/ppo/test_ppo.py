"""GAE, the penalty rule and the normaliser by hand; the whole update against the plain way to write it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from peers.plain_ppo import PlainPPO

from kinemimic.retarget.humanoid.body import BODIES
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.presets import PRESETS
from kinemimic.train.ppo import networks
from kinemimic.train.ppo.advantages import advantages
from kinemimic.train.ppo.networks import Normalizer
from kinemimic.train.ppo.ppo import PpoAlgorithm, adapt_penalty, adapt_rate
from kinemimic.train.runner.base import normalized_loss
from kinemimic.train.sampling.sampler import Samples
from kinemimic.train.task.env import ACTIONS
from kinemimic.train.task.observation import OBSERVATIONS


def column(*values: float) -> np.ndarray:
    return np.array(values, dtype=np.float64)[:, None]


def test_advantages_by_hand() -> None:
    """γ = 0.5, λ = 0.5, three steps without an end: δ = r + γ v' - v.

    δ0 = 1 + 1 - 1 = 1; δ1 = 2 + 0.5·4 - 2 = 2; δ2 = 3 + 0.5·2 - 4 = 0
    A2 = 0; A1 = 2 + 0.25·0 = 2; A0 = 1 + 0.25·2 = 1.5
    """
    found = advantages(
        column(1, 2, 3), column(1, 2, 4), column(2, 4, 2), column(0, 0, 0).astype(bool), 0.5, 0.5
    )
    np.testing.assert_allclose(found[:, 0], [1.5, 2.0, 0.0])


def test_a_fall_and_a_time_out_differ_by_the_bootstrap() -> None:
    """After step 0 the episode ends. Fall: nothing follows, A0 = 1 - 1 = 0. Time-out with V(s') = 6: A0 = 3.

    Neither lets step 1 (δ1 = 2 + 0.5·0 - 1 = 1) reach back.
    """
    ended = column(1, 0).astype(bool)
    fall = advantages(column(1, 2), column(1, 1), column(0, 0), ended, 0.5, 0.5)
    time_out = advantages(column(1, 2), column(1, 1), column(6, 0), ended, 0.5, 0.5)
    np.testing.assert_allclose(fall[:, 0], [0.0, 1.0])
    np.testing.assert_allclose(time_out[:, 0], [3.0, 1.0])


@pytest.mark.parametrize(
    ("kl", "running", "initial"),
    [(0.0066, 2.0, 0.5), (0.0067, 4.0, 4.0), (0.0149, 4.0, 4.0), (0.0151, 8.0, 2.0)],
)
def test_penalty_rule(kl: float, running: float, initial: float) -> None:
    """η = 0.01, coefficient 4 in force, 1 at the beginning: borders at 0.00667 and 0.015."""
    assert adapt_penalty(4.0, kl, 0.01, 1.0, "running") == running
    assert adapt_penalty(4.0, kl, 0.01, 1.0, "initial") == initial


def test_rate_steers_towards_the_target() -> None:
    assert adapt_rate(3e-4, 0.2, 0.1) == pytest.approx(2e-4)
    assert adapt_rate(3e-4, 0.05, 0.1) == pytest.approx(4.5e-4)
    assert adapt_rate(3e-4, 0.1, 0.1) == 3e-4
    assert adapt_rate(1e-3, 0.0, 0.1) == 1e-3


def test_normalizer_equals_the_statistics_of_everything_seen() -> None:
    random = np.random.default_rng(0)
    batches = [random.normal(3.0, 2.0, (n, 3)) for n in (1, 7, 40)]
    normalizer = Normalizer(3)
    for batch in batches:
        normalizer.update(batch)
    every = np.concatenate(batches)
    np.testing.assert_allclose(normalizer.mean, every.mean(axis=0))
    np.testing.assert_allclose(normalizer.scale, every.std(axis=0))


def followed(steps: int, num_envs: int) -> Samples:
    """Made-up samples in which, as in a rollout, a step begins where the one before it left off."""
    random = np.random.default_rng(0)
    observations = random.normal(size=(steps, num_envs, OBSERVATIONS)).astype(np.float32)
    next_observations = random.normal(size=observations.shape).astype(np.float32)
    terminated = random.random((steps, num_envs)) < 0.1
    truncated = ~terminated & (random.random((steps, num_envs)) < 0.1)
    goes_on = ~(terminated | truncated)[:-1]
    next_observations[:-1][goes_on] = observations[1:][goes_on]
    return Samples(
        observations=observations,
        actions=random.normal(0.0, 0.15, (steps, num_envs, ACTIONS)).astype(np.float32),
        terms=random.random((steps, num_envs, 5)).astype(np.float32),
        terminated=terminated,
        truncated=truncated,
        next_observations=next_observations,
        episode_lengths=np.array([7]),
        exploded=0,
    )


@pytest.mark.parametrize("name", sorted(PRESETS))
def test_an_update_is_that_of_plain_ppo(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two threads, explicit gradients, flat Adam, next values from the next row: the same networks."""
    monkeypatch.setattr(networks, "choose_gradient_dtype", lambda _: torch.float32)
    algorithm = PpoAlgorithm(replace(PRESETS[name], hidden=(24, 16), minibatch=24, epochs=3))
    samples = followed(16, 4)
    algorithm.normalizer.update(samples.observations.reshape(-1, OBSERVATIONS))
    plain = PlainPPO(algorithm)
    before = algorithm.net.actor.parameters.clone(), algorithm.net.critic.parameters.clone()
    algorithm.update(samples)
    plain.update(samples)
    for ours, start, theirs in zip(
        (algorithm.net.actor, algorithm.net.critic), before, (plain.actor, plain.critic), strict=True
    ):
        wanted = torch.cat([p.detach().reshape(-1) for p in theirs.parameters()])
        assert (wanted - start).norm() > 0.01
        assert (ours.parameters - wanted).norm() < 1e-3 * (wanted - start).norm()
    torch.testing.assert_close(algorithm.net.log_std, plain.log_std.detach())


@pytest.mark.parametrize("reward", [np.nan, 1e21])
def test_a_learner_that_is_spoilt_says_so(reward: float) -> None:
    """A reward that is no number spoils both networks, one whose square is infinite the critic alone."""
    algorithm = PpoAlgorithm(replace(PRESETS["default"], hidden=(8, 4), epochs=1))
    samples = followed(8, 4)
    samples.terms[0, 0, 0] = reward
    with pytest.raises(FloatingPointError, match="infinite or NaN"):
        algorithm.update(samples)


def test_same_seed_same_bytes() -> None:
    """Whichever of the two threads is ahead."""
    found = []
    for _ in range(2):
        algorithm = PpoAlgorithm(replace(PRESETS["default"], hidden=(64, 32), minibatch=64, epochs=4))
        for _ in range(3):
            algorithm.update(followed(32, 8))
        found.append({name: value.numpy().tobytes() for name, value in algorithm.tensors().items()})
    assert found[0] == found[1]


def test_ankles_explore_by_their_own_factor_in_every_round() -> None:
    schedule = ((0, 0.08), (1000, 0.02))
    learner = PpoAlgorithm(replace(TrainConfig(), hidden=(8, 8), action_std=schedule, ankle_exploration=4.0))
    feet = np.array([body.name.startswith("foot") for body in BODIES[1:] for _ in range(3)])
    for samples, usual in ((0, 0.08), (0, 0.08), (500, 0.05), (9999, 0.02)):
        learner.progress.samples = samples
        assert learner.action_std() == pytest.approx(np.where(feet, 4.0 * usual, usual), rel=1e-6)


def test_the_critic_learns_what_is_there_to_learn() -> None:
    algorithm = PpoAlgorithm(replace(PRESETS["default"], hidden=(64, 32), minibatch=64, discount=0.0))
    samples = followed(32, 8)
    first = algorithm.update(samples)["value/loss"]
    for _ in range(5):
        last = algorithm.update(samples)["value/loss"]
    assert last < 0.2 * first


def test_the_critics_error_is_told_as_a_share_of_what_its_targets_vary() -> None:
    """At least what their variance leaves unexplained: an error that is everywhere the same counts too."""
    logged = PpoAlgorithm(TrainConfig(hidden=(8, 4), minibatch=6, epochs=2)).update(followed(3, 4))
    assert logged["value/normalized_loss"] >= 1.0 - logged["value/explained_variance"] - 1e-6
    assert normalized_loss(3.0, 2.0) == 1.5
    assert normalized_loss(0.0, 0.0) == 0.0


def test_an_update_adds_its_observations_to_the_normaliser() -> None:
    algorithm = PpoAlgorithm(TrainConfig(hidden=(8, 4), minibatch=24, epochs=1))
    first, second = followed(16, 4), followed(16, 4)
    for samples in (first, second):
        algorithm.update(samples)
    seen = np.concatenate([samples.observations.reshape(-1, OBSERVATIONS) for samples in (first, second)])
    assert algorithm.normalizer.count == len(seen)
    np.testing.assert_allclose(algorithm.normalizer.mean, seen.mean(axis=0, dtype=float), atol=1e-9)


def test_every_update_decays_the_entropy_coefficient() -> None:
    config = TrainConfig(hidden=(8, 4), minibatch=24, epochs=1, entropy=0.01, entropy_decay=0.5)
    algorithm = PpoAlgorithm(config)
    for expected in (0.005, 0.0025):
        algorithm.update(followed(16, 4))
        assert algorithm.progress.entropy == expected


@pytest.mark.parametrize(("size", "norm"), [(3.0, 1.0), (1.5, 1.0), (0.5, 0.5)])
def test_a_gradient_longer_than_one_is_clipped_to_one(
    size: float, norm: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    algorithm = PpoAlgorithm(TrainConfig(hidden=(8, 4)))
    critic = algorithm.net.critic
    direction = torch.randn(len(critic.gradient))
    direction *= size / direction.norm()
    monkeypatch.setattr(critic, "backward", lambda _: critic.gradient.copy_(direction))
    algorithm.critic_step(torch.zeros(4, OBSERVATIONS), torch.zeros(4, 1))
    assert float(critic.gradient.norm()) == pytest.approx(norm, rel=1e-5)
    torch.testing.assert_close(critic.gradient / norm, direction / size, rtol=1e-4, atol=1e-6)
