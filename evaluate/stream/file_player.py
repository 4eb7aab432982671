"""A capture file on the page: it waits for the first viewer, and can be played again."""

from __future__ import annotations

from collections.abc import Callable

from kinemimic.evaluate.simulate.loop import Loop
from kinemimic.evaluate.stream.files import CaptureFile
from kinemimic.evaluate.stream.watched import Watched

END = "end of the file; Restart plays it again"
Viewers = Callable[[], int]


class FilePlayer:
    """Plays a file when the first viewer opens the page, and again on request.

    Otherwise it would be over before the page is open. viewers: number of viewers; tail: control steps that
    are performed after its last frame.
    """

    def __init__(
        self, loop: Loop, source: CaptureFile, watched: Watched, viewers: Viewers, tail: int
    ) -> None:
        self._loop, self._source, self._watched = loop, source, watched
        self._viewers, self._tail = viewers, tail
        self._left: int | None = None  # control steps until the end; None before the first viewer
        self._restarts = 0
        loop.paused = True

    def beat(self) -> bool:
        """Follow a beat of the loop; returns False, because the loop is not to end."""
        loop, asked = self._loop, self._asked()
        if self._left is None:
            if self._viewers() or not loop.paused:
                self._play()
        elif self._left <= 0:
            if asked or not loop.paused:
                self._source.rewind()
                self._play()
        elif self._source.ended and not loop.paused:
            self._left -= 1
            if self._left == 0:
                loop.paused, self._watched.notice = True, END
                self._watched.tell(END)
        return False

    def _play(self) -> None:
        self._loop.paused, self._left, self._watched.notice = False, self._tail, ""

    def _asked(self) -> bool:
        """Whether somebody has pressed Restart."""
        session = self._watched.session
        before, self._restarts = self._restarts, 0 if session is None else session.restarts
        return self._restarts > before
