"""Tasks for the nodes of a cluster, which can import this module, but no module of tests."""

from __future__ import annotations

import os
import signal
import time

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.parallel.node_identity import NodeIdentity


def claimed() -> NodeIdentity:
    """The driver claims to be another machine; nodes tell the truth."""
    return NodeIdentity.here(None if "RAY_RAYLET_PID" in os.environ else {"numpy": "1.0"})


def incapable() -> NodeIdentity:
    """Nodes lack something."""
    if "RAY_RAYLET_PID" in os.environ:
        raise KinemimicError("expected an engine, found none")
    return NodeIdentity.here()


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
