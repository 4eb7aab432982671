"""Sources of frames, and the limits on what a sender may send.

A source is asked before every control step and never waits. Of what a socket received since the last step,
the newest MAX_FRAMES frames count, the others are dropped; a pipe and a file keep them for the next step.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Protocol

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.live.frame import MAX_LINE, CapturedFrame, decoded_frame

HOST = "127.0.0.1"
MAX_FRAMES = 8  # in a control step: 240 frames a second
MAX_READS = 512  # datagrams in a control step
MAX_BLOCKS = 16  # of a stream of lines
BLOCK = 65_536  # bytes
MAX_FAULT = 200  # characters of a message
DROPPED = "dropped: too many at once"
REFUSED = "refused: "  # begins the names of faults of what cannot be read


class Faults(Counter[str]):
    """Number of faults of each kind; last: the last message to the sender, at most MAX_FAULT characters."""

    last: str = ""

    def note(self, kind: str, message: str = "") -> None:
        """Count a fault."""
        self[kind] += 1
        self.last = " ".join((message or kind.removeprefix(REFUSED)).split())[:MAX_FAULT]

    @property
    def refused(self) -> int:
        """Number of messages that could not be read."""
        return sum(count for kind, count in self.items() if kind.startswith(REFUSED))


class Source(Protocol):
    """name: for messages; faults: number of faults of each kind; waits: whether the source can wait during a
    pause, as a file can and a sensor cannot."""

    name: str
    faults: Faults
    waits: bool

    def poll(self, elapsed: float) -> Sequence[CapturedFrame]:
        """The frames that have arrived since the last poll; elapsed: seconds since the first one."""

    @property
    def ended(self) -> bool:
        """Whether nothing more will come."""

    def close(self) -> None:
        """Close sockets and files."""


def frames_of(lines: Sequence[bytes], faults: Faults) -> list[CapturedFrame]:
    """The frames of the newest lines; faults are counted."""
    if (dropped := len(lines) - MAX_FRAMES) > 0:
        faults[DROPPED] += dropped
    found = []
    for line in lines[-MAX_FRAMES:]:
        try:
            found.append(decoded_frame(line))
        except KinemimicError as error:
            faults.note(_kind(str(error)), str(error))
    return found


def _kind(message: str) -> str:
    """A message without the numbers and names of one frame, so that a sender cannot fill the memory."""
    if message.startswith("expected a line"):
        return "refused: line too long"
    return "refused: no frame in JSON" if "in JSON" in message else "refused: lists that do not fit together"


class Lines:
    """Bytes to lines, within bounds."""

    def __init__(self, faults: Faults) -> None:
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
                self._faults.note("refused: line too long", f"a line of more than {MAX_LINE:,} bytes")
            self._rest, self._skipping = b"", True
        return [line for line in lines if line.strip()]

    def end(self) -> list[bytes]:
        """The last line, if no newline has completed it."""
        last, self._rest = self._rest, b""
        return [last] if last.strip() and not self._skipping else []
