"""Frames from standard input, and from a capture file at its own clock."""

from __future__ import annotations

import os
import select
from collections import deque
from collections.abc import Sequence
from pathlib import Path

from kinemimic.evaluate.stream.source import BLOCK, MAX_BLOCKS, MAX_FRAMES, Faults, Lines, frames_of
from kinemimic.pipeline.convert import on_nodes
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.live.frame import CapturedFrame, frame_of
from kinemimic.pipeline.readers.recognise import read


class Stdin:
    """Lines of a pipe, as soon as they come. A writer of more than MAX_FRAMES in a control step waits, as at
    every pipe."""

    waits = False  # a sensor may write it

    def __init__(self, descriptor: int = 0) -> None:
        self.name = "standard input"
        self.faults = Faults()
        self._over = False
        self._descriptor, self._lines = descriptor, Lines(self.faults)
        self._waiting: deque[bytes] = deque()

    def poll(self, elapsed: float) -> Sequence[CapturedFrame]:
        for _ in range(MAX_BLOCKS):
            if self._over or len(self._waiting) >= MAX_FRAMES:
                break
            if not select.select([self._descriptor], [], [], 0.0)[0]:
                break
            block = os.read(self._descriptor, BLOCK)
            self._over = not block
            self._waiting.extend(self._lines.take(block) if block else self._lines.end())
        count = min(MAX_FRAMES, len(self._waiting))
        return frames_of([self._waiting.popleft() for _ in range(count)], self.faults)

    @property
    def ended(self) -> bool:
        return self._over and not self._waiting

    def close(self) -> None:
        """Nothing is held."""


class CaptureFile:
    """A capture in any format that can be read, as recorded: no rule has repaired it, no filter cleaned it.

    It begins with the first poll. seconds: its duration; format: of the file; count: of its frames, again for
    every time that it is played.
    """

    waits = True

    def __init__(self, path: Path) -> None:
        clip = on_nodes(read(path))
        if len(clip.times) < 2:
            raise CaptureError(path, expected="at least 2 frames to replay", found=f"{len(clip.times)}")
        self.name, self.format, self.count = path.name, str(clip.provenance["format"]), len(clip.times)
        self.faults = Faults()
        self._times = clip.times - clip.times[0]
        self._clip, self._next = clip, 0
        self._began: float | None = None
        self.seconds = float(self._times[-1])

    def poll(self, elapsed: float) -> Sequence[CapturedFrame]:
        found = []
        if self._began is None:
            self._began = elapsed
        while not self.ended and self._began + self._times[self._next] <= elapsed + 1e-9:
            k = self._next
            # A clock that goes on when the file is played again: no frame is late.
            time = self._began + float(self._times[k])
            found.append(frame_of(time, self._clip.positions[k], self._clip.states[k]))
            self._next += 1
        return found

    def rewind(self) -> None:
        """Play it from the beginning."""
        self._next, self._began = 0, None
        self.count += len(self._times)

    @property
    def ended(self) -> bool:
        return self._next >= len(self._times)

    def close(self) -> None:
        """Nothing is held."""
