"""The headless viewer: it waits until a recording is drawn, and leaves no process behind."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from kinemimic.evaluate.view import headless
from kinemimic.pipeline.errors import KinemimicError

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


def test_processes_that_ignore_sigterm_are_killed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(headless, "SHUTDOWN_TIMEOUT", 2.0)
    with subprocess.Popen(
        [sys.executable, "-c", WRAPPER], stdout=subprocess.PIPE, start_new_session=True
    ) as process:
        assert process.stdout is not None
        left = int(process.stdout.readline())
        assert alive(left)
        headless._terminate(process)
        assert process.returncode is not None
        for _ in range(100):
            if not alive(left):
                break
            time.sleep(0.05)
        assert not alive(left)


class Running:
    """A process that has not ended, or has with a status."""

    def __init__(self, status: int | None = None) -> None:
        self.returncode = status

    def poll(self) -> int | None:
        return self.returncode


class Client:
    """A viewer that loads for two questions, answers late once, and fades its welcome over three pictures."""

    def __init__(self) -> None:
        self.questions = self.pictures = 0
        self.opened: list[str] = []
        self.times: list[float] = []

    def open(self, path: str) -> None:
        self.opened.append(path)

    def get_state(self) -> SimpleNamespace:
        self.questions += 1
        if self.questions == 1:
            raise TimeoutError
        return SimpleNamespace(recordings=["one"], loading=self.questions == 2)

    def set_time(self, timeline: str, *, duration: float, play_state: str) -> None:
        assert (timeline, play_state) == ("time", "paused")
        self.times.append(duration)

    def take_screenshot(self) -> bytes:
        self.pictures += 1
        return f"{self.times[-1]} {max(0, 3 - self.pictures)}".encode()


def viewer(monkeypatch: pytest.MonkeyPatch, client: Client, process: Running) -> None:
    @contextmanager
    def started(size: tuple[int, int]) -> Iterator[Any]:
        assert size == (640, 480)
        yield client, process

    monkeypatch.setattr(headless, "_viewer", started)
    monkeypatch.setattr(headless, "SETTLING", 0.0)


def test_screenshots_wait_for_loading_and_rendering(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    client = Client()
    viewer(monkeypatch, client, Running())
    recording = tmp_path / "view.rrd"
    with headless.headless_viewer(recording, timeline="time", size=(640, 480), latest=9.0) as draw:
        assert client.opened == [str(recording)] * 3
        # Drawn at the end of the timeline until two pictures in sequence are the same.
        assert client.times == [9.0] * 4
        assert draw(2.5) == b"2.5 0"
        assert draw(4.0) == b"4.0 0"


@pytest.mark.parametrize(
    ("status", "found"),
    [(3, "found that it exited with status 3; it needs a Vulkan driver"), (None, "no answer in 0 s")],
)
def test_a_viewer_that_exits_or_hangs_is_a_one_line_error(
    monkeypatch: pytest.MonkeyPatch, status: int | None, found: str
) -> None:
    client = Client()
    monkeypatch.setattr(client, "get_state", lambda: SimpleNamespace(recordings=[], loading=True))
    monkeypatch.setattr(headless, "TIMEOUT", 0.0)
    viewer(monkeypatch, client, Running(status))
    with (
        pytest.raises(KinemimicError, match=found),
        headless.headless_viewer(Path("a.rrd"), timeline="time", size=(640, 480), latest=1.0),
    ):
        pass
