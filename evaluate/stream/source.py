"""Where frames come from, and what a sender may do at most.

A source is asked before every control step and never waits. Of what came since the last step, the newest
MAX_FRAMES frames count; the rest is dropped unread.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Protocol

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.live.frame import MAX_LINE, CapturedFrame, decoded_frame

HOST = "127.0.0.1"
MAX_FRAMES = 8  # in a control step: 240 frames a second
MAX_READS = 256  # datagrams in a control step
MAX_BLOCKS = 16  # of a stream of lines
BLOCK = 65_536  # bytes


class Source(Protocol):
    """name: for people; faults: how often what happened; waits: whether it can wait through a pause, as
    a file can and a sensor cannot."""

    name: str
    faults: Counter[str]
    waits: bool

    def poll(self, elapsed: float) -> Sequence[CapturedFrame]:
        """What came until now, `elapsed` seconds after the first poll."""

    @property
    def ended(self) -> bool:
        """Whether nothing more will come."""

    def close(self) -> None:
        """Free what is held."""


def frames_of(lines: Sequence[bytes], faults: Counter[str]) -> list[CapturedFrame]:
    """The frames of the newest lines; faults are counted."""
    if (dropped := len(lines) - MAX_FRAMES) > 0:
        faults["dropped: too many at once"] += dropped
    found = []
    for line in lines[-MAX_FRAMES:]:
        try:
            found.append(decoded_frame(line))
        except KinemimicError as error:
            faults[_kind(str(error))] += 1
    return found


def _kind(message: str) -> str:
    """A message without the numbers and names of one frame, so that a sender cannot fill the memory."""
    if message.startswith("expected a line"):
        return "refused: line too long"
    return "refused: no frame in JSON" if "in JSON" in message else "refused: lists that do not fit together"


class Lines:
    """Bytes to lines, within bounds."""

    def __init__(self, faults: Counter[str]) -> None:
        self._rest, self._faults = b"", faults
        self._skipping = False

    def take(self, block: bytes) -> list[bytes]:
        """The lines that a block completes."""
        *lines, self._rest = (self._rest + block).split(b"\n")
        if self._skipping and lines:
            self._skipping = False
            del lines[0]
        if len(self._rest) > MAX_LINE:
            if not self._skipping:
                self._faults["refused: line too long"] += 1
            self._rest, self._skipping = b"", True
        return [line for line in lines if line.strip()]

    def end(self) -> list[bytes]:
        """The last line, if no newline has completed it."""
        last, self._rest = self._rest, b""
        return [last] if last.strip() and not self._skipping else []
