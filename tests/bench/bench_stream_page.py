"""A live capture over UDP on the page: how long a frame takes, and what senders and viewers cannot slow.

One process, on the first core, receives, simulates and serves; a headless chromium looks, on the others,
where the sender runs too. The time of a frame runs from its sending to the arrival in the browser of the pose
that performs it: most of it is the filter's lag. A synthetic walker of 20 joints sends 30 frames a second.

Then the same without a browser: with a sender of as many frames as it can, which lasts for a fifth of the
time; with 50 clients that want to see the page; and a recording whose process is killed.

Arguments: seconds of each part (60 by default).
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from multiprocessing.sharedctypes import Synchronized
from multiprocessing.synchronize import Event
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import torch
import viser
import zstandard
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Origin, Subprotocol

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from peers.browser import chromium
from samples.walker import walker

from kinemimic.evaluate.simulate.clock import Clock
from kinemimic.evaluate.simulate.page.controls import Choices
from kinemimic.evaluate.simulate.page.page import Page
from kinemimic.evaluate.simulate.page.stage import FOLLOWED
from kinemimic.evaluate.simulate.session.frame import Frame
from kinemimic.evaluate.simulate.session.recording import SESSION, Replay
from kinemimic.evaluate.stream.command import prepare
from kinemimic.evaluate.stream.live import SOURCE, stream
from kinemimic.evaluate.stream.sockets import Udp
from kinemimic.pipeline.parallel.worker import worker_environment
from kinemimic.train.scenario.scenario_file import find_scenario
from kinemimic.train.sim.engines import resolve
from kinemimic.train.sim.world import CONTROL_RATE

PORT, PAGE, POLICY, TOKEN = 18_195, 18_094, "tracker", "bench"
RATE = 30.0  # of the sender, Hz
WARM = 10.0  # s until the page is drawn and the person is followed
CLIENTS = 50


@dataclass
class Logged:
    """A page that notes, for every frame drawn, when, the time of the pose, and where the scene is moved."""

    page: Page
    rows: list[tuple[float, float, float, float]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.waiting, self.show, self.tell = self.page.waiting, self.page.show, self.page.tell

    def draw(self, frame: Frame) -> None:
        if frame.shown is not None and frame.shown.follows:
            x, y = frame.bodies.positions[0, :2]
            self.rows.append((time.time(), frame.shown.time, float(x), float(y)))
        self.page.draw(frame)


def serve(pipe: Connection, folder: Path, seconds: float, core: int) -> None:
    """Follow the port's frames on one core; sends the address, then the rows and the summary."""
    os.sched_setaffinity(0, {core})
    torch.set_num_threads(1)
    prepare(POLICY, folder)
    page = Page(PAGE, TOKEN, Choices((POLICY,), (SOURCE,), (), POLICY, SOURCE, phases=False, slower=False))
    logged, clock = Logged(page), Clock(CONTROL_RATE)
    pipe.send(page.address)
    summary = stream(
        Udp(PORT), folder, engine=resolve("auto"), page=logged, clock=clock, policy=POLICY, seconds=seconds,
        record=False,
    )  # fmt: skip
    pipe.send((logged.rows, summary))
    page.close()


def send(stop: Event, flood: tuple[float, float], sent: Synchronized[int]) -> None:
    """Send the walker's frames, with the time of their sending; each of them over and over in the seconds
    `flood`. sent: counts the frames of the flood."""
    texts = [json.dumps(one) for one in walker(seconds=300.0, rate=RATE).clip.positions.round(4).tolist()]
    begun, k = time.time(), 0
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        while k < len(texts) and not stop.is_set():
            out.sendto(f'{{"time": {time.time()}, "positions": {texts[k]}}}'.encode(), ("127.0.0.1", PORT))
            elapsed = time.time() - begun
            if flood[0] <= elapsed < flood[1]:
                sent.value += 1
                k = int(elapsed * RATE)
            else:
                k += 1
                stop.wait(max(0.0, k / RATE - elapsed))


def look(address: str, seconds: float) -> list[tuple[float, bytes]]:
    """What a browser receives, and when."""
    found: list[tuple[float, bytes]] = []
    end = time.time() + seconds

    def received(data: bytes) -> None:
        found.append((time.time(), data))

    with chromium() as browser:
        tab = browser.new_page(viewport={"width": 1000, "height": 700})
        tab.on("websocket", lambda one: one.on("framereceived", received))
        tab.goto(address)
        while time.time() < end:
            tab.wait_for_timeout(200)
    return found


def crowd(address: str, seconds: float) -> str:
    """Clients that connect at the same time and never read; how many the page takes and refuses."""
    host = address.split("/")[2]
    where, origin = address.replace("http", "ws", 1), Origin(f"http://{host}")
    protocol = [Subprotocol(f"viser-v{viser.__version__}")]
    sockets, refused = [], 0
    for _ in range(CLIENTS):
        try:
            sockets.append(connect(where, origin=origin, subprotocols=protocol, ping_interval=None))
        except InvalidStatus:
            refused += 1
    time.sleep(seconds)
    for one in sockets:
        one.close()
    return f"{CLIENTS} clients that do not read: {len(sockets)} taken, {refused} refused"


