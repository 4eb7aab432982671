"""A live capture from frames to cleaned positions: recognised, put on its sides, smoothed, evenly timed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.live.frame import CapturedFrame
from kinemimic.pipeline.live.playout import Playout
from kinemimic.pipeline.live.recogniser import Recogniser
from kinemimic.pipeline.live.sides import Sides
from kinemimic.pipeline.live.window import MIN_STEP, WINDOW, Window

LAG = 0.15  # s
FORGET = 0.5  # s without a frame, after which nothing is known about the person's sides
_PENDING = 64  # frames kept until the sender is recognised
_LEGS = [N[f"{joint}_{side}"] for side in ("left", "right") for joint in ("hip", "knee", "ankle")]


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
        return bool(np.isfinite(p[_LEGS]).all() and np.isfinite(p[N["shoulder_center"]]).all())


class LiveCapture:
    """Takes frames as they come, and gives a moment at every `step` seconds.

    lag: seconds between the newest frame and the moment; frames, refused: numbers of frames that were used,
    and that did not fit the sender's others.
    """

    def __init__(self, *, step: float, lag: float = LAG, up: str | None = None) -> None:
        self.frames = self.refused = 0
        self.recogniser, self.sides, self.window = Recogniser(up), Sides(), Window()
        self.playout = Playout(lag, step)
        self._step = step
        self._pending: list[CapturedFrame] = []
        self._raw = np.full((20, 3), np.nan)

    def take(self, frame: CapturedFrame) -> None:
        """Add a frame; KinemimicError for one that the sender's others contradict."""
        try:
            known = self.recogniser.take(frame)
        except KinemimicError:
            self.refused += 1
            raise
        self._pending = [*self._pending, frame][-_PENDING:]
        if not known:
            return
        pending, self._pending = self._pending, []
        for one in pending:
            self._add(one)

    def _add(self, frame: CapturedFrame) -> None:
        reading = self.recogniser.reading
        if reading is None:
            return
        newest = self.window.newest
        if newest is not None and frame.time <= newest:
            self.window.late += 1
            # A sender that was started again counts from the beginning.
            if frame.time > newest - WINDOW:
                return
            self.window.clear()
        elif newest is not None and frame.time - newest < MIN_STEP:
            self.window.thinned += 1
            return
        if newest is None or not newest < frame.time < newest + FORGET:
            self.sides = Sides(self.sides)
        positions, states = self.sides.restored(frame.time, *reading.nodes(frame))
        if self.sides.turned:
            # What was left is right now.
            self.window.clear()
        if self.window.add(frame.time, positions, states):
            self.frames += 1
            self._raw = positions

    def advance(self) -> Moment | None:
        """The next moment; None while nobody sends."""
        newest = self.window.newest
        due = self.playout.advance(newest)
        if due is None or newest is None:
            return None
        ahead = int((newest - due) / self._step + 1e-6)
        behind = round((WINDOW - self.playout.lag) / self._step)
        times: Array = due + self._step * np.arange(-behind, ahead + 1, dtype=np.float64)
        return Moment(due, self.window.at(times), behind, newest - due, self._raw)
