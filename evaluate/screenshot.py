"""A picture of a rerun recording, made without a screen."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from rerun.experimental import ViewerClient

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.store import atomic

PATIENCE = 60.0  # s: a software renderer on a busy machine is slow to start
SETTLING = 5.0  # s: until the views have their data and the viewer's greeting has faded


def screenshot(
    recording: Path, picture: Path, *, timeline: str, seconds: float, size: tuple[int, int] = (1600, 1000)
) -> None:
    """Draw a recording at a time of its timeline as PNG of (width, height) pixels.

    Needs a Vulkan driver; a software one will do (Debian: `libvulkan1 mesa-vulkan-drivers`). The viewer that
    draws listens on the loopback interface until the picture is taken, and sends no usage data.
    """
    with _viewer(size) as (client, process):
        client.open(str(recording.resolve()))
        _wait(process, lambda: bool(client.get_state().recordings) and not client.get_state().loading)
        client.set_time(timeline, duration=seconds, play_state="paused")
        time.sleep(SETTLING)
        with atomic(picture) as temporary:
            client.save_screenshot(str(temporary.resolve()))


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
            _wait(process, lambda: _listens(port))
            yield ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy"), process
        except (ConnectionError, RuntimeError) as error:
            # It listens before it looks for a driver.
            raise _no_picture(f"the viewer went away ({error})") from None
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGTERM)
            process.wait()


def _listens(port: int) -> bool:
    with socket.socket() as probe:
        probe.settimeout(0.2)
        return probe.connect_ex(("127.0.0.1", port)) == 0


def _wait(process: subprocess.Popen[bytes], ready: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE
    while not ready():
        if process.poll() is not None:
            raise _no_picture(f"the viewer ended with status {process.returncode}")
        if time.monotonic() > deadline:
            raise _no_picture(f"the viewer was not ready within {PATIENCE:.0f} s")
        time.sleep(0.1)


def _no_picture(found: str) -> KinemimicError:
    return KinemimicError(
        f"screenshot: expected a picture, but {found}; it needs a Vulkan driver (Debian: mesa-vulkan-drivers)"
    )
