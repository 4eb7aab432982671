"""Rollouts on all cores: processes that hold figures, act with a numpy policy and send samples."""

from __future__ import annotations

import multiprocessing
import os
import signal
from dataclasses import dataclass, fields
from multiprocessing.connection import Connection
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from kinemimic.retarget.motion import Motion
from kinemimic.train.bullet import BulletWorld
from kinemimic.train.config import EnvConfig, RewardConfig
from kinemimic.train.env import ImitationBatch
from kinemimic.train.policy import Floats, Policy
from kinemimic.train.reference import Reference


@dataclass(frozen=True)
class Samples:
    """T steps of E figures.

    observations: (T, E, O) raw, before the step; actions: (T, E, A); terms: (T, E, K);
    terminated, truncated: (T, E); final: (T, E, O) raw observation after the step, before a reset;
    lengths: (episodes,) steps of the episodes that ended.
    """

    observations: Floats
    actions: Floats
    terms: Floats
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]
    final: Floats
    lengths: NDArray[np.int64]


class Sampler:
    """Figures of one worker, with a random generator each, so that a figure's fate is its own."""

    def __init__(self, motion: Motion, config: EnvConfig, seeds: list[np.random.SeedSequence]) -> None:
        self._batch = ImitationBatch(BulletWorld(len(seeds)), Reference(motion), config)
        self._randoms = [np.random.default_rng(seed) for seed in seeds]
        self._ages = np.zeros(len(seeds), dtype=np.int64)
        self._restart(np.arange(len(seeds)))

    def _restart(self, indices: NDArray[np.intp]) -> None:
        self._ages[indices] = 0
        self._batch.reset(indices, np.array([self._randoms[index].random() for index in indices]))

    def sample(self, policy: Policy, noise: Floats, reward: RewardConfig, steps: int) -> Samples:
        """Steps with exploration noise of standard deviation `noise` (A,) per action."""
        self._batch.reward = reward
        columns: dict[str, list[NDArray[np.generic]]] = {f.name: [] for f in fields(Samples)}
        lengths: list[int] = []
        observations = self._batch.observe().astype(np.float32)
        for _ in range(steps):
            mean = policy.act(policy.normalize(observations))
            draws = np.stack(
                [random.standard_normal(mean.shape[1], dtype=np.float32) for random in self._randoms]
            )
            actions = mean + noise * draws
            step = self._batch.step(actions)
            self._ages += 1
            final = step.observations.astype(np.float32)
            row = {
                "observations": observations,
                "actions": actions,
                "terms": step.terms.astype(np.float32),
                "terminated": step.terminated,
                "truncated": step.truncated,
                "final": final,
            }
            for name, value in row.items():
                columns[name].append(value)
            ended = np.flatnonzero(step.terminated | step.truncated)
            observations = final
            if len(ended):
                lengths += self._ages[ended].tolist()
                self._restart(ended)
                observations = self._batch.observe().astype(np.float32)
        stacked = {name: np.stack(rows) for name, rows in columns.items() if name != "lengths"}
        return Samples(**stacked, lengths=np.array(lengths, dtype=np.int64))


def _serve(
    connection: Connection, motion: Motion, config: EnvConfig, seeds: list[np.random.SeedSequence]
) -> None:
    # Ctrl-C reaches the whole process group; the parent decides when its workers end.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    sampler = Sampler(motion, config, seeds)
    while True:
        try:
            connection.send(sampler.sample(*connection.recv()))
        except (EOFError, BrokenPipeError):  # the parent is gone
            return


class Workers:
    """`count` processes that share E figures; use as a context."""

    def __init__(self, motion: Motion, config: EnvConfig, environments: int, seed: int, count: int) -> None:
        seeds = np.random.SeedSequence(seed).spawn(environments)
        # A child must not bring up threads of its own for matrix products: there is a process for every core.
        saved = {name: os.environ.get(name) for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")}
        os.environ |= dict.fromkeys(saved, "1")
        context = multiprocessing.get_context("spawn")
        self._connections: list[Connection] = []
        self._processes: list[multiprocessing.process.BaseProcess] = []
        try:
            for k in range(count):
                ours, theirs = context.Pipe()
                process = context.Process(
                    target=_serve, args=(theirs, motion, config, seeds[k::count]), daemon=True
                )
                process.start()
                theirs.close()
                self._connections.append(ours)
                self._processes.append(process)
        finally:
            for name, value in saved.items():
                if value is None:
                    del os.environ[name]
                else:
                    os.environ[name] = value

    def sample(self, policy: Policy, noise: Floats, reward: RewardConfig, steps: int) -> Samples:
        """Samples of all workers, figures side by side."""
        for connection in self._connections:
            connection.send((policy, noise, reward, steps))
        parts: list[Samples] = [connection.recv() for connection in self._connections]
        joined = {
            f.name: np.concatenate(
                [getattr(part, f.name) for part in parts], axis=0 if f.name == "lengths" else 1
            )
            for f in fields(Samples)
        }
        return Samples(**joined)

    def __enter__(self) -> Workers:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for connection in self._connections:
            connection.close()
        for process in self._processes:
            process.join(timeout=5)
            if process.is_alive():
                process.terminate()
