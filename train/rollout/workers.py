"""Worker processes that share the environments of a training, one per core."""

from __future__ import annotations

import signal
from collections.abc import Callable, Sequence
from dataclasses import fields
from functools import partial
from multiprocessing.connection import Connection
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Floats
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.parallel.worker import Worker, WorkerDiedError
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.config import EnvConfig, RewardConfig
from kinemimic.train.rollout.evaluation import Episode
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.rollout.robustness import ROBUSTNESS_EPISODES
from kinemimic.train.rollout.sampler import EnvSampler, EnvStates, Sampler, Samples
from kinemimic.train.task.timer import summed

# Opens a worker's sampler from its seeds and the engine.
OpenSampler = Callable[[list[np.random.SeedSequence], str], EnvSampler]


def answer(sampler: EnvSampler, request: str, arguments: tuple[Any, ...]) -> Any:
    """A worker's answer: the result of the sampler's method `request`; samples packed and with seconds."""
    found = getattr(sampler, request)(*arguments)
    return (found.packed(), sampler.seconds) if request == "sample" else found


def _serve(
    connection: Connection,
    open_sampler: OpenSampler,
    seeds: list[np.random.SeedSequence],
    engine: str,
) -> None:
    # The parent ends its workers; a signal to the process group must not kill them in mid-round.
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    try:
        sampler = open_sampler(seeds, engine)
    except KinemimicError as error:
        connection.send(error)
        return
    connection.send(None)  # ready
    while True:
        request, arguments = connection.recv()
        try:
            found = answer(sampler, request, arguments)
        except KinemimicError as error:
            found = error
        connection.send(found)


class Workers:
    """`count` processes that share E environments; a context manager.

    seconds: spent in all calls of `sample` so far, by purpose, mean over the workers.
    """

    def __init__(
        self, motion: Motion, config: EnvConfig, num_envs: int, seed: int, count: int, engine: str
    ) -> None:
        self._begin(partial(Sampler, motion, config), num_envs, seed, count, engine)

    def _begin(self, open_sampler: OpenSampler, num_envs: int, seed: int, count: int, engine: str) -> None:
        self.seconds: dict[str, float] = {}
        self._count = count
        seeds = np.random.SeedSequence(seed).spawn(num_envs)
        self._workers = [Worker() for _ in range(count)]
        for k, worker in enumerate(self._workers):
            worker.begin(_serve, open_sampler, seeds[k::count], engine)
        # Starting up is not part of the first samples' time.
        self._answers()

    def _answers(self) -> list[Any]:
        """The next message of every worker; KinemimicError if one sent an error or died."""
        try:
            answers = [worker.receive() for worker in self._workers]
        except WorkerDiedError as death:
            raise death.among(self._count) from None
        for found in answers:
            if isinstance(found, KinemimicError):
                raise found
        return answers

    def _ask(self, request: str, arguments: Sequence[tuple[Any, ...]]) -> list[Any]:
        """Call the method `request` of each worker's sampler with that worker's arguments."""
        for worker, given in zip(self._workers, arguments, strict=True):
            worker.send((request, given))
        return self._answers()

    def env_states(self) -> EnvStates:
        """The state of all environments from which the next round starts."""
        parts = self._ask("env_states", [()] * self._count)
        return {name: _interleaved([part[name] for part in parts]) for name in parts[0]}

    def set_env_states(self, env_states: EnvStates) -> None:
        """Start the next round from these states, which may come from another number of workers."""
        count = self._count
        shares = [{name: array[k::count] for name, array in env_states.items()} for k in range(count)]
        self._ask("set_env_states", [(share,) for share in shares])

    def run_episodes(self, policy: Policy, reward: RewardConfig, phases: Sequence[float]) -> list[Episode]:
        """Evaluation episodes from these phases, in their order."""
        count = self._count
        parts = self._ask("run_episodes", [(policy, reward, phases[k::count]) for k in range(count)])
        return [parts[k % count][k // count] for k in range(len(phases))]

    def robust_returns(self, policy: Policy, reward: RewardConfig) -> list[float]:
        """Robust returns (`robustness.py`) of all ROBUSTNESS_EPISODES draws, in their order."""
        count, numbers = self._count, range(ROBUSTNESS_EPISODES)
        parts = self._ask("robust_returns", [(policy, reward, numbers[k::count]) for k in range(count)])
        return [parts[k % count][k // count] for k in numbers]

    def sample(
        self, policy: Policy, action_std: Floats, reward: RewardConfig, strength: float, steps: int
    ) -> Samples:
        """Samples of all workers, joined along the environments; see `Sampler.sample`."""
        received = self._ask("sample", [(policy, action_std, reward, strength, steps)] * self._count)
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
        for worker in self._workers:
            worker.end(patience=5.0)


def _interleaved(parts: list[NDArray[Any]]) -> NDArray[Any]:
    """Rows (E, ...) of all workers; worker k of n holds rows k, k + n, k + 2n, ..."""
    joined = np.empty((sum(map(len, parts)), *parts[0].shape[1:]), dtype=parts[0].dtype)
    for k, part in enumerate(parts):
        joined[k :: len(parts)] = part
    return joined
