"""What worker processes run in tests: a module that they can import."""

from __future__ import annotations

import os
import signal
import time
from multiprocessing.connection import Connection
from pathlib import Path

from kinemimic.pipeline.cli.progress import progress
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.parallel.interruption import deferred


def chore(task: str) -> None:
    """`bad` fails, `gone` vanishes, `bug` is a bug; `wait PATH` waits to be asked to end, and saves PATH."""
    kind, _, path = task.partition(" ")
    with progress("chore", 2) as bar:
        bar.advance(1, reward=0.5)
        if kind == "bad":
            raise KinemimicError("expected good, found bad")
        if kind == "gone":
            os._exit(7)
        if kind == "wait":
            with deferred() as interruption:
                Path(path).with_suffix(".begun").touch()
                while not interruption.asked:
                    time.sleep(0.01)
                Path(path).touch()
                raise KeyboardInterrupt
        bar.advance(1)


def add(pipe: Connection, offset: int) -> None:
    """Answer each number with its sum with the offset; exit with status n at -n."""
    while True:
        number = pipe.recv()
        if number < 0:
            os._exit(-number)
        pipe.send(number + offset)


def hold(pipe: Connection) -> None:
    """Answer with the process' id, and never end."""
    pipe.send(os.getpid())
    while True:
        signal.pause()
