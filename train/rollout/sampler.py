"""Rollouts: figures that act with a numpy policy, and the samples that come of it.

Every round of samples begins with figures that are put anew into the state that they are in, so that the
engine forgets its contacts and warm starts. All that a round depends on is then in a few arrays, and what is
resumed from them goes on as if it had never been interrupted, to the last bit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Floats
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.config import EnvConfig, RewardConfig
from kinemimic.train.rollout.evaluation import Episode, Evaluator
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.rollout.robustness import RobustnessEvaluation
from kinemimic.train.scenario.route import reference_for
from kinemimic.train.sim.engines import open_world
from kinemimic.train.task.domain_randomization import RandomizationSample, draw
from kinemimic.train.task.env import TASK, ImitationBatch, observation_size

# What a worker does beside the simulation and the task of `env.py`; inference has the exploration's noise.
INFERENCE = "inference"
BOOKKEEPING = "bookkeeping"

# All that the next samples of E figures depend on beside the policy: arrays (E, ...) by name.
Figures = Mapping[str, NDArray[Any]]
_RANDOM = "random"  # among them (E, 6): state of PCG64 and its increment, two words each, and half a draw
_WORD = (1 << 64) - 1


@dataclass(frozen=True)
class Samples:
    """T steps of E figures.

    observations: (T, E, O) raw, before the step; actions: (T, E, A); terms: (T, E, K);
    terminated, truncated: (T, E); final: (T, E, O) raw observation after the step, before a reset;
    lengths: (episodes,) steps of the episodes that ended; exploded: how many of them by an explosion.
    """

    observations: Floats
    actions: Floats
    terms: Floats
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]
    final: Floats
    lengths: NDArray[np.int64]
    exploded: int

    def packed(self) -> Samples:
        """Without the part of `final` (then (M, O)) that the next step's observation repeats."""
        return replace(self, final=self.final[self._last()])

    def unpacked(self) -> Samples:
        """The inverse of `packed`."""
        final = np.empty_like(self.observations)
        final[:-1] = self.observations[1:]
        final[self._last()] = self.final
        return replace(self, final=final)

    def _last(self) -> NDArray[np.bool_]:
        """(T, E) whether no step of the same episode follows."""
        last = self.terminated | self.truncated
        last[-1] = True
        return last


