from __future__ import annotations

import math
import multiprocessing
import os
import signal
import subprocess
import sys

import pytest

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.parallel.process_pool import inherited, spread


def test_a_child_is_born_deaf_to_ctrl_c_and_with_one_thread() -> None:
    ask = "import os, signal; print(signal.getsignal(signal.SIGINT).name, os.environ['OMP_NUM_THREADS'])"
    handler, threads = signal.getsignal(signal.SIGINT), os.environ.get("OMP_NUM_THREADS")
    with inherited():
        said = subprocess.run([sys.executable, "-c", ask], capture_output=True, text=True, check=True)
    assert said.stdout.split() == ["SIG_IGN", "1"]
    assert signal.getsignal(signal.SIGINT) is handler
    assert os.environ.get("OMP_NUM_THREADS") == threads


def test_tasks_are_spread_and_their_results_come_in_order() -> None:
    done: list[int] = []
    assert spread(math.factorial, [6, 1, 4, 3], workers=2, progress=done.append) == [720, 1, 24, 6]
    assert done == [1, 1, 1, 1]
    with pytest.raises(ValueError, match="negative"):
        spread(math.factorial, [2, -1], workers=1)
    assert not multiprocessing.active_children()


def test_a_process_that_is_ended_from_outside_is_one_line() -> None:
    with pytest.raises(KinemimicError, match="expected 1 processes that simulate, found"):
        spread(os._exit, [9], workers=2)
