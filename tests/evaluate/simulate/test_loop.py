"""The loop with a page that is no browser."""

from __future__ import annotations

import json
import os
import queue
import shutil
import signal
from pathlib import Path
from typing import Any

import pytest
from safetensors.numpy import load_file, save_file

from kinemimic.evaluate.policies.recipe import POLICIES
from kinemimic.evaluate.simulate.clock import Clock
from kinemimic.evaluate.simulate.loop import Loop, Performance
from kinemimic.evaluate.simulate.page.requests import (
    Choose,
    Redraw,
    SetSpeed,
    StepOnce,
    TogglePause,
    ToggleRecording,
)
from kinemimic.evaluate.simulate.repertoire import Repertoire
from kinemimic.evaluate.simulate.session.frame import Frame, Status
from kinemimic.evaluate.simulate.session.inputs import (
    Carry,
    Drag,
    Enter,
    Ground,
    Push,
    Release,
    Restart,
    Throw,
)
from kinemimic.evaluate.simulate.session.recording import SESSION, Recorder, Replay, begin_session
from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import file_hash
from kinemimic.pipeline.live.frame import CapturedFrame
from kinemimic.train.rollout.policy import POLICY
from kinemimic.train.scenario.scenario_file import find_scenario
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

    def show(self, frame: Frame, status: Status) -> None:
        self.states.append(status.text)

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
        open_session=lambda one: begin_session(one.run, "pybullet", speed=one.speed, named=find_scenario),
        choose=choose,
        recordings=tmp_path / "recordings",
    )


def test_a_pause_stops_and_one_step_steps(loop: Loop, page: Page) -> None:
    for _ in range(3):
        loop.beat()
    page.waiting.put(TogglePause())
    for _ in range(3):
        loop.beat()
    assert len(page.frames) == 3
    assert "paused" in page.states[-1]
    page.waiting.put(StepOnce())
    loop.beat()
    loop.beat()
    assert [frame.step for frame in page.frames] == [1, 2, 3, 4]
    page.waiting.put(TogglePause())
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
        page.waiting.put(TogglePause())
        loop.beat()
        page.waiting.put(TogglePause())
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


def test_another_motion_of_the_same_name_gets_another_folder(walk_run: Path, tmp_path: Path) -> None:
    run = tmp_path / "mine"
    shutil.copytree(walk_run, run)
    repertoire = Repertoire(run, tmp_path / "prepared")
    assert repertoire.trackers == ("tracker", "standing")
    before, _ = repertoire.prepared("tracker", "mine")
    shutil.copy(POLICIES / "run" / "motion.json", run)
    after, _ = repertoire.prepared("tracker", "mine")
    assert [file_hash(folder / "motion.json")[:8] in folder.name for folder in (before, after)] == [True] * 2


def test_a_recording_begins_with_a_new_session_and_replays(loop: Loop, page: Page, tmp_path: Path) -> None:
    for _ in range(5):
        loop.beat()
    page.waiting.put(ToggleRecording())
    loop.beat()
    assert page.frames[-1].step == 1
    page.waiting.put(Push("torso", force=(50.0, 0.0, 0.0)))
    for _ in range(2):  # of two drags before a control step, one counts
        page.waiting.put(Drag("head", (0.0, 0.0, 0.0), (1.0, 0.0, 1.0)))
    loop.beat()
    page.waiting.put(Release())
    for _ in range(20):
        loop.beat()
    page.waiting.put(ToggleRecording())
    loop.beat()
    folder = tmp_path / "recordings" / "session-1"
    assert page.said[-1] == f"recorded: kinemimic evaluate --run {folder}"
    lines = [json.loads(line) for line in (folder / SESSION).read_text().splitlines()]
    kinds = [line["input"]["type"] for line in lines if "input" in line]
    assert kinds == ["push", "drag", "release"]
    assert len(list(Replay(folder, named=find_scenario))) == 22


def test_what_does_not_fit_is_said_and_changes_nothing(loop: Loop, page: Page) -> None:
    page.waiting.put(Push("torso", force=(1e9, 0.0, 0.0)))
    page.waiting.put(Choose("no-such", "run", 1.0))
    loop.beat()
    assert len(page.said) == 2
    assert len(page.frames) == 1
    assert not page.frames[0].loads.any()


def test_another_policy_performs_without_a_pause(loop: Loop, page: Page) -> None:
    loop.beat()
    page.waiting.put(Choose("run", "run", 1.0))
    page.waiting.put(Choose("tracker", "walk", 1.1))
    for _ in range(6):
        loop.beat()
    assert page.said == []
    assert "**tracker** performs **walk**" in page.states[-1]
    assert page.frames[-1].step == 6