class Sampler:
    """Figures of one worker, with a random generator each, so that a figure's fate is its own.

    `begin` and `end` enclose a round; between them they are stepped by `sample`, or from outside by `batch`
    and `restart` (`rival_env.py`).
    """

    def __init__(
        self,
        motion: Motion,
        config: EnvConfig,
        seeds: list[np.random.SeedSequence],
        engine: str,
        threads: int = 1,
    ) -> None:
        self._motion, self._config, self._engine = motion, config, engine
        self.batch = ImitationBatch(
            open_world(len(seeds), engine, threads=threads), reference_for(motion, config.scenario), config
        )
        self._randoms = [np.random.Generator(np.random.PCG64(seed)) for seed in seeds]
        self._evaluator: Evaluator | None = None
        self._robustness: RobustnessEvaluation | None = None
        self.restart(np.arange(len(seeds)), 0.0)
        self._next = self.batch.snapshot()

    @property
    def seconds(self) -> dict[str, float]:
        """Where the time of the last `sample` went."""
        return self.batch.timer.seconds

    def figures(self) -> Figures:
        """What the next `sample` begins with."""
        return {**self._next, _RANDOM: np.array([_words(random) for random in self._randoms])}

    def place(self, figures: Figures) -> None:
        """Let the next `sample` begin with these figures, of another sampler of as many."""
        self._next = {name: array for name, array in figures.items() if name != _RANDOM}
        for random, words in zip(self._randoms, figures[_RANDOM].tolist(), strict=True):
            _set_words(random, words)

    def begin(self, reward: RewardConfig) -> None:
        """Put the figures anew where they are, under the reward now in force."""
        self.batch.reward = reward
        self.batch.restore(self._next)

    def end(self) -> None:
        """Keep what the next `begin` begins with."""
        self._next = self.batch.snapshot()

    def run_episodes(self, policy: Policy, reward: RewardConfig, phases: Sequence[float]) -> list[Episode]:
        """Performances from these phases, by a figure apart from those that train."""
        if self._evaluator is None:
            self._evaluator = Evaluator(self._motion, self.batch.reference, self._config, self._engine)
        return [self._evaluator.run_episode(policy, reward, phase) for phase in phases]

    def robust_returns(self, policy: Policy, reward: RewardConfig, numbers: Sequence[int]) -> list[float]:
        """Robust returns (`robustness.py`) of the random draws with these numbers, in separate environments.

        They are kept for the next call, which asks for the same numbers as a rule.
        """
        if not numbers:
            return []
        if self._robustness is None or self._robustness.numbers != tuple(numbers):
            self._robustness = RobustnessEvaluation(self.batch.reference, self._config, numbers, self._engine)
        return self._robustness.robust_returns(policy, reward)

    def restart(self, indices: NDArray[np.intp], strength: float) -> None:
        """Begin new episodes under hardships of this strength."""
        config, randoms = self._config, [self._randoms[index] for index in indices]
        phases = np.array([start_phase(config, random) for random in randoms])
        drawn = [draw(config.domain_randomization, strength, random) for random in randoms]
        seeds = None
        if config.scenario is not None:
            seeds = np.array([random.integers(_WORD, dtype=np.uint64) for random in randoms])
        self.batch.reset(indices, phases, RandomizationSample.concatenated(drawn), seeds)

    def _exploration(self, action_std: Floats, steps: int) -> Floats:
        """(T, E, A) noise of standard deviations (A,), each figure's from its own generator."""
        draws = np.empty((steps, len(self._randoms), len(action_std)), dtype=np.float32)
        for k, random in enumerate(self._randoms):
            draws[:, k] = random.standard_normal((steps, len(action_std)), dtype=np.float32)
        draws *= action_std
        return draws

    def sample(
        self, policy: Policy, action_std: Floats, reward: RewardConfig, strength: float, steps: int
    ) -> Samples:
        """Steps with exploration noise of standard deviation `noise` (A,) per action.

        strength: of the hardships of the episodes that begin here, 0 to 1.
        """
        batch, size, width = self.batch, len(self._randoms), observation_size(self._config)
        batch.timer.restart()
        self.begin(reward)
        # One row more: what the last step led to is the first observation of the next call.
        observations = np.empty((steps + 1, size, width), dtype=np.float32)
        final = np.empty((steps, size, width), dtype=np.float32)
        terms = np.empty((steps, size, len(reward.weights)), dtype=np.float32)
        terminated, truncated = np.empty((2, steps, size), dtype=np.bool_)
        lengths: list[int] = []
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
            final[t] = observations[t + 1] = step.observations
            terms[t], terminated[t], truncated[t] = step.terms, step.terminated, step.truncated
            ended = np.flatnonzero(step.terminated | step.truncated)
            batch.timer.lap(BOOKKEEPING)
            if len(ended):
                lengths += batch.ages[ended].tolist()
                exploded += int(step.exploded.sum())
                self.restart(ended, strength)
                observations[t + 1, ended] = batch.observe()[ended]
                batch.timer.lap(TASK)
        self.end()
        batch.timer.lap(TASK)
        return Samples(
            observations=observations[:-1],
            actions=actions,
            terms=terms,
            terminated=terminated,
            truncated=truncated,
            final=final,
            lengths=np.array(lengths, dtype=np.int64),
            exploded=exploded,
        )


def start_phase(config: EnvConfig, random: np.random.Generator) -> float:
    """The phase at which an episode begins."""
    if not config.start_anywhere:
        return 0.0
    return random.random() if config.scenario is None else float(config.scenario.phase.draw(random)[0])


def _words(random: np.random.Generator) -> NDArray[np.uint64]:
    """(6,) the whole state of a generator on PCG64."""
    state = random.bit_generator.state
    number, step = state["state"]["state"], state["state"]["inc"]
    words = [number >> 64, number & _WORD, step >> 64, step & _WORD, state["has_uint32"], state["uinteger"]]
    return np.array(words, dtype=np.uint64)


def _set_words(random: np.random.Generator, words: list[int]) -> None:
    """The inverse of `_words`."""
    random.bit_generator.state = {
        "bit_generator": "PCG64",
        "state": {"state": words[0] << 64 | words[1], "inc": words[2] << 64 | words[3]},
        "has_uint32": words[4],
        "uinteger": words[5],
    }
