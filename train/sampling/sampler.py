"""Training samples: environments stepped with a numpy policy and exploration noise.

Every round resets the humanoids to the state they are in, so that the engine forgets contacts and warm
starts. A few arrays then hold all that a round depends on, and training resumed from them continues bit for
bit as if it had never been interrupted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Floats
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.env_config import EnvConfig, RewardConfig
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout.evaluation import Episode, Evaluator
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.rollout.robustness import RobustnessEvaluation
from kinemimic.train.sampling.episodes import WORD, begin_episodes
from kinemimic.train.sampling.push_levels import PushLevels
from kinemimic.train.scenario.route import reference_for
from kinemimic.train.sim.engines import open_world
from kinemimic.train.task.env import TASK, ImitationBatch
from kinemimic.train.task.observation import observation_size

# Purposes of a worker's time besides SIMULATION and TASK of `env.py`; inference includes exploration noise.
INFERENCE = "inference"
BOOKKEEPING = "bookkeeping"

# Everything besides the policy on which the next samples of E environments depend: arrays (E, ...) by name.
EnvStates = Mapping[str, NDArray[Any]]
_RANDOM = "random"  # one of them, (E, 6): PCG64's state and increment, two words each, and half a draw


@dataclass(frozen=True)
class Samples:
    """T steps of E environments.

    observations: (T, E, O) raw, before the step; actions: (T, E, A); terms: (T, E, K) of the reward;
    terminated, truncated: (T, E); next_observations: (T, E, O) raw, after the step, before a reset;
    episode_lengths: (episodes,) steps of the episodes that ended; exploded: how many the engine ended.
    """

    observations: Floats
    actions: Floats
    terms: Floats
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]
    next_observations: Floats
    episode_lengths: NDArray[np.int64]
    exploded: int

    def packed(self) -> Samples:
        """Without the rows of next_observations, then (M, O), that the next step's observation repeats."""
        return replace(self, next_observations=self.next_observations[self._last()])

    def unpacked(self) -> Samples:
        """The inverse of `packed`."""
        next_observations = np.empty_like(self.observations)
        next_observations[:-1] = self.observations[1:]
        next_observations[self._last()] = self.next_observations
        return replace(self, next_observations=next_observations)

    def _last(self) -> NDArray[np.bool_]:
        """(T, E) whether no step of the same episode follows."""
        last = self.terminated | self.truncated
        last[-1] = True
        return last


