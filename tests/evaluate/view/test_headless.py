"""The headless viewer's end: nothing of it is left, whether it listens or not."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import pytest

from kinemimic.evaluate.view import headless

# A wrapper that goes when it is told to, and what it leaves behind, which does not.
DEAF = "import signal as s, time; s.signal(s.SIGTERM, s.SIG_IGN); print(1, flush=True); time.sleep(60)"
WRAPPER = f"""
import subprocess, sys, time
child = subprocess.Popen([sys.executable, "-c", {DEAF!r}], stdout=subprocess.PIPE)
child.stdout.readline()
print(child.pid, flush=True)
time.sleep(60)
"""


def alive(number: int) -> bool:
    """Whether a process runs; one that nobody has reaped yet does not."""
    try:
        stat = Path(f"/proc/{number}/stat").read_text(encoding="utf-8")
    except FileNotFoundError:
        return False
    return stat.rpartition(")")[2].split()[0] != "Z"


def test_what_does_not_listen_is_ended_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(headless, "LEAVING", 2.0)
    with subprocess.Popen(
        [sys.executable, "-c", WRAPPER], stdout=subprocess.PIPE, start_new_session=True
    ) as process:
        assert process.stdout is not None
        left = int(process.stdout.readline())
        assert alive(left)
        headless._end(process)
        assert process.returncode is not None
        for _ in range(100):
            if not alive(left):
                break
            time.sleep(0.05)
        assert not alive(left)
