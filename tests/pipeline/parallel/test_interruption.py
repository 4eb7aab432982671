"""A terminal that is closed stops work as SIGTERM does: what was under way is finished first."""

from __future__ import annotations

import os
import pty
import signal
import subprocess
import sys
from pathlib import Path

# Prints like a program with a progress bar; writing to a closed terminal fails.
WORK = """
import pathlib, sys, time
from kinemimic.pipeline.parallel.interruption import deferred
with deferred() as interruption:
    print("working", flush=True)
    begin = time.monotonic()
    while not interruption.asked and time.monotonic() - begin < 20.0:
        time.sleep(0.01)
    for _ in range(50):
        print("finishing", file=sys.stderr, flush=True)
        time.sleep(0.01)
    pathlib.Path(sys.argv[1]).write_text(f"saved, asked: {interruption.asked}")
"""


def test_closing_the_terminal_lets_work_finish(tmp_path: Path) -> None:
    child, terminal = pty.fork()  # the child's session has the terminal as its own
    if child == 0:
        os.execv(sys.executable, [sys.executable, "-c", WORK, str(tmp_path / "saved")])
    assert b"working" in os.read(terminal, 1000)
    os.close(terminal)
    assert os.waitpid(child, 0)[1] == 0
    assert (tmp_path / "saved").read_text() == "saved, asked: True"


def test_sigterm_cleans_up() -> None:
    code = """
import time
from kinemimic.pipeline.parallel.interruption import ended_by_sigterm
with ended_by_sigterm():
    try:
        print("ready", flush=True)
        time.sleep(30)
    finally:
        print("clean", flush=True)
"""
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    process.terminate()
    out, _ = process.communicate(timeout=30)
    assert (out, process.returncode) == ("clean\n", 128 + signal.SIGTERM)
