"""A live capture on the page, in a real browser: a sender over UDP that stops, and comes back."""

from __future__ import annotations

import json
import re
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from peers.browser import CHROMIUM, Watched, chromium, served
from samples.walker import walker

from kinemimic.pipeline.kinematics.clip import Clip

pytest.importorskip("playwright.sync_api")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="needs the browser chromium"),
]
PAGE = 18092  # the first port that is tried
# What the skeletons are drawn in: the newest frame as it came, and the cleaned one.
GREY, BLUE = (150, 150, 150), (40, 110, 220)


class Sender:
    """Sends the frames of a clip over UDP on its own clock, as long as it is on, to a port that was free."""

    def __init__(self, clip: Clip) -> None:
        self._clip, self._stopped = clip, threading.Event()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as tried:
            tried.bind(("127.0.0.1", 0))
            self.port = int(tried.getsockname()[1])
        self.on = threading.Event()
        self._thread = threading.Thread(target=self._send, daemon=True)
        self._thread.start()

    def _send(self) -> None:
        began, step = time.monotonic(), float(np.median(np.diff(self._clip.times)))
        k = 0
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
            while not self._stopped.wait(max(0.0, began + step * k - time.monotonic())):
                if self.on.is_set():
                    positions = self._clip.positions[k % len(self._clip.times)]
                    frame = {"time": step * k, "positions": positions.tolist()}
                    out.sendto(json.dumps(frame).encode(), ("127.0.0.1", self.port))
                k += 1

    def close(self) -> None:
        self._stopped.set()
        self._thread.join()


@pytest.fixture
def sender() -> Iterator[Sender]:
    one = Sender(walker(seconds=40.0, rate=30.0).clip)
    yield one
    one.close()


@pytest.fixture
def browser() -> Iterator[Any]:
    with chromium() as one:
        yield one


def awaited(watched: Watched, color: tuple[int, int, int], least: int, *, drawn: bool) -> bool:
    """Whether a skeleton of this colour is drawn, or gone, within a minute."""
    until = time.monotonic() + 60.0
    while time.monotonic() < until:
        if (watched.pixels(color) >= least) == drawn:
            return True
        time.sleep(0.3)
    return False


def settled(watched: Watched) -> bool:
    """Whether the latency that is shown comes below 0.3 s within a minute: playback may skip at first."""
    until = time.monotonic() + 60.0
    while time.monotonic() < until:
        behind = re.search(r"(\d+) ms behind", watched.tab.inner_text("body"))
        if behind is not None and int(behind[1]) < 300:
            return True
        time.sleep(0.1)
    return False


def test_a_sender_comes_goes_and_comes_back(browser: Any, sender: Sender, tmp_path: Path) -> None:
    arguments = ("--udp", str(sender.port), "--port", str(PAGE), "--run", str(tmp_path / "run"))
    with served("stream", *arguments) as address:
        page = Watched(browser, address)
        page.sees("waiting for frames")
        before = {color: page.pixels(color) for color in (GREY, BLUE)}
        sender.on.set()
        page.sees("following the person")
        page.sees("Kinect v1")
        for color, count in before.items():
            assert awaited(page, color, count + 40, drawn=True), color
        assert settled(page), page.tab.inner_text("body")
        sender.on.clear()
        page.sees("no frames for")
        assert awaited(page, BLUE, before[BLUE] + 1, drawn=False)
        sender.on.set()
        page.sees("following the person")
        page.sees("appeared 2 times")
        assert page.hosts <= {"127.0.0.1"}
        assert page.errors == []
        page.tab.close()
