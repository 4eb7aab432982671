"""The samplers of a training run in worker processes of this machine, one per core."""

from __future__ import annotations

import signal
from collections.abc import Sequence
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.parallel.worker import Worker, WorkerDiedError
from kinemimic.train.sampling.pool import OpenSampler, answer


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


class SamplerProcesses:
    """`SamplerPool` of one process for each list of seeds."""

    def __init__(
        self, open_sampler: OpenSampler, seeds: Sequence[list[np.random.SeedSequence]], engine: str
    ) -> None:
        self._workers = [Worker() for _ in seeds]
        for worker, own in zip(self._workers, seeds, strict=True):
            worker.begin(_serve, open_sampler, own, engine)
        # Starting up is not part of the first samples' time.
        self._answers()

    def ask(self, request: str, shared: tuple[Any, ...], shares: Sequence[tuple[Any, ...]]) -> list[Any]:
        """As `SamplerPool.ask`; a process that died is an error."""
        for worker, share in zip(self._workers, shares, strict=True):
            worker.send((request, (*shared, *share)))
        return self._answers()

    def _answers(self) -> list[Any]:
        """The next message of every worker; KinemimicError if one sent an error or died."""
        try:
            answers = [worker.receive() for worker in self._workers]
        except WorkerDiedError as death:
            raise death.among(len(self._workers)) from None
        for found in answers:
            if isinstance(found, KinemimicError):
                raise found
        return answers

    def end(self) -> None:
        """End all processes."""
        for worker in self._workers:
            worker.end(patience=5.0)