def test_ctrl_c_ends_the_recording_after_the_control_step(
    loop: Loop, page: Page, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page.waiting.put(ToggleRecording())
    loop.beat()
    seen_by = loop.session._frame

    def interrupted(drag: Array | None) -> Frame:
        if loop.session.step_count == 5:
            os.kill(os.getpid(), signal.SIGINT)
        return seen_by(drag)

    monkeypatch.setattr(loop.session, "_frame", interrupted)
    # A job that a shell put into the background has a SIGINT that is ignored.
    earlier = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            loop.run()
    finally:
        signal.signal(signal.SIGINT, earlier)
    folder = tmp_path / "recordings" / "session-1"
    last = (folder / SESSION).read_text().splitlines()[-1]
    assert json.loads(last)["step"] == 5
    assert len(list(Replay(folder, named=find_scenario))) == 5


def test_a_recording_that_cannot_be_written_ends_and_the_page_goes_on(
    loop: Loop, page: Page, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page.waiting.put(ToggleRecording())
    loop.beat()
    session = loop.session
    closed: list[bool] = []
    monkeypatch.setattr(session, "close", lambda: closed.append(True))
    monkeypatch.setattr(Recorder, "_write", full_disk)
    page.waiting.put(Push("torso"))
    loop.beat()
    assert "session-1 ends here: no space left" in page.said[-1]
    assert page.frames[-1].step == 2
    page.waiting.put(ToggleRecording())
    loop.beat()
    assert "cannot record: no space left" in page.said[-1]
    assert (loop.recorder, loop.session) == (None, session)
    assert [one.name for one in loop.recorded] == ["session-1"]
    assert not (tmp_path / "recordings" / "session-2").exists()
    loop.run(1)
    assert closed == [True]


def full_disk(*_: object) -> None:
    raise OSError("no space left")


def test_a_session_is_closed_though_its_recording_cannot_be(
    loop: Loop, page: Page, monkeypatch: pytest.MonkeyPatch
) -> None:
    page.waiting.put(ToggleRecording())
    loop.beat()
    closed: list[bool] = []
    monkeypatch.setattr(loop.session, "close", lambda: closed.append(True))
    monkeypatch.setattr(Recorder, "_write", full_disk)
    loop.run(0)
    assert closed == [True]


def test_a_recording_begins_with_what_the_sliders_show(loop: Loop, page: Page) -> None:
    for event in (Ground(0.5, 0.05), Carry("hand_left", 3.0), Ground(0.4, 0.02), Enter("thrown-ball", 2)):
        page.waiting.put(event)
    loop.beat()
    page.waiting.put(ToggleRecording())
    loop.beat()
    lines = [json.loads(line) for line in (loop.recorded[0] / SESSION).read_text().splitlines()]
    shown = [(line["step"], line["input"]["type"]) for line in lines if "input" in line]
    assert shown == [(0, "carry"), (0, "ground"), (0, "enter")]
    assert lines[2]["input"]["slope"] == 0.02
    assert page.frames[-1].loads[:, 2].min() == pytest.approx(-3.0 * 9.81)
    page.waiting.put(Enter())
    page.waiting.put(Choose("run", "run", 1.0))
    loop.beat()
    assert page.frames[-1].step == 1
    assert page.frames[-1].tilt.any()
    assert page.said[1:] == [f"recorded: kinemimic evaluate --run {loop.recorded[0]}"]
    loop._page.show(page.frames[-1], loop._status())
    assert f"kinemimic evaluate --run {loop.recorded[0]}" in page.states[-1]


def test_a_paused_page_shows_what_was_done_and_else_rests(loop: Loop, page: Page) -> None:
    loop.beat()
    page.waiting.put(TogglePause())
    loop.beat()
    page.states.clear()
    for event, drawn in (
        (Restart(0.5), 2),
        (Drag("head", (0.0, 0.0, 0.0), (1.0, 0.0, 1.0)), 2),
        (Throw("sphere", (0.24,) * 3, 1.0, (1.8, 0.0, 1.1)), 3),
        (Redraw(), 4),
    ):
        page.waiting.put(event)
        loop.beat()
        assert len(page.frames) == drawn
    assert [frame.step for frame in page.frames] == [1] * 4
    assert page.frames[1].phase == 0.5
    assert len(page.frames[2].obstacles) == 1
    for _ in range(CONTROL_RATE):
        loop.beat()
    assert len(page.frames) == 4
    assert len(page.states) == 4 + 1  # one for each input, and one a second


def test_a_paused_page_does_not_end_and_slow_motion_takes_no_longer(
    loop: Loop, page: Page, monkeypatch: pytest.MonkeyPatch
) -> None:
    beats = 0

    def waited() -> None:
        nonlocal beats
        beats += 1
        if beats in {3, 20}:
            page.waiting.put(TogglePause())

    monkeypatch.setattr(loop._clock, "wait", waited)
    monkeypatch.setattr(loop.session, "close", lambda: None)
    loop.run(ended=lambda: True, tail=5)
    # The first beat finds that the source has ended; five control steps follow.
    assert (beats, loop.session.step_count) == (23, 6)
    moments = iter([100.0, 100.1, 101.0, 101.9, 102.0])
    monkeypatch.setattr("kinemimic.evaluate.simulate.loop.time.monotonic", lambda: next(moments))
    loop.run(seconds=2.0)
    assert loop.session.step_count == 6 + 3


def test_a_speed_that_is_no_number_changes_nothing(loop: Loop, page: Page) -> None:
    page.waiting.put(SetSpeed(0.5))
    page.waiting.put(SetSpeed(float("nan")))
    loop.beat()
    assert loop._clock.speed == 0.5
