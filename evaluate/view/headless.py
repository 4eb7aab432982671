"""The rerun viewer without a screen: what it draws of a recording, at any time of it."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TypeVar

from rerun.experimental import ViewerClient

from kinemimic.pipeline.errors import KinemimicError

PATIENCE = 120.0  # s for an answer: a software renderer on a busy machine is slow, above all to start
LEAVING = 10.0  # s for the viewer to end when it is told to
PAUSE = 1.0  # s between two pictures that have to be the same before one is believed

Draw = Callable[[float], bytes]
T = TypeVar("T")


@contextmanager
def drawing(recording: Path, *, timeline: str, size: tuple[int, int], last: float) -> Iterator[Draw]:
    """A function that draws the recording at seconds of its timeline, as PNG of (width, height) pixels.

    last: the latest moment that will be asked for. The viewer fetches an entity's data when a moment first
    shows it, and what is there at the end is all that ever appears.
    Needs a Vulkan driver; a software one will do (Debian: `libvulkan1 mesa-vulkan-drivers`). The viewer that
    draws listens on the loopback interface until the block ends, and sends no usage data.
    """
    with _viewer(size) as (client, process):

        def opened() -> bool:
            client.open(str(recording.resolve()))
            state = client.get_state()
            return bool(state.recordings) and not state.loading

        def picture(seconds: float) -> bytes:
            client.set_time(timeline, duration=seconds, play_state="paused")
            return client.take_screenshot()

        def settled() -> bool:
            before = picture(last)
            time.sleep(PAUSE)
            return picture(last) == before

        _patiently(process, opened)
        # Until the data are there and the viewer's greeting has faded.
        _patiently(process, settled)
        yield lambda seconds: _patiently(process, lambda: picture(seconds))


@contextmanager
def _viewer(size: tuple[int, int]) -> Iterator[tuple[ViewerClient, subprocess.Popen[bytes]]]:
    """A headless viewer. `ViewerClient.spawn` would let it listen on every interface."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    window = f"{size[0]}x{size[1]}"
    options = ["--headless", "--bind", "127.0.0.1", "--port", str(port), "--window-size", window]
    with tempfile.TemporaryDirectory() as home:
        # A home of its own: nobody's settings. CI: the viewer collects no usage data there.
        environment = os.environ | {"XDG_CONFIG_HOME": home, "XDG_DATA_HOME": home, "CI": "true"}
        # Its own process group: the program is a wrapper, which leaves the viewer behind when it is ended.
        process = subprocess.Popen(  # noqa: S603 (our own words)
            [sys.executable, "-m", "rerun_cli", *options], env=environment, start_new_session=True,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        try:
            _patiently(process, lambda: _listens(port))
            yield ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy"), process
        except (ConnectionError, RuntimeError) as error:
            # It listens before it looks for a driver.
            raise _not_drawn(f"it went away ({error})") from None
        finally:
            # Also where the wrapper has ended, and left the viewer behind.
            _end(process)


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a process and its group: what it leaves behind too, and what does not listen."""
    for end in (signal.SIGTERM, signal.SIGKILL):
        with suppress(ProcessLookupError):
            os.killpg(process.pid, end)
        with suppress(subprocess.TimeoutExpired):
            process.wait(LEAVING)


def _listens(port: int) -> bool:
    with socket.socket() as probe:
        probe.settimeout(0.2)
        return probe.connect_ex(("127.0.0.1", port)) == 0


def _patiently(process: subprocess.Popen[bytes], ask: Callable[[], T]) -> T:
    """The first answer that is not empty. A viewer on a busy machine answers later than its client waits."""
    deadline = time.monotonic() + PATIENCE
    while True:
        try:
            if answer := ask():
                return answer
        except TimeoutError:
            pass
        if process.poll() is not None:
            raise _not_drawn(f"it ended with status {process.returncode}")
        if time.monotonic() > deadline:
            raise KinemimicError(
                f"expected rerun's viewer to draw the recording, but it took more than {PATIENCE:.0f} s to "
                "answer; try again when this machine is less busy"
            )
        time.sleep(0.1)


def _not_drawn(found: str) -> KinemimicError:
    return KinemimicError(
        f"expected rerun's viewer to draw the recording, but {found}; it needs a Vulkan driver "
        "(Debian: mesa-vulkan-drivers)"
    )
