"""A file on the page waits for the first viewer, stops at its end, and is played again."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from kinemimic.evaluate.stream.file_player import END, FilePlayer


class Shown:
    """A loop, a file and a page; `beat` is a beat of the loop."""

    def __init__(self) -> None:
        self.loop, self.source = (
            SimpleNamespace(paused=False),
            SimpleNamespace(ended=False, rewind=self._rewind),
        )
        self.session = SimpleNamespace(restarts=0)
        self.told: list[str] = []
        self.watched: Any = SimpleNamespace(session=self.session, notice="", tell=self.told.append)
        self.viewers = self.rewound = 0
        self.player = FilePlayer(self.loop, self.source, self.watched, lambda: self.viewers, 3)

    def _rewind(self) -> None:
        self.rewound += 1
        self.source.ended = False

    def beats(self, count: int) -> None:
        for _ in range(count):
            assert not self.player.beat()


@pytest.fixture
def shown() -> Shown:
    return Shown()


def test_a_file_waits_for_a_viewer_and_stops_at_its_end(shown: Shown) -> None:
    shown.beats(50)
    assert shown.loop.paused
    shown.viewers = 1
    shown.beats(50)
    assert not shown.loop.paused
    shown.source.ended = True
    shown.beats(2)
    assert not shown.loop.paused
    shown.beats(50)
    assert shown.loop.paused
    assert (shown.told, shown.watched.notice) == ([END], END)
    assert shown.rewound == 0


@pytest.mark.parametrize("asked", ["restart", "play"])
def test_a_file_is_played_again(asked: str, shown: Shown) -> None:
    shown.viewers = 1
    shown.beats(1)
    shown.session.restarts += 1  # in the middle, it puts the humanoid back, and no more
    shown.beats(1)
    shown.source.ended = True
    shown.beats(10)
    assert shown.rewound == 0
    if asked == "restart":
        shown.session.restarts += 1
    else:
        shown.loop.paused = False
    shown.beats(1)
    assert (shown.rewound, shown.loop.paused, shown.watched.notice) == (1, False, "")
    shown.source.ended = True
    shown.beats(10)
    assert shown.loop.paused
    assert shown.told == [END, END]


def test_a_pause_before_the_end_stays_one(shown: Shown) -> None:
    shown.viewers = 1
    shown.beats(1)
    shown.source.ended = shown.loop.paused = True
    shown.beats(50)
    assert (shown.told, shown.rewound) == ([], 0)
