"""A source drives a session, with the page or without."""

from __future__ import annotations

import queue
import shutil
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from kinemimic.evaluate.simulate.clock import Clock
from kinemimic.evaluate.simulate.frame import Frame, LiveSettings
from kinemimic.evaluate.simulate.live_session import LiveSession
from kinemimic.evaluate.simulate.loop import Loop, PageView, Performance
from kinemimic.evaluate.simulate.recording import SESSION, begin_live_session
from kinemimic.evaluate.stream.files import Replay
from kinemimic.evaluate.stream.source import Source
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.train.reference.live_reference import AHEAD
from kinemimic.train.scenario.scenario_file import scenario
from kinemimic.train.sim.world import CONTROL_RATE

SOURCE = "live capture"  # its name among the motions of the page
AFTER = 1.0  # s that a replay goes on after what it still has to perform
_KEPT = 18_000  # control steps whose latencies the summary has: ten minutes


class NoPage:
    """What the loop needs of a page, for nobody."""

    def __init__(self) -> None:
        self.waiting: queue.Queue[Any] = queue.Queue()

    def draw(self, frame: Frame) -> None:
        """Nobody looks."""

    def show(self, frame: Frame, state: str) -> None:
        """Nobody looks."""

    def tell(self, error: KinemimicError | str) -> None:
        """Nobody listens."""


class Watched:
    """A page whose frames are counted for the summary.

    latencies: s, of the first ten minutes; steps, followed, upright: control steps, those of them behind a
    person, and those of these without a fall.
    """

    def __init__(self, page: PageView) -> None:
        self.waiting, self._page = page.waiting, page
        self.latencies: list[float] = []
        self.steps = self.followed = self.upright = 0

    def draw(self, frame: Frame) -> None:
        """Count a frame and show it."""
        self.steps += 1
        if frame.shown is not None and frame.shown.presence >= 1.0 and not frame.shown.starved:
            self.followed += 1
            self.upright += not frame.fallen
            if len(self.latencies) < _KEPT:
                self.latencies.append(frame.shown.latency)
        self._page.draw(frame)

    def show(self, frame: Frame, state: str) -> None:
        """Show numbers."""
        self._page.show(frame, state)

    def tell(self, error: KinemimicError | str) -> None:
        """Pass on a message."""
        self._page.tell(error)


def stream(
    source: Source,
    run: Path,
    *,
    settings: LiveSettings | None = None,
    engine: str,
    page: PageView | None = None,
    clock: Clock | None = None,
    policy: str = "",
    steps: int | None = None,
    record: bool = True,
) -> dict[str, Any]:
    """Follow a source until it ends, for `steps` control steps, or until Ctrl-C; returns the summary.

    run: folder with the policy, below which sessions are recorded. page: None for nobody; clock: None to go
    as fast as the processor can, which suits a replay alone. With `record`, a recording of nothing is not
    kept.
    """
    settings = settings or LiveSettings()
    watched = Watched(page or NoPage())
    clock = clock or Clock(CONTROL_RATE, sleep=lambda _: None)
    sessions: list[LiveSession] = []

    def opened(performed: Performance) -> LiveSession:
        sessions.append(begin_live_session(performed.run, engine, settings, named=scenario))
        return sessions[-1]

    def only(*_: Any) -> Performance:
        raise KinemimicError("expected one policy and the live capture: start again to change them")

    loop = Loop(
        Performance(run, policy or run.name, SOURCE), watched, clock, engine=engine, open_session=opened,
        choose=only, recordings=run, frames=source.poll, waits=source.waits,
    )  # fmt: skip
    if record:
        loop.record()
    tail = round((settings.lag + AFTER) * CONTROL_RATE) + AHEAD
    try:
        loop.run(steps, lambda: source.ended, tail)
    except KeyboardInterrupt:
        pass
    finally:
        source.close()
    if record and not any(one.capture.frames for one in sessions):
        loop.recorded[:] = [folder for folder in loop.recorded if not _is_empty(folder)]
    return summary(source, sessions[-1], watched, clock, loop.recorded[-1] if loop.recorded else None)


def _is_empty(folder: Path) -> bool:
    """Whether nothing was done in a session without frames, which then is removed."""
    empty = '"input":' not in (folder / SESSION).read_text(encoding="utf-8")
    if empty:
        shutil.rmtree(folder)
    return empty


def summary(
    source: Source, session: LiveSession, watched: Watched, clock: Clock, recorded: Path | None
) -> dict[str, Any]:
    """What happened, in JSON values: see docs/stream.md."""
    capture, reading, score = session.capture, session.capture.recogniser.reading, session.score()
    faults = Counter(source.faults)
    faults["late or repeated"] += capture.window.late
    faults["of another layout, or of no human size"] += capture.refused
    latencies = 1000.0 * np.array(watched.latencies or [np.nan])
    return {
        "source": source.name,
        "format": source.format if isinstance(source, Replay) else None,
        "layout": None if reading is None else reading.layout.name,
        "up": None if reading is None else reading.up,
        "unit": None if reading is None else reading.unit,
        "steps": watched.steps,
        "frames": capture.frames,
        "frames_of": source.count if isinstance(source, Replay) else None,
        "thinned": capture.window.thinned,
        "people": session.performer.people,
        "lost": session.performer.lost,
        "followed": watched.followed,
        "upright": watched.upright,
        "falls": session.falls,
        "swapped": capture.sides.swaps,
        "reversed": capture.sides.reversals,
        "latency_ms": None
        if not watched.latencies
        else {
            "median": round(float(np.median(latencies)), 1),
            "p99": round(float(np.quantile(latencies, 0.99)), 1),
        },
        "on_time": round(clock.on_time, 5),
        "faults": {name: count for name, count in faults.items() if count},
        # Of a reference that stands, R² and speed are undefined.
        "score": None if score is None else score.to_json(),
        "recording": None if recorded is None else str(recorded),
    }
