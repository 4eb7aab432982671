"""What processes of ours are born with."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def inherited() -> Iterator[None]:
    """What is set in here is what a child starts with, and what is put back behind it.

    No threads for matrix products: there is a process for every core. And Ctrl-C, which reaches the whole
    process group, is the parent's to handle from the child's first import on.
    """
    saved = {name: os.environ.get(name) for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")}
    os.environ |= dict.fromkeys(saved, "1")
    in_main = threading.current_thread() is threading.main_thread()  # no other thread may set a handler
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN) if in_main else None
    try:
        yield
    finally:
        if handler is not None:
            signal.signal(signal.SIGINT, handler)
        for name in saved:
            del os.environ[name]
        os.environ |= {name: value for name, value in saved.items() if value is not None}