class EnvSampler:
    """Environments of one worker, each with its own random generator, so that none depends on the others.

    `begin_round` and `end_round` enclose a round. In between `sample` steps the environments, or the caller
    does with `batch` and `restart` (`baselines/env.py`).
    """

    def __init__(
        self,
        reference: Reference,
        config: EnvConfig,
        seeds: list[np.random.SeedSequence],
        engine: str,
        threads: int = 1,
    ) -> None:
        self._config, self._engine = config, engine
        self.batch = ImitationBatch(open_world(len(seeds), engine, threads=threads), reference, config)
        self._randoms = [np.random.Generator(np.random.PCG64(seed)) for seed in seeds]
        self._push_levels = PushLevels(len(seeds)) if config.domain_randomization.adaptive_push else None
        self.restart(np.arange(len(seeds)), 0.0)
        self._next = self.batch.snapshot()

    @property
    def seconds(self) -> dict[str, float]:
        """Seconds of the last `sample`, by purpose."""
        return self.batch.timer.seconds

    def env_states(self) -> EnvStates:
        """The state from which the next round starts."""
        levels = {} if self._push_levels is None else self._push_levels.snapshot()
        randoms = np.array([_generator_state(random) for random in self._randoms])
        return {**self._next, **levels, _RANDOM: randoms}

    def set_env_states(self, env_states: EnvStates) -> None:
        """Start the next round from the `env_states` of a sampler with as many environments."""
        self._next = {name: array for name, array in env_states.items() if name != _RANDOM}
        for random, words in zip(self._randoms, env_states[_RANDOM].tolist(), strict=True):
            _set_generator_state(random, words)
        if self._push_levels is not None:
            self._push_levels.restore(env_states)

    def begin_round(self, reward: RewardConfig) -> None:
        """Reset the humanoids to the state they are in; this reward applies from now on."""
        self.batch.reward = reward
        self.batch.restore(self._next)

    def end_round(self) -> None:
        """Store the state from which the next round starts."""
        self._next = self.batch.snapshot()

    def restart(self, indices: NDArray[np.intp], strength: float) -> None:
        """Begin new episodes; strength: 0 to 1, of the domain randomization."""
        randoms = [self._randoms[index] for index in indices]
        begin_episodes(self.batch, indices, randoms, strength, push_levels=self._push_levels)

    def _exploration(self, action_std: Floats, steps: int) -> Floats:
        """Noise (T, E, A) of standard deviations (A,), drawn from each environment's own generator."""
        draws = np.empty((steps, len(self._randoms), len(action_std)), dtype=np.float32)
        for k, random in enumerate(self._randoms):
            draws[:, k] = random.standard_normal((steps, len(action_std)), dtype=np.float32)
        draws *= action_std
        return draws

    def sample(
        self, policy: Policy, action_std: Floats, reward: RewardConfig, strength: float, steps: int
    ) -> Samples:
        """Samples of `steps` steps.

        action_std: (A,) standard deviation of the exploration noise; strength: 0 to 1, of the domain
        randomization in episodes that begin in this round.
        """
        batch, size, width = self.batch, len(self._randoms), observation_size(self._config)
        batch.timer.restart()
        self.begin_round(reward)
        # One more row: the observation after the last step.
        observations = np.empty((steps + 1, size, width), dtype=np.float32)
        next_observations = np.empty((steps, size, width), dtype=np.float32)
        terms = np.empty((steps, size, len(reward.weights)), dtype=np.float32)
        terminated, truncated = np.empty((2, steps, size), dtype=np.bool_)
        episode_lengths: list[int] = []
        exploded = 0
        actions = self._exploration(action_std, steps)
        batch.timer.lap(INFERENCE)
        observations[0] = batch.observe()
        batch.timer.lap(TASK)
        for t in range(steps):
            actions[t] += policy.act(observations[t])
            batch.timer.lap(INFERENCE)
            step = batch.step(actions[t])
            batch.timer.lap(TASK)
            next_observations[t] = observations[t + 1] = step.observations
            terms[t], terminated[t], truncated[t] = step.terms, step.terminated, step.truncated
            if self._push_levels is not None:
                self._push_levels.update(batch.ages, step.terminated)
            ended = np.flatnonzero(step.terminated | step.truncated)
            batch.timer.lap(BOOKKEEPING)
            if len(ended):
                episode_lengths += batch.ages[ended].tolist()
                exploded += int(step.exploded.sum())
                self.restart(ended, strength)
                observations[t + 1, ended] = batch.observe()[ended]
                batch.timer.lap(TASK)
        self.end_round()
        batch.timer.lap(TASK)
        return Samples(
            observations=observations[:-1],
            actions=actions,
            terms=terms,
            terminated=terminated,
            truncated=truncated,
            next_observations=next_observations,
            episode_lengths=np.array(episode_lengths, dtype=np.int64),
            exploded=exploded,
        )


class Sampler(EnvSampler):
    """Environments that imitate one motion, and its evaluations."""

    def __init__(
        self,
        motion: Motion,
        config: EnvConfig,
        seeds: list[np.random.SeedSequence],
        engine: str,
        threads: int = 1,
    ) -> None:
        super().__init__(reference_for(motion, config.scenario), config, seeds, engine, threads)
        self._motion = motion
        self._evaluator: Evaluator | None = None
        self._robustness: RobustnessEvaluation | None = None

    def run_episodes(self, policy: Policy, reward: RewardConfig, phases: Sequence[float]) -> list[Episode]:
        """Evaluation episodes from these phases, in an environment apart from those of the training."""
        if self._evaluator is None:
            self._evaluator = Evaluator(self._motion, self.batch.reference, self._config, self._engine)
        return [self._evaluator.run_episode(policy, reward, phase) for phase in phases]

    def robust_returns(self, policy: Policy, reward: RewardConfig, numbers: Sequence[int]) -> list[float]:
        """Robust returns (`robustness.py`) of the random draws with these numbers, in separate environments.

        They are kept for the next call, which usually asks for the same numbers.
        """
        if not numbers:
            return []
        if self._robustness is None or self._robustness.numbers != tuple(numbers):
            self._robustness = RobustnessEvaluation(self.batch.reference, self._config, numbers, self._engine)
        return self._robustness.robust_returns(policy, reward)


def _generator_state(random: np.random.Generator) -> NDArray[np.uint64]:
    """The complete state (6,) of a generator on PCG64."""
    state = random.bit_generator.state
    number, step = state["state"]["state"], state["state"]["inc"]
    words = [number >> 64, number & WORD, step >> 64, step & WORD, state["has_uint32"], state["uinteger"]]
    return np.array(words, dtype=np.uint64)


def _set_generator_state(random: np.random.Generator, words: list[int]) -> None:
    """The inverse of `_generator_state`."""
    random.bit_generator.state = {
        "bit_generator": "PCG64",
        "state": {"state": words[0] << 64 | words[1], "inc": words[2] << 64 | words[3]},
        "has_uint32": words[4],
        "uinteger": words[5],
    }
