"""Processes side by side: each says how it went, one that fails keeps no other, and Ctrl-C lets them save."""

from __future__ import annotations

import signal
import threading
import time
from pathlib import Path

import pytest
from peers.chores import chore

from kinemimic.evaluate.compare.job_runner import side_by_side
from kinemimic.pipeline.cli.progress_state import ProgressState


class Log:
    def __init__(self) -> None:
        self.ends: dict[str, str | None] = {}
        self.bars: list[tuple[str, str, float]] = []
        self.at_once = self.most = 0

    def begun(self, task: str) -> None:
        self.at_once += 1
        self.most = max(self.most, self.at_once)

    def advanced(self, task: str, state: ProgressState) -> None:
        self.bars.append((task, state.what, state.done))

    def ended(self, task: str, error: str | None) -> None:
        self.at_once -= 1
        self.ends[task] = error


def test_what_fails_is_told_and_keeps_no_other() -> None:
    log = Log()
    side_by_side(chore, ["bad", "gone", "good"], 2, log)
    assert log.ends == {
        "bad": "expected good, found bad",
        "gone": "its process ended, status 7",
        "good": None,
    }
    assert [done for task, _, done in log.bars if task == "good"] == [1.0, 2.0]
    assert log.most == 2


def test_ctrl_c_asks_those_that_run_to_save_and_begins_no_other(tmp_path: Path) -> None:
    earlier = signal.signal(signal.SIGINT, signal.default_int_handler)
    tasks = [f"wait {tmp_path / name}" for name in ("a", "b", "c")]

    def press() -> None:
        end = time.monotonic() + 30.0
        while len(list(tmp_path.glob("*.begun"))) < 2 and time.monotonic() < end:
            time.sleep(0.02)
        signal.raise_signal(signal.SIGINT)

    presser = threading.Thread(target=press)
    presser.start()
    log = Log()
    try:
        with pytest.raises(KeyboardInterrupt):
            side_by_side(chore, tasks, 2, log)
    finally:
        presser.join()
        signal.signal(signal.SIGINT, earlier)
    assert {path.name for path in tmp_path.iterdir()} == {"a", "a.begun", "b", "b.begun"}
    assert log.ends == {}
