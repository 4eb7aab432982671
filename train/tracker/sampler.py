"""The environments of one worker of a tracker's training, each on a motion of the library."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.train.config.env_config import EnvConfig, RewardConfig
from kinemimic.train.reference.reference_library import FollowedReference, ReferenceLibrary
from kinemimic.train.rollout.evaluation import Episode
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.sampling.episodes import begin_episodes
from kinemimic.train.sampling.sampler import EnvSampler, EnvStates
from kinemimic.train.tracker.motion_sampling import Outcome
from kinemimic.train.tracker.performance import perform

_MOTIONS, _PACE = "motions", "pace"
_END_PHASE = 1.0  # s before its end at which a single motion starts at the latest


class TrackerSampler(EnvSampler):
    """E environments that each begin an episode with a motion drawn by the current weights.

    tables: a `ReferenceLibrary`, or its folder.
    """

    def __init__(
        self,
        tables: Path | ReferenceLibrary,
        config: EnvConfig,
        seeds: list[np.random.SeedSequence],
        engine: str,
    ) -> None:
        self._library = tables if isinstance(tables, ReferenceLibrary) else ReferenceLibrary.open(tables)
        self._reference = FollowedReference(self._library, np.zeros(len(seeds), dtype=np.intp))
        self._bounds = np.linspace(0.0, 1.0, len(self._library) + 1)[1:]
        self._outcomes: list[Outcome] = []
        super().__init__(self._reference, config, seeds, engine)

    def set_weights(self, weights: Array) -> None:
        """Probabilities (M,) of the motions of the episodes to come."""
        self._bounds = np.cumsum(weights)

    def set_body_error(self, largest: float) -> None:
        """Mean distance of the bodies from their references at which an episode ends, m."""
        self.batch.max_body_error = largest

    def take_outcomes(self) -> list[Outcome]:
        """The episodes that ended since the last call."""
        outcomes, self._outcomes = self._outcomes, []
        return outcomes

    def restart(self, indices: NDArray[np.intp], strength: float) -> None:
        """Begin new episodes; strength: 0 to 1, of the domain randomization."""
        library, reference = self._library, self._reference
        randoms = [self._randoms[index] for index in indices]
        pace = self._config.domain_randomization.pace
        ended = indices[self.batch.ages[indices] > 0]
        failed = self.batch.terminated()[ended]
        steps = self.batch.ages[ended]
        self._outcomes += map(Outcome, reference.motions[ended].tolist(), failed.tolist(), steps.tolist())
        for index, random in zip(indices, randoms, strict=True):
            place = np.searchsorted(self._bounds, random.random() * self._bounds[-1], side="right")
            reference.motions[index] = min(int(place), len(library) - 1)
            reference.pace[index] = 1.0 + strength * (random.uniform(*pace) - 1.0)
        drawn = reference.motions[indices]
        span = np.where(
            library.cyclic[drawn], 1.0, np.maximum(0.0, 1.0 - _END_PHASE / library.durations[drawn])
        )
        phases = span * [random.random() for random in randoms]
        # A gait catches up with a reference beside it; feet that stand cannot.
        begin_episodes(self.batch, indices, randoms, strength, phases, displaced=library.cyclic[drawn])

    def env_states(self) -> EnvStates:
        """The state from which the next round starts."""
        reference = self._reference
        return {**super().env_states(), _MOTIONS: reference.motions.copy(), _PACE: reference.pace.copy()}

    def set_env_states(self, env_states: EnvStates) -> None:
        """Start the next round from the `env_states` of a sampler with as many environments."""
        self._reference.motions[:], self._reference.pace[:] = env_states[_MOTIONS], env_states[_PACE]
        own = (_MOTIONS, _PACE)
        super().set_env_states({name: array for name, array in env_states.items() if name not in own})

    def evaluate(self, policy: Policy, reward: RewardConfig, motions: NDArray[np.intp]) -> list[Episode]:
        """One evaluation episode of each of these motions (N,), in environments apart from the training's."""
        return perform(policy, self._library, motions, self._config, reward, self._engine)
