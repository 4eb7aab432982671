"""The rerun viewer without a screen: renders a recording at any time of its timeline."""

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

TIMEOUT = 120.0  # s for an answer: a software renderer on a busy machine is slow, especially to start
SHUTDOWN_TIMEOUT = 10.0  # s for the viewer to exit after a signal
SETTLING = 1.0  # s between two screenshots that must be equal before rendering counts as complete

Draw = Callable[[float], bytes]
T = TypeVar("T")


@contextmanager
def headless_viewer(
    recording: Path, *, timeline: str, size: tuple[int, int], latest: float
) -> Iterator[Draw]:
    """A function that renders the recording at a time in seconds, as PNG of (width, height) pixels.

    latest: the latest time that will be requested. The viewer loads an entity's data when it first becomes
    visible, and all entities are visible at the end.
    Needs a Vulkan driver, for example a software one (Debian: `libvulkan1 mesa-vulkan-drivers`). The viewer
    listens on the loopback interface until the block ends, and sends no usage data.
    """
    with _viewer(size) as (client, process):

        def is_open() -> bool:
            client.open(str(recording.resolve()))
            state = client.get_state()
            return bool(state.recordings) and not state.loading

        def screenshot_at(seconds: float) -> bytes:
            client.set_time(timeline, duration=seconds, play_state="paused")
            return client.take_screenshot()

        def is_settled() -> bool:
            before = screenshot_at(latest)
            time.sleep(SETTLING)
            return screenshot_at(latest) == before

        _wait_for(process, is_open)
        # Until the data are loaded and the viewer's welcome message has faded.
        _wait_for(process, is_settled)
        yield lambda seconds: _wait_for(process, lambda: screenshot_at(seconds))


@contextmanager
def _viewer(size: tuple[int, int]) -> Iterator[tuple[ViewerClient, subprocess.Popen[bytes]]]:
    """A headless viewer; one from `ViewerClient.spawn` would listen on every interface."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    window = f"{size[0]}x{size[1]}"
    options = ["--headless", "--bind", "127.0.0.1", "--port", str(port), "--window-size", window]
    with tempfile.TemporaryDirectory() as home:
        # A temporary home, without user settings. CI: the viewer then collects no usage data.
        environment = os.environ | {"XDG_CONFIG_HOME": home, "XDG_DATA_HOME": home, "CI": "true"}
        # Its own process group: the program is a wrapper that leaves the viewer running when it exits.
        process = subprocess.Popen(  # noqa: S603 (fixed arguments)
            [sys.executable, "-m", "rerun_cli", *options], env=environment, start_new_session=True,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        try:
            _wait_for(process, lambda: _is_listening(port))
            yield ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy"), process
        except (ConnectionError, RuntimeError) as error:
            # The viewer listens before it looks for a driver.
            raise _viewer_error(f"its connection was lost ({error})") from None
        finally:
            # Even if the wrapper has exited, because the viewer may still run.
            _terminate(process)


def _terminate(process: subprocess.Popen[bytes]) -> None:
    """Terminate a process and its group, including orphans and processes that ignore SIGTERM."""
    for end in (signal.SIGTERM, signal.SIGKILL):
        with suppress(ProcessLookupError):
            os.killpg(process.pid, end)
        with suppress(subprocess.TimeoutExpired):
            process.wait(SHUTDOWN_TIMEOUT)


def _is_listening(port: int) -> bool:
    with socket.socket() as probe:
        probe.settimeout(0.2)
        return probe.connect_ex(("127.0.0.1", port)) == 0


def _wait_for(process: subprocess.Popen[bytes], ask: Callable[[], T]) -> T:
    """The first non-empty answer; on a busy machine, the client times out before the viewer answers."""
    deadline = time.monotonic() + TIMEOUT
    while True:
        try:
            if answer := ask():
                return answer
        except TimeoutError:
            pass
        if process.poll() is not None:
            raise _viewer_error(f"it exited with status {process.returncode}")
        if time.monotonic() > deadline:
            raise KinemimicError(
                f"expected rerun's viewer to render the recording, found no answer in {TIMEOUT:.0f} s; try "
                "again when this machine is less busy"
            )
        time.sleep(0.1)


def _viewer_error(found: str) -> KinemimicError:
    return KinemimicError(
        f"expected rerun's viewer to render the recording, found that {found}; it needs a Vulkan driver "
        "(Debian: mesa-vulkan-drivers)"
    )
