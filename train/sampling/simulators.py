"""Where training simulates: in processes of this machine, or on the nodes of a Ray cluster."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.parallel.cluster import cluster
from kinemimic.train.sampling.pool import OpenPool
from kinemimic.train.sampling.processes import SamplerProcesses


@dataclass(frozen=True)
class Simulators:
    """open_pool: for `Workers`; cores: how many there are; shares_disk: whether samplers find the files of
    this machine."""

    open_pool: OpenPool
    cores: int
    shares_disk: bool

    def count(self, workers: int | None, num_envs: int) -> int:
        """Number of samplers: `workers` (default: one per core), each with at least one environment.

        KinemimicError for more than a cluster has cores: a Ray actor waits for its core forever.
        """
        if not self.shares_disk and (workers or 1) > self.cores:
            raise KinemimicError(
                f"--workers {workers}: expected at most {self.cores}, the cores of the Ray cluster"
            )
        return min(workers or self.cores, num_envs)


@contextmanager
def simulators(ray: str | None, workers: int | None = None) -> Iterator[Simulators]:
    """ray: as the address of `pipeline/parallel/cluster.py`; None for processes of this machine.

    workers: that will be asked for, which Ray has cores for if it is started here.
    """
    if ray is None:
        yield Simulators(SamplerProcesses, local_cores(), shares_disk=True)
        return
    with cluster(ray, workers and max(workers, local_cores())) as cores:
        from kinemimic.train.sampling.actors import SamplerActors  # noqa: PLC0415 (an extra)

        yield Simulators(SamplerActors, cores, shares_disk=False)


def local_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0))
