"""A live capture from frames to cleaned positions: recognised, put on its sides, smoothed, evenly timed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.live.frame import CapturedFrame
from kinemimic.pipeline.live.playout import Playout
from kinemimic.pipeline.live.recogniser import NEEDED, Reading, Recogniser
from kinemimic.pipeline.live.sides import Sides
from kinemimic.pipeline.live.window import MIN_STEP, WINDOW, Window
from kinemimic.pipeline.locomotion.leg_pose import leg_bones

LAG = 0.15  # s
# Seconds without a frame, after which nothing is known about the person's sides, nor about the sender:
# another may have taken its place.
FORGET = 0.5
_PENDING = 64  # frames kept until the sender is recognised
# Frames in a row that are too far apart, or too close, before the unit of their times is in doubt.
_APART, _CLOSE = 10, 40
_LONGEST_PAUSE = 60.0  # s after which a sender is another one
# Shares of the leg's length, between which those of later frames are; frames in a row beyond it, before the
# sender is recognised anew.
_LEGS, _ODD = (0.5, 1.7), 10
_SAME = 10  # frames in a row of one time, before that is said


@dataclass(frozen=True)
class Moment:
    """What a live capture shows at one moment.

    time: s on the sender's clock; positions: (M, 20, 3) metres, Z up, at even steps around it, NaN where
    missing; now: the row of the moment; lag: s by which the newest frame is later; raw: (20, 3) of the newest
    frame as it came.
    """

    time: float
    positions: Array
    now: int
    lag: float
    raw: Array

    @property
    def shows_person(self) -> bool:
        """Whether both legs and the trunk are there."""
        p = self.positions[self.now]
        return bool(np.isfinite(p[NEEDED]).all())


class LiveCapture:
    """Takes frames as they come, and gives a moment at every `step` seconds.

    lag: seconds between the newest frame and the moment; reading: of the last sender that was recognised;
    frames, refused, late, thinned: numbers of frames that were used, that did not fit the sender's others or
    their times, that came after a later one, and that were too close to the one before; complaint: what is
    wrong with what comes now, "" if nothing; last_fault: why the last frame was refused; quiet: s since a
    frame that fitted and was later than all before; senders: number of times that a sender began.
    """

    def __init__(self, *, step: float, lag: float = LAG, up: str | None = None) -> None:
        self.frames = self.refused = self.late = self.thinned = self.senders = 0
        self.complaint = self.last_fault = ""
        self.quiet = 0.0
        self.reading: Reading | None = None
        self.recogniser, self.sides, self.window = Recogniser(up), Sides(), Window()
        self.playout = Playout(lag, step)
        self._step, self._up = step, up
        self._pending: list[CapturedFrame] = []
        self._raw = np.full((20, 3), np.nan)
        self._newest: CapturedFrame | None = None
        self._stray: CapturedFrame | None = None
        self._apart = self._close = self._same = self._odd = 0

    def take(self, frame: CapturedFrame) -> None:
        """Add a frame; KinemimicError for one that the sender's others contradict.

        A frame whose time is far from the others' waits for the next one, which shows whether the clock has
        jumped or this one time is wrong.
        """
        stray, self._stray = self._stray, None
        try:
            if stray is not None and self._is_near(frame):
                self.refused += 1
                self.last_fault = f"expected a time near {frame.time:.6g} s, found {stray.time:.6g} s"
            elif stray is not None:
                self._accept(stray)
        finally:
            if self._jumps(frame):
                self._stray = frame
            else:
                self._accept(frame)

    def _is_near(self, frame: CapturedFrame) -> bool:
        """Whether a frame's time is near that of the newest frame, if there is one."""
        last = self._newest
        return last is not None and last.time - WINDOW < frame.time <= last.time + FORGET

    def _jumps(self, frame: CapturedFrame) -> bool:
        """Whether a sender that has not been silent sends a time far from the one before."""
        last = self._newest
        if last is None or len(frame.positions) != len(last.positions):
            return False
        return self.quiet <= FORGET and not self._is_near(frame)

    def _accept(self, frame: CapturedFrame) -> None:
        gap = 0.0 if self._newest is None else frame.time - self._newest.time
        try:
            if self._begins(frame):
                self._begin(self.reading if self._goes_on(frame) else None)
            known = self.recogniser.take(frame)
        except KinemimicError as error:
            self.refused += 1
            self.complaint = self.last_fault = str(error)
            raise
        if self._newest is None or gap > 0.0:
            self._newest = frame
            self.quiet = 0.0
        self._same = self._same + 1 if gap == 0.0 else 0
        self._apart = self._apart + 1 if gap > FORGET else 0
        self._take(frame, known=known)
        if known:
            self.complaint = ""
        if self._apart >= _APART or (self._close >= _CLOSE and gap > 0.0):
            self.complaint = f"expected times in seconds, found frames {gap:.3g} s apart"
        if self._same >= _SAME:
            self.complaint = f"expected a later time in every frame, found {frame.time:.6g} s again and again"

    def _take(self, frame: CapturedFrame, *, known: bool) -> None:
        """Add a frame as soon as it is known how it is to be read."""
        self._pending = [*self._pending, frame][-_PENDING:]
        if not known:
            return
        self.reading = self.recogniser.reading
        pending, self._pending = self._pending, []
        for one in pending:
            self._add(one)

    def _begins(self, frame: CapturedFrame) -> bool:
        """Whether a frame is the first, of a sender that comes back, or of another."""
        last = self._newest
        if last is None:
            return True
        if len(frame.positions) != len(last.positions):
            return self.quiet > FORGET
        if frame.time <= last.time and self.quiet > FORGET:
            return True
        # A sender that was started again counts from the beginning.
        return not self._is_near(frame)

    def _goes_on(self, frame: CapturedFrame) -> bool:
        """Whether a frame is probably from the same sender after a pause: its clock goes on."""
        last = self._newest
        if last is None or len(frame.positions) != len(last.positions):
            return False
        return last.time < frame.time <= last.time + _LONGEST_PAUSE

    def _begin(self, before: Reading | None) -> None:
        self.senders += 1
        self.recogniser, self.sides = Recogniser(self._up, before), Sides(self.sides)
        self._odd = 0
        self.window.clear()
        self._pending.clear()
        self._newest = None

    def _add(self, frame: CapturedFrame) -> None:
        reading, newest = self.reading, self.window.newest
        if reading is None:
            return
        if newest is not None and frame.time <= newest:
            self.late += 1
            return
        if newest is not None and frame.time < newest + MIN_STEP:
            self.thinned += 1
            self._close += 1
            return
        positions, states = reading.nodes(frame)
        if self._is_odd(positions, reading):
            return
        positions, states = self.sides.restored(frame.time, positions, states)
        if self.sides.turned:
            # What was left is right now.
            self.window.clear()
        self.window.add(frame.time, positions, states)
        self._close = 0
        self.frames += 1
        self._raw = positions

    def _is_odd(self, positions: Array, reading: Reading) -> bool:
        """Whether the legs in positions (20, 3) are not a person's of before; after many such frames, the
        sender is recognised anew."""
        leg = 0.5 * float(leg_bones(positions[None]).sum())
        if not np.isfinite(leg) or _LEGS[0] * reading.leg < leg < _LEGS[1] * reading.leg:
            self._odd = 0
            return False
        self._odd += 1
        if self._odd >= _ODD:
            self._newest = None  # the next frame begins
        return True

    def advance(self) -> Moment | None:
        """The next moment; None while nobody sends."""
        self.quiet += self._step
        newest = self.window.newest
        due = self.playout.advance(newest)
        if due is None or newest is None:
            return None
        ahead = int((newest - due) / self._step + 1e-6)
        behind = round((WINDOW - self.playout.lag) / self._step)
        times: Array = due + self._step * np.arange(-behind, ahead + 1, dtype=np.float64)
        return Moment(due, self.window.at(times), behind, newest - due, self._raw)
