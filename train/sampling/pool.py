"""The interface to the samplers that share the environments of a training run; all are called at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np

from kinemimic.train.sampling.sampler import EnvSampler

# Opens a sampler from its seeds and the engine.
OpenSampler = Callable[[list[np.random.SeedSequence], str], EnvSampler]
SAMPLE = "sample"  # the request whose answer is packed and comes with the seconds that it took


def answer(sampler: EnvSampler, request: str, arguments: tuple[Any, ...]) -> Any:
    """The result of the sampler's method `request`; samples packed and with seconds."""
    found = getattr(sampler, request)(*arguments)
    return (found.packed(), sampler.seconds) if request == SAMPLE else found


class SamplerPool(Protocol):
    """Several samplers, each in a process of its own, on this machine or on another."""

    def ask(self, request: str, shared: tuple[Any, ...], shares: Sequence[tuple[Any, ...]]) -> list[Any]:
        """Call each sampler's method `request` with the arguments `shared` and then its own share.

        The answers (`answer`) are in the order of the samplers. KinemimicError if a sampler raised one, or
        was lost and could not be replaced.
        """
        ...

    def end(self) -> None:
        """End all samplers."""
        ...


# Opens a pool: how to open each sampler, the seeds of each one's environments, and the engine.
OpenPool = Callable[[OpenSampler, Sequence[list[np.random.SeedSequence]], str], SamplerPool]
