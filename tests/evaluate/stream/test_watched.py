"""What people are told of a capture, and what is counted over its sessions."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from kinemimic.evaluate.simulate.session.frame import LiveView, Status
from kinemimic.evaluate.stream.source import Faults
from kinemimic.evaluate.stream.watched import NoPage, Watched


class Page(NoPage):
    """Keeps the words that it shows."""

    def __init__(self) -> None:
        super().__init__()
        self.words = ""

    def show(self, frame: Any, status: Status) -> None:
        self.words = status.text


def session(frames: int, *, reading: object = None, refused: int = 0) -> Any:
    capture = SimpleNamespace(
        frames=frames, late=0, thinned=0, refused=refused, sides=SimpleNamespace(swaps=0, reversals=0),
        playout=SimpleNamespace(skips=1), reading=reading, complaint="", last_fault="",
    )  # fmt: skip
    shown = SimpleNamespace(starved=False, latency=0.15)
    people = SimpleNamespace(people=1, lost=0)
    return SimpleNamespace(capture=capture, performer=people, falls=2, shown=shown)


def test_all_sessions_are_counted() -> None:
    watched = Watched(NoPage(), SimpleNamespace(faults=Faults()))  # type: ignore[arg-type]
    assert watched.counts() == {}
    assert watched.words() == "0 frames, 0 refused"
    reading: Any = object()
    watched.begin(session(40, reading=reading))
    watched.begin(session(0))
    assert (watched.counts()["frames"], watched.counts()["falls"], watched.counts()["skipped"]) == (40, 4, 2)
    assert watched.known_reading() is reading


def test_page_and_terminal_say_why_frames_are_refused() -> None:
    faults, page = Faults(), Page()
    watched = Watched(page, SimpleNamespace(faults=faults))  # type: ignore[arg-type]
    watched.begin(session(1, refused=2))
    watched.show(None, Status("waiting for frames"))  # type: ignore[arg-type]
    assert page.words == "waiting for frames"
    faults.note("refused: lists that do not fit together", "found 17 joints")
    watched.show(None, Status("waiting for frames"))  # type: ignore[arg-type]
    assert page.words == "waiting for frames\n\nunreadable: 1 (last: found 17 joints)"
    assert watched.words() == "1 frame, 3 refused (last: found 17 joints), 150 ms behind"
    watched.notice = "the end"
    watched.show(None, Status("upright"))  # type: ignore[arg-type]
    assert page.words.startswith("the end\n\nupright")


def test_a_picture_that_a_paused_page_draws_again_is_no_control_step() -> None:
    def frame(step: int) -> Any:
        nothing = np.full((20, 3), np.nan)
        shown = LiveView(nothing, nothing, time=0.0, presence=1.0, latency=0.5, people=1, starved=False)
        return SimpleNamespace(step=step, fallen=False, shown=shown)

    watched = Watched(NoPage(), SimpleNamespace(faults=Faults()))  # type: ignore[arg-type]
    watched.begin(session(3))
    for step in (0, 1, 2, 2, 2, 3):
        watched.draw(frame(step))
    assert (watched.steps, watched.followed, len(watched.latencies)) == (3, 3, 3)
    watched.begin(session(2))  # a recording begins: steps are counted from 0 again
    for step in (0, 1, 2):
        watched.draw(frame(step))
    assert watched.steps == 5
