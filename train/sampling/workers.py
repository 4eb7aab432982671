"""The environments of a training run, divided among several samplers: processes, or actors of a cluster."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from functools import partial
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Floats
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.env_config import EnvConfig, RewardConfig
from kinemimic.train.rollout.evaluation import Episode
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.rollout.robustness import ROBUSTNESS_EPISODES
from kinemimic.train.sampling.pool import SAMPLE, OpenPool, OpenSampler
from kinemimic.train.sampling.processes import SamplerProcesses
from kinemimic.train.sampling.sampler import EnvStates, Sampler, Samples
from kinemimic.train.task.timer import summed


class Workers:
    """`count` samplers that share E environments; a context manager.

    open_pool: where they run. The samples depend on the seed and `count`, not on where they run.
    seconds: spent in all calls of `sample` so far, by purpose, mean over the samplers.
    """

    def __init__(
        self,
        motion: Motion,
        config: EnvConfig,
        num_envs: int,
        seed: int,
        count: int,
        engine: str,
        open_pool: OpenPool = SamplerProcesses,
    ) -> None:
        self._begin(partial(Sampler, motion, config), num_envs, seed, count, engine, open_pool)

    def _begin(
        self,
        open_sampler: OpenSampler,
        num_envs: int,
        seed: int,
        count: int,
        engine: str,
        open_pool: OpenPool,
    ) -> None:
        self.seconds: dict[str, float] = {}
        self._count = count
        seeds = np.random.SeedSequence(seed).spawn(num_envs)
        self._pool = open_pool(open_sampler, [seeds[k::count] for k in range(count)], engine)

    def _ask(
        self,
        request: str,
        shared: tuple[Any, ...] = (),
        shares: Sequence[tuple[Any, ...]] | None = None,
    ) -> list[Any]:
        """Call the method `request` of each sampler, with the arguments of all and its own ones."""
        return self._pool.ask(request, shared, [()] * self._count if shares is None else shares)

    def env_states(self) -> EnvStates:
        """The state of all environments from which the next round starts."""
        parts = self._ask("env_states")
        return {name: _interleaved([part[name] for part in parts]) for name in parts[0]}

    def set_env_states(self, env_states: EnvStates) -> None:
        """Start the next round from these states, which may come from another number of workers."""
        count = self._count
        shares = [{name: array[k::count] for name, array in env_states.items()} for k in range(count)]
        self._ask("set_env_states", shares=[(share,) for share in shares])

    def run_episodes(self, policy: Policy, reward: RewardConfig, phases: Sequence[float]) -> list[Episode]:
        """Evaluation episodes from these phases, in their order."""
        count = self._count
        parts = self._ask("run_episodes", (policy, reward), [(phases[k::count],) for k in range(count)])
        return [parts[k % count][k // count] for k in range(len(phases))]

    def robust_returns(self, policy: Policy, reward: RewardConfig) -> list[float]:
        """Robust returns (`robustness.py`) of all ROBUSTNESS_EPISODES draws, in their order."""
        count, numbers = self._count, range(ROBUSTNESS_EPISODES)
        parts = self._ask("robust_returns", (policy, reward), [(numbers[k::count],) for k in range(count)])
        return [parts[k % count][k // count] for k in numbers]

    def sample(
        self, policy: Policy, action_std: Floats, reward: RewardConfig, strength: float, steps: int
    ) -> Samples:
        """Samples of all samplers, joined along the environments; see `Sampler.sample`."""
        received = self._ask(SAMPLE, (policy, action_std, reward, strength, steps))
        parts = [samples.unpacked() for samples, _ in received]
        shares = ({name: spent / len(parts) for name, spent in seconds.items()} for _, seconds in received)
        self.seconds = summed(self.seconds, *shares)
        joined: dict[str, Any] = {
            f.name: np.concatenate([getattr(part, f.name) for part in parts], axis=1)
            for f in fields(Samples)
            if f.name not in ("episode_lengths", "exploded")
        }
        lengths = np.concatenate([part.episode_lengths for part in parts])
        return Samples(**joined, episode_lengths=lengths, exploded=sum(part.exploded for part in parts))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._pool.end()


def _interleaved(parts: list[NDArray[Any]]) -> NDArray[Any]:
    """Rows (E, ...) of all samplers; sampler k of n holds rows k, k + n, k + 2n, ..."""
    joined = np.empty((sum(map(len, parts)), *parts[0].shape[1:]), dtype=parts[0].dtype)
    for k, part in enumerate(parts):
        joined[k :: len(parts)] = part
    return joined
