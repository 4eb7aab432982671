"""A worker process: its environment, its answers, and how it ends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import pytest
from peers.chores import add, hold
from peers.killing import vanishes

from kinemimic.pipeline.parallel.worker import Worker, WorkerDiedError, worker_environment


def test_a_worker_ignores_ctrl_c_and_a_closed_terminal_and_has_one_thread() -> None:
    ask = (
        "import os, signal; print(*(signal.getsignal(n).name for n in (signal.SIGINT, signal.SIGHUP)), "
        "os.environ['OMP_NUM_THREADS'])"
    )
    handler, threads = signal.getsignal(signal.SIGINT), os.environ.get("OMP_NUM_THREADS")
    with worker_environment():
        said = subprocess.run([sys.executable, "-c", ask], capture_output=True, text=True, check=True)
    assert said.stdout.split() == ["SIG_IGN", "SIG_IGN", "1"]
    assert signal.getsignal(signal.SIGINT) is handler
    assert os.environ.get("OMP_NUM_THREADS") == threads


def test_a_worker_answers_until_it_dies() -> None:
    worker = Worker()
    worker.begin(add, 40)
    for number in (1, 2):
        worker.send(number)
        assert worker.receive() == number + 40
    worker.send(-7)
    with pytest.raises(WorkerDiedError) as death:
        worker.receive()
    assert death.value.exitcode == 7
    worker.send(1)  # to nobody: no error before the next `receive`
    worker.end()


def test_a_busy_worker_is_killed_at_its_end() -> None:
    worker = Worker()
    worker.begin(hold)
    pid = worker.receive()
    worker.end(patience=0.1)
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)


def test_a_busy_worker_ends_with_its_parent() -> None:
    program = (
        f"import os, sys; sys.path[:0] = {sys.path!r}\n"
        "from peers.chores import hold\n"
        "from kinemimic.pipeline.parallel.worker import Worker\n"
        "worker = Worker(); worker.begin(hold); worker.receive(); os.kill(os.getpid(), 9)\n"
    )
    parent = subprocess.Popen([sys.executable, "-c", program], start_new_session=True)
    assert parent.wait(timeout=60) == -signal.SIGKILL
    assert vanishes(parent.pid)
