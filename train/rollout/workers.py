"""Workers: processes that share the figures of a training, one for every core."""

from __future__ import annotations

import signal
from collections.abc import Sequence
from dataclasses import fields
from multiprocessing.connection import Connection
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Floats
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.parallel.worker import Worker, WorkerDiedError
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.config import EnvConfig, RewardConfig
from kinemimic.train.rollout.evaluation import Episode
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.rollout.robustness import FIGURES
from kinemimic.train.rollout.sampler import Figures, Sampler, Samples
from kinemimic.train.task.timer import summed


def answer(sampler: Sampler, request: str, arguments: tuple[Any, ...]) -> Any:
    """What a worker sends back: what the sampler's method `request` returns; samples packed, with seconds."""
    found = getattr(sampler, request)(*arguments)
    return (found.packed(), sampler.seconds) if request == "sample" else found


def _serve(
    connection: Connection,
    motion: Motion,
    config: EnvConfig,
    seeds: list[np.random.SeedSequence],
    engine: str,
) -> None:
    # The parent ends its workers; a signal to the whole group must not take them from it in mid-round.
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    try:
        sampler = Sampler(motion, config, seeds, engine)
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
    """`count` processes that share E figures; use as a context.

    seconds: where the workers' time went in all calls of `sample` so far, mean over the workers.
    """

    def __init__(
        self, motion: Motion, config: EnvConfig, num_envs: int, seed: int, count: int, engine: str
    ) -> None:
        self.seconds: dict[str, float] = {}
        self._count = count
        seeds = np.random.SeedSequence(seed).spawn(num_envs)
        self._workers = [Worker() for _ in range(count)]
        for k, worker in enumerate(self._workers):
            worker.begin(_serve, motion, config, seeds[k::count], engine)
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
        """What each worker's sampler answers to the method `request` with its own arguments."""
        for worker, given in zip(self._workers, arguments, strict=True):
            worker.send((request, given))
        return self._answers()

    def figures(self) -> Figures:
        """What the next `sample` begins with, for all figures."""
        parts = self._ask("figures", [()] * self._count)
        return {name: _dealt_back([part[name] for part in parts]) for name in parts[0]}

    def place(self, figures: Figures) -> None:
        """Let the next `sample` begin with these figures; they may come from another number of workers."""
        count = self._count
        self._ask("place", [({n: array[k::count] for n, array in figures.items()},) for k in range(count)])

    def run_episodes(self, policy: Policy, reward: RewardConfig, phases: Sequence[float]) -> list[Episode]:
        """Performances from these phases, in their order, as many at a time as there are workers."""
        count = self._count
        parts = self._ask("run_episodes", [(policy, reward, phases[k::count]) for k in range(count)])
        return [parts[k % count][k // count] for k in range(len(phases))]

    def robust_returns(self, policy: Policy, reward: RewardConfig) -> list[float]:
        """What each of the figures of `ordeal.py` endures, in the sequence of their numbers."""
        count, numbers = self._count, range(FIGURES)
        parts = self._ask("robust_returns", [(policy, reward, numbers[k::count]) for k in range(count)])
        return [parts[k % count][k // count] for k in numbers]

    def sample(
        self, policy: Policy, action_std: Floats, reward: RewardConfig, strength: float, steps: int
    ) -> Samples:
        """Samples of all workers, figures side by side."""
        received = self._ask("sample", [(policy, action_std, reward, strength, steps)] * self._count)
        parts = [samples.unpacked() for samples, _ in received]
        shares = ({name: spent / len(parts) for name, spent in seconds.items()} for _, seconds in received)
        self.seconds = summed(self.seconds, *shares)
        joined: dict[str, Any] = {
            f.name: np.concatenate([getattr(part, f.name) for part in parts], axis=1)
            for f in fields(Samples)
            if f.name not in ("lengths", "exploded")
        }
        lengths = np.concatenate([part.lengths for part in parts])
        return Samples(**joined, lengths=lengths, exploded=sum(part.exploded for part in parts))

    def __enter__(self) -> Workers:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for worker in self._workers:
            worker.end(patience=5.0)


def _dealt_back(hands: list[NDArray[Any]]) -> NDArray[Any]:
    """(E, ...) of which each worker holds every count-th row, beginning with its own number."""
    together = np.empty((sum(map(len, hands)), *hands[0].shape[1:]), dtype=hands[0].dtype)
    for k, hand in enumerate(hands):
        together[k :: len(hands)] = hand
    return together
