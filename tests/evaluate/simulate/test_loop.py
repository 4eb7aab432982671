"""The loop with a page that is no browser."""

from __future__ import annotations

import json
import queue
import shutil
from pathlib import Path
from typing import Any

import pytest
from safetensors.numpy import load_file, save_file

from kinemimic.evaluate.policies.recipe import POLICIES
from kinemimic.evaluate.simulate.clock import Clock
from kinemimic.evaluate.simulate.frame import Frame
from kinemimic.evaluate.simulate.inputs import Drag, Push, Release
from kinemimic.evaluate.simulate.loop import Loop, Performance
from kinemimic.evaluate.simulate.recording import SESSION, Replay, begin_session
from kinemimic.evaluate.simulate.repertoire import Repertoire
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import file_hash
from kinemimic.pipeline.live.frame import CapturedFrame
from kinemimic.train.rollout.policy import POLICY
from kinemimic.train.scenario.scenario_file import scenario
from kinemimic.train.sim.world import CONTROL_RATE


class Page:
    """Keeps what it is told."""

    def __init__(self) -> None:
        self.waiting: queue.Queue[Any] = queue.Queue()
        self.frames: list[Frame] = []
        self.states: list[str] = []
        self.said: list[str] = []

    def draw(self, frame: Frame) -> None:
        self.frames.append(frame)

    def show(self, frame: Frame, state: str) -> None:
        self.states.append(state)

    def tell(self, error: KinemimicError | str) -> None:
        self.said.append(str(error))


@pytest.fixture
def page() -> Page:
    return Page()


@pytest.fixture
def loop(page: Page, walk_run: Path, tmp_path: Path) -> Loop:
    repertoire = Repertoire(walk_run, tmp_path / "prepared")

    def choose(policy: str, motion: str, speed: float) -> Performance:
        folder, performs = repertoire.prepared(policy, motion)
        return Performance(folder, policy, performs, speed)

    return Loop(
        Performance(walk_run, "run", "run"),
        page,
        Clock(CONTROL_RATE, sleep=lambda _: None),
        engine="pybullet",
        open_session=lambda one: begin_session(one.run, "pybullet", speed=one.speed, named=scenario),
        choose=choose,
        recordings=tmp_path / "recordings",
    )


def test_a_pause_stops_and_one_step_steps(loop: Loop, page: Page) -> None:
    for _ in range(3):
        loop.beat()
    page.waiting.put(("toggle", ()))
    for _ in range(3):
        loop.beat()
    assert len(page.frames) == 3
    assert "paused" in page.states[-1]
    page.waiting.put(("step", ()))
    loop.beat()
    loop.beat()
    assert [frame.step for frame in page.frames] == [1, 2, 3, 4]
    page.waiting.put(("toggle", ()))
    loop.beat()
    assert len(page.frames) == 5


def test_a_pause_holds_a_file_but_not_a_sensor(loop: Loop, page: Page) -> None:
    asked: list[float] = []

    def frames(until: float) -> list[CapturedFrame]:
        asked.append(until)
        return []

    for waits, beats in ((True, [0, 1]), (False, [0, 1, 2])):
        asked.clear()
        loop._frames, loop._waits, loop._beats = frames, waits, 0
        loop.beat()
        page.waiting.put(("toggle", ()))
        loop.beat()
        page.waiting.put(("toggle", ()))
        loop.beat()
        assert asked == [beat / CONTROL_RATE for beat in beats]


def test_a_tracker_that_was_trained_again_gets_another_folder(walk_run: Path, tmp_path: Path) -> None:
    run = tmp_path / "mine"
    shutil.copytree(POLICIES / "tracker", run)
    shutil.copy(walk_run / "motion.json", run)
    repertoire = Repertoire(run, tmp_path / "prepared")
    before, _ = repertoire.prepared("mine", "walk")
    weights = {name: 0.5 * tensor for name, tensor in load_file(run / POLICY).items()}
    save_file(weights, run / POLICY)
    after, motion = repertoire.prepared("mine", "walk")
    assert (before != after, motion) == (True, "walk")
    for folder in (before, after):
        assert file_hash(folder / POLICY)[:8] in folder.name


def test_a_recording_begins_with_a_new_session_and_replays(loop: Loop, page: Page, tmp_path: Path) -> None:
    for _ in range(5):
        loop.beat()
    page.waiting.put(("record", ()))
    loop.beat()
    assert page.frames[-1].step == 1
    page.waiting.put(Push("torso", force=(50.0, 0.0, 0.0)))
    for _ in range(2):  # of two drags before a control step, one counts
        page.waiting.put(Drag("head", (0.0, 0.0, 0.0), (1.0, 0.0, 1.0)))
    loop.beat()
    page.waiting.put(Release())
    for _ in range(20):
        loop.beat()
    page.waiting.put(("record", ()))
    loop.beat()
    folder = tmp_path / "recordings" / "session-1"
    assert page.said[-1] == f"recorded: kinemimic simulate --replay --run {folder}"
    lines = [json.loads(line) for line in (folder / SESSION).read_text().splitlines()]
    kinds = [line["input"]["type"] for line in lines if "input" in line]
    assert kinds == ["push", "drag", "release"]
    assert len(list(Replay(folder, named=scenario))) == 22


def test_what_does_not_fit_is_said_and_changes_nothing(loop: Loop, page: Page) -> None:
    page.waiting.put(Push("torso", force=(1e9, 0.0, 0.0)))
    page.waiting.put(("choose", ("no-such", "run", 1.0)))
    loop.beat()
    assert len(page.said) == 2
    assert len(page.frames) == 1
    assert not page.frames[0].loads.any()


def test_another_policy_performs_without_a_pause(loop: Loop, page: Page) -> None:
    loop.beat()
    page.waiting.put(("choose", ("run", "run", 1.0)))
    page.waiting.put(("choose", ("tracker", "walk", 1.1)))
    for _ in range(6):
        loop.beat()
    assert page.said == []
    assert "**tracker** performs **walk**" in page.states[-1]
    assert page.frames[-1].step == 6


def test_ctrl_c_ends_the_recording(loop: Loop, page: Page, tmp_path: Path) -> None:
    page.waiting.put(("record", ()))

    def interrupted() -> None:
        raise KeyboardInterrupt

    loop.beat()
    loop._clock.wait = interrupted  # type: ignore[method-assign]
    with pytest.raises(KeyboardInterrupt):
        loop.run()
    last = (tmp_path / "recordings" / "session-1" / SESSION).read_text().splitlines()[-1]
    assert json.loads(last)["step"] == 1