def moved(data: bytes) -> list[tuple[float, float]]:
    """Where a message of viser moves the scene (x, y); empty for other messages."""
    length, packed = (int.from_bytes(data[k : k + 8], "little") for k in (0, 8))
    text = zstandard.ZstdDecompressor().decompress(data[16 : 16 + packed], max_output_size=length)
    messages = msgspec.msgpack.decode(text)["messages"]
    return [
        (-float(one["position"][0]), -float(one["position"][1]))
        for one in messages
        if one["type"] == "SetPositionMessage" and one["name"] == FOLLOWED
    ]


@contextmanager
def sending(flood: tuple[float, float] = (0.0, 0.0)) -> Iterator[Synchronized[int]]:
    """A sender in another process; the number of frames of its flood."""
    context = multiprocessing.get_context("spawn")
    stop, sent = context.Event(), context.Value("l", 0)
    sender = context.Process(target=send, args=(stop, flood, sent))
    sender.start()
    try:
        yield sent
    finally:
        stop.set()
        sender.join()


def served(seconds: float, beside: Callable[[str], Any]) -> tuple[Any, Any, dict[str, Any]]:
    """What `beside` finds at the address, the server's rows and its summary."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    cores = sorted(os.sched_getaffinity(0))
    with tempfile.TemporaryDirectory() as folder:
        server = context.Process(target=serve, args=(theirs, Path(folder), seconds, cores[0]))
        with worker_environment():  # threads of a matrix product would wait for each other on one core
            server.start()
        try:
            os.sched_setaffinity(0, cores[1:] or cores)
            found = beside(ours.recv())
            rows, summary = ours.recv()
        finally:
            server.join()
            os.sched_setaffinity(0, cores)
    return found, rows, summary


def over_the_page(seconds: float) -> None:
    with sending():
        received, rows, summary = served(seconds, lambda address: look(address, seconds))
    wanted = {(round(x, 5), round(y, 5)): (drawn, at) for drawn, at, x, y in rows}
    ways, drawn, begun = [], [], rows[0][0] + WARM
    for when, data in received:
        for x, y in moved(data) if isinstance(data, bytes) else ():
            if when > begun and (row := wanted.pop((round(x, 5), round(y, 5)), None)) is not None:
                ways.append(1000.0 * (when - row[1]))
                drawn.append(1000.0 * (row[0] - row[1]))
    print(f"frame sent to pose at the browser: {_percentiles(ways)}")
    print(f"frame sent to the end of its control step: {_percentiles(drawn)}")
    print(_kept(summary))


def beside_a_flood(seconds: float) -> None:
    def wait(_: str) -> None:
        time.sleep(seconds)

    lasts = 0.2 * seconds
    with sending((0.5 * seconds, 0.5 * seconds + lasts)) as sent:
        _, _, summary = served(seconds, wait)
    print(f"with {sent.value / lasts:,.0f} frames a second for {lasts:.0f} s: {_kept(summary)}")


def beside_a_crowd(seconds: float) -> None:
    with sending():
        said, _, summary = served(seconds, lambda address: crowd(address, seconds - 5.0))
    print(f"{said}: {_kept(summary)}")


def killed(seconds: float) -> None:
    """A recording whose process is killed: what can be replayed of it."""
    command = ["stream", "--udp", str(PORT), "--no-page", "--run"]
    with tempfile.TemporaryDirectory() as folder, sending():
        program = [sys.executable, "-m", "kinemimic", *command, folder]
        process = subprocess.Popen(program, stdout=subprocess.DEVNULL)
        recorded = Path(folder) / "session-1"
        while not (recorded / SESSION).exists() and process.poll() is None:
            time.sleep(0.01)
        begun = time.time()
        time.sleep(seconds)
        process.send_signal(signal.SIGKILL)
        lasted = time.time() - begun
        process.wait()
        steps = sum(1 for _ in Replay(recorded, named=find_scenario))
    print(f"killed {lasted:.2f} s after its recording began: {steps / CONTROL_RATE:.2f} s can be replayed")


def _kept(summary: dict[str, Any]) -> str:
    latency = summary["latency_ms"]
    return (
        f"{100.0 * summary['on_time']:.2f} % of {summary['steps']:,} control steps on time, latency "
        f"{latency['median']:.0f} ms (99 %: {latency['p99']:.0f})"
    )


def _percentiles(found: list[float]) -> str:
    if not found:
        return "none"
    return f"median {np.median(found):.0f} ms, 99 %: {np.percentile(found, 99):.0f} ms ({len(found)} poses)"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("seconds", nargs="?", type=float, default=60.0)
    seconds = parser.parse_args().seconds
    over_the_page(seconds)
    beside_a_flood(seconds)
    beside_a_crowd(seconds)
    killed(min(seconds, 20.0))


if __name__ == "__main__":
    main()
