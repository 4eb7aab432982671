"""The page of `simulate` in real time: steps on time, frames at the browser, pointer to force.

One process, on the first core, simulates and serves; a headless chromium, on the others, looks and drags the
humanoid's chest up and down. Its software rendering is slower than a screen's, so frames are counted as they
arrive, and with many humanoids it takes a part of the first core too. The time of a drag runs from the event
of the pointer in the browser to the end of the control step that has its force. In the same process without a
page, it runs from the input to the end of that step.

Then the same for a minute with twenty humanoids on the page, and control steps of many without a page.

Arguments: minutes (10 by default).
"""

from __future__ import annotations

import argparse
import bisect
import multiprocessing
import os
import shutil
import tempfile
import time
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
import torch

from kinemimic.evaluate.policies.shipped import ShippedPolicies
from kinemimic.evaluate.simulate.clock import Clock
from kinemimic.evaluate.simulate.loop import Loop, Performance
from kinemimic.evaluate.simulate.page.controls import Choices
from kinemimic.evaluate.simulate.page.page import Page
from kinemimic.evaluate.simulate.session.companions import AccompaniedSession
from kinemimic.evaluate.simulate.session.inputs import Drag
from kinemimic.evaluate.simulate.session.session import Session
from kinemimic.pipeline.parallel.worker import worker_environment
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout.policy import load_trained
from kinemimic.train.scenario.scenario_file import find_scenario
from kinemimic.train.sim.engines import open_world, resolve
from kinemimic.train.sim.world import CONTROL_RATE
from kinemimic.train.task.env import ImitationBatch

POLICY = "walk"
HUMANOIDS = (1, 10, 20, 40, 80)
ON_PAGE = 20
JUMP = 0.02  # m by which the pointer's height changes between two moves, at least
MOVES = 400
SOFTWARE = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox"]
LISTEN = """() => { window.moves = []; addEventListener("pointermove",
    event => window.moves.push((performance.timeOrigin + performance.now()) / 1000), true); }"""


class Watched(Session):
    """A session that notes, for every drag to another height, when the step with its force ended."""

    def watch(self) -> list[float]:
        self.forces: list[float] = []
        self._height, self._jumped = 0.0, False
        return self.forces

    def apply(self, found: Any) -> None:
        if isinstance(found, Drag) and abs(found.pointer[2] - self._height) > JUMP:
            self._height, self._jumped = found.pointer[2], True
        super().apply(found)

    def advance(self) -> Any:
        frame = super().advance()
        if self._jumped:
            self.forces.append(time.time())
            self._jumped = False
        return frame


class WatchedGroup(Watched, AccompaniedSession):
    """Such a session of several humanoids."""


def watched(run: Path, humanoids: int = 1) -> Watched:
    motion, policy, record = load_trained(run)
    env = TrainConfig.from_json(record["config"]).measured_env
    if humanoids == 1:
        return Watched(motion, policy, env, resolve("auto"), scenario_named=find_scenario)
    return WatchedGroup(motion, policy, env, resolve("auto"), humanoids - 1, scenario_named=find_scenario)


def serve(pipe: Connection, run: Path, seconds: float, core: int, humanoids: int) -> None:
    """Simulate and serve on one core; sends the address, then beats, late ones, forces, seconds used."""
    os.sched_setaffinity(0, {core})
    torch.set_num_threads(1)
    clock = Clock(CONTROL_RATE)
    page = Page(18_093, "bench", Choices((POLICY,), (POLICY,), (), POLICY, POLICY))
    session = watched(run, humanoids)
    forces = session.watch()
    loop = Loop(
        Performance(run, POLICY, POLICY), page, clock, engine=resolve("auto"), open_session=lambda _: session,
        choose=lambda *_: Performance(run, POLICY, POLICY), recordings=run / "simulate",
    )  # fmt: skip
    pipe.send(page.address)
    pipe.recv()  # the browser is there
    clock.restart()
    clock.beats = clock.late = 0
    used = time.process_time()
    loop.run(round(seconds * CONTROL_RATE))
    pipe.send((clock.beats, clock.late, forces, time.process_time() - used))
    page.close()


