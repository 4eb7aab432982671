"""Tasks for the nodes of a cluster, which can import this module, but no module of tests."""

from __future__ import annotations

import os
import signal
import time


def squared(task: bytes) -> bytes:
    return str(int(task) ** 2).encode() * 1000


def troubled(task: str) -> str:
    """The task, unless its name is a trouble."""
    if task == "crash":
        os.kill(os.getpid(), signal.SIGSEGV)
    if task == "hang":
        time.sleep(60.0)
    if task == "eat":
        return str(len(bytearray(2**33)))
    return task


def slow(seconds: float, task: int) -> tuple[int, int]:
    """The task, and the process of the node that carried it out."""
    time.sleep(seconds)
    return task, int(os.environ["RAY_RAYLET_PID"])
