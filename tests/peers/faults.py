"""Captures that crash their process, hang, need too much memory, or fill the disk; by their names."""

from __future__ import annotations

import os
import resource
import signal
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

from kinemimic.pipeline.parallel.executor import LocalProcesses

_FULL = 4_000  # bytes that fit into a file


def faulty(work: Callable[[Any], Any], task: Any) -> Any:
    """`work`, unless the name of the task's capture begins with a fault."""
    fault = task.capture.name.partition("_")[0]
    if fault == "crash":
        os.kill(os.getpid(), signal.SIGSEGV)
    if fault == "hang":
        time.sleep(600.0)
    if fault == "memory":
        bytearray(10 << 30)
    _, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    if fault == "disk":
        resource.setrlimit(resource.RLIMIT_FSIZE, (_FULL, hard))
    try:
        return work(task)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (hard, hard))


@dataclass(frozen=True)
class FaultyProcesses:
    """One process of this machine, in which captures fail by their names."""

    timeout: float = 300.0
    shares_disk: bool = True

    def map(self, work: Callable[[Any], Any], tasks: Iterable[Any]) -> Iterator[tuple[int, Any]]:
        return LocalProcesses(1, self.timeout).map(partial(faulty, work), tasks)