def look(pipe: Connection, seconds: float) -> tuple[list[float], list[float]]:
    """Look at the page and drag; times at which frames arrived, and times of the pointer's moves."""
    from playwright.sync_api import sync_playwright

    frames: list[float] = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=SOFTWARE)
        tab = browser.new_page(viewport={"width": 1000, "height": 700})
        tab.on(
            "websocket",
            lambda socket: socket.on("framereceived", lambda _: frames.append(time.time())),
        )
        address = pipe.recv()
        tab.goto(address)
        pipe.send("ready")
        end = time.time() + seconds
        tab.wait_for_timeout(8000)
        tab.evaluate(LISTEN)
        x, y = 340, 325
        tab.mouse.move(x, y)
        tab.mouse.down()
        for k in range(MOVES):
            if time.time() > end - 3.0:
                break
            # At intervals that have no common measure with the control steps'.
            tab.wait_for_timeout(237 + 10 * (k % 7))
            tab.mouse.move(x + 3, y - 60 - 40 * (k % 2))
        tab.mouse.up()
        moves = tab.evaluate("window.moves")
        while not pipe.poll():
            tab.wait_for_timeout(200)
        browser.close()
    return frames, moves


def over_the_page(run: Path, seconds: float, humanoids: int) -> None:
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    cores = sorted(os.sched_getaffinity(0))
    server = context.Process(target=serve, args=(theirs, run, seconds, cores[0], humanoids))
    with worker_environment():  # threads of a matrix product would wait for each other on one core
        server.start()
    os.sched_setaffinity(0, cores[1:] or cores)
    begun = time.time()
    frames, moves = look(ours, seconds)
    beats, late, forces, used = ours.recv()
    server.join()
    os.sched_setaffinity(0, cores)
    whole = np.histogram(frames, np.arange(begun + 10.0, begun + seconds - 1.0))[0]
    print(f"humanoids on the page: {humanoids}")
    print(f"{beats} control steps in {seconds:.0f} s, {100.0 * (1 - late / beats):.2f} % on time; "
          f"{1000.0 * used / beats:.1f} ms of the core each")  # fmt: skip
    print(f"frames at the browser: median {np.median(whole):.0f} a second, least {whole.min()}")
    delays = 1000.0 * np.array([at - moves[k - 1] for at in forces if (k := bisect.bisect(moves, at))])
    delays = delays[delays < 250.0]  # a later one is of a move that had no other height
    print(f"pointer to force over the page: {_percentiles(delays)} ({len(delays)} of {len(moves)} moves)")


def in_process(run: Path, steps: int = 600) -> None:
    session = watched(run)
    session.watch()
    delays = []
    for k in range(steps):
        begun = time.perf_counter()
        session.apply(Drag("torso", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0 + 0.1 * (k % 2))))
        session.advance()
        delays.append(1000.0 * (time.perf_counter() - begun))
    print(f"input to the end of its control step, without a page: {_percentiles(np.array(delays))}")


def on_one_core(run: Path, steps: int = 150) -> None:
    """Milliseconds of a control step, policy included, of several humanoids on one core."""
    motion, policy, record = load_trained(run)
    env = TrainConfig.from_json(record["config"]).measured_env
    for size in HUMANOIDS:
        batch = ImitationBatch(open_world(size, resolve("auto"), threads=1), Reference(motion), env)
        batch.reset(np.arange(size), np.arange(size) / size)
        took = []
        for _ in range(steps):
            begun = time.perf_counter()
            batch.step(policy.act(batch.observe()).astype(np.float64))
            took.append(1000.0 * (time.perf_counter() - begun))
        batch.world.close()
        print(f"{size} humanoids on one core: {_percentiles(np.array(took))} a control step of 33.3 ms")


def _percentiles(found: np.ndarray[Any, Any]) -> str:
    if not len(found):
        return "none"
    return f"median {np.median(found):.1f} ms, 99 %: {np.percentile(found, 99):.1f} ms"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("minutes", nargs="?", type=float, default=10.0)
    minutes = parser.parse_args().minutes
    torch.set_num_threads(1)
    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder) / POLICY
        ShippedPolicies().prepare(POLICY, run)
        over_the_page(run, 60.0 * minutes, 1)
        over_the_page(run, 60.0, ON_PAGE)
        os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:1])
        in_process(run)
        on_one_core(run)


if __name__ == "__main__":
    main()
