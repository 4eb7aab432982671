"""What the loop needs of a page, with counts for the summary."""

from __future__ import annotations

import queue
from collections import Counter
from dataclasses import replace

from kinemimic.evaluate.simulate.loop import PageView
from kinemimic.evaluate.simulate.page.requests import Request
from kinemimic.evaluate.simulate.session.frame import Frame, Status
from kinemimic.evaluate.simulate.session.inputs import Input
from kinemimic.evaluate.simulate.session.live_session import LiveSession
from kinemimic.evaluate.stream.source import Source
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.live.recogniser import Reading
from kinemimic.pipeline.plural import plural

_KEPT = 18_000  # control steps whose latencies the summary has: ten minutes


class NoPage:
    """A page without viewers: every method does nothing."""

    def __init__(self) -> None:
        self.waiting: queue.Queue[Input | Request] = queue.Queue()

    def draw(self, frame: Frame) -> None:
        """Nobody looks."""

    def show(self, frame: Frame, status: Status) -> None:
        """Nobody looks."""

    def tell(self, error: KinemimicError | str) -> None:
        """Nobody listens."""


class Watched:
    """A page whose frames are counted for the summary, over all sessions: a recording begins one.

    latencies: s, of the first ten minutes; steps: control steps; followed: those that follow a person;
    upright: those of `followed` without a fall; session: the running one; notice: a line for the page.
    """

    def __init__(self, page: PageView, source: Source) -> None:
        self.waiting, self._page, self._source = page.waiting, page, source
        self.latencies: list[float] = []
        self.steps = self.followed = self.upright = 0
        self.session: LiveSession | None = None
        self.reading: Reading | None = None
        self.notice = ""
        self._before: Counter[str] = Counter()
        self._counted = 0  # the last control step of the session that was counted

    def begin(self, session: LiveSession) -> None:
        """Another session begins; of the one before, only numbers are kept."""
        self._before, self.reading = self.counts(), self.known_reading()
        self.session, self._counted = session, 0

    def counts(self) -> Counter[str]:
        """What was counted in all sessions."""
        if (session := self.session) is None:
            return Counter()
        capture, people = session.capture, session.performer
        return self._before + Counter(
            frames=capture.frames, late=capture.late, thinned=capture.thinned, refused=capture.refused,
            people=people.people, lost=people.lost, falls=session.falls, swapped=capture.sides.swaps,
            reversed=capture.sides.reversals, skipped=capture.playout.skips,
        )  # fmt: skip

    def known_reading(self) -> Reading | None:
        """How the last sender was read."""
        return (self.session and self.session.capture.reading) or self.reading

    def fault(self) -> str:
        """What was wrong with what came last and was not used, "" if nothing."""
        found = [self._source.faults.last]
        if self.session is not None:
            found += [self.session.capture.complaint, self.session.capture.last_fault]
        return next(filter(None, found), "")

    def words(self) -> str:
        """The state in a line."""
        counts, shown = self.counts(), None if self.session is None else self.session.shown
        behind = "" if shown is None or shown.starved else f", {1000.0 * shown.latency:.0f} ms behind"
        refused = counts["refused"] + self._source.faults.refused
        return f"{plural(counts['frames'], 'frame')}, {refused} refused{_in_brackets(self.fault())}{behind}"

    def draw(self, frame: Frame) -> None:
        """Count a frame and show it; a paused page draws one again."""
        if frame.step > self._counted:
            self._counted = frame.step
            self._count(frame)
        self._page.draw(frame)

    def _count(self, frame: Frame) -> None:
        self.steps += 1
        if frame.shown is not None and frame.shown.follows:
            self.followed += 1
            self.upright += not frame.fallen
            if len(self.latencies) < _KEPT:
                self.latencies.append(frame.shown.latency)

    def show(self, frame: Frame, status: Status) -> None:
        """Show numbers."""
        faults = self._source.faults
        refused = f"unreadable: {faults.refused}{_in_brackets(faults.last)}" if faults.refused else ""
        text = "\n\n".join(filter(None, (self.notice, status.text, refused)))
        self._page.show(frame, replace(status, text=text))

    def tell(self, error: KinemimicError | str) -> None:
        """Pass on a message."""
        self._page.tell(error)


def _in_brackets(fault: str) -> str:
    return f" (last: {fault})" if fault else ""
