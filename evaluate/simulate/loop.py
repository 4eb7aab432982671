"""The loop of an interactive simulation: inputs, control steps, pictures, the recording."""

from __future__ import annotations

import queue
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from kinemimic.evaluate.simulate.clock import Clock
from kinemimic.evaluate.simulate.frame import Frame
from kinemimic.evaluate.simulate.inputs import Drag, Input, checked
from kinemimic.evaluate.simulate.recording import Recorder, next_folder
from kinemimic.evaluate.simulate.session import Session
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.live.frame import CapturedFrame
from kinemimic.pipeline.plural import plural
from kinemimic.train.sim.world import CONTROL_RATE

SHOW_INTERVAL = 6  # control steps between two updates of numbers and curves


class PageView(Protocol):
    """What the loop needs of a page."""

    waiting: queue.Queue[Any]

    def draw(self, frame: Frame) -> None: ...

    def show(self, frame: Frame, state: str) -> None: ...

    def tell(self, error: KinemimicError | str) -> None: ...


@dataclass(frozen=True)
class Performance:
    """What is performed: the run folder with motion and policy, their names, the motion's speed."""

    run: Path
    policy: str
    motion: str
    speed: float = 1.0


class Loop:
    """Runs a session.

    open_session: for what people choose; recordings: their folder; frames: what a live capture has sent until
    a time, in s since the loop began; waits: whether it can wait while the session is paused, as a file can;
    recorded: folders of the recordings.
    """

    def __init__(
        self,
        performed: Performance,
        page: PageView,
        clock: Clock,
        *,
        engine: str,
        open_session: Callable[[Performance], Session],
        choose: Callable[[str, str, float], Performance],
        recordings: Path,
        frames: Callable[[float], Sequence[CapturedFrame]] | None = None,
        waits: bool = False,
    ) -> None:
        self._performed, self._page, self._clock = performed, page, clock
        self._engine, self._open, self._choose = engine, open_session, choose
        self._recordings, self._frames, self._waits = recordings, frames, waits
        self.recorded: list[Path] = []
        self._beats = 0
        self.session = open_session(performed)
        self.recorder: Recorder | None = None
        self.paused = False
        self._steps_asked = 0
        self._frame: Frame | None = None

    def run(self, steps: int | None = None, ended: Callable[[], bool] | None = None, tail: int = 0) -> None:
        """Run for a number of beats of the clock, None without end, or until `tail` beats after `ended`."""
        beats = 0
        try:
            while steps is None or beats < steps:
                self._clock.wait()
                self.beat()
                beats += 1
                if ended is not None and ended():
                    steps, ended = min(steps or beats + tail, beats + tail), None
        finally:
            self._end_recording()
            self.session.close()

    def beat(self) -> None:
        """Take the inputs, and do a control step unless the session is paused."""
        self._take_inputs()
        still = self.paused and not self._steps_asked
        sent: Sequence[CapturedFrame] = []
        if self._frames is not None and not (still and self._waits):
            sent = self._frames(self._beats / CONTROL_RATE)
            self._beats += 1
        if still:
            if self._frame is not None:
                self._page.show(self._frame, self._state())
            return
        self._steps_asked = max(0, self._steps_asked - 1)
        self._take_frames(sent)
        frame = self._frame = self.session.advance()
        if self.recorder is not None:
            self.recorder.advanced(self.session)
            if self.recorder.full:
                self._end_recording()
        self._page.draw(frame)
        if frame.step % SHOW_INTERVAL == 0 or self.paused:
            self._page.show(frame, self._state())

    def _take_inputs(self) -> None:
        found: list[Any] = []
        while True:
            try:
                found.append(self._page.waiting.get_nowait())
            except queue.Empty:
                break
        for k, one in enumerate(found):
            # Of several drags before one control step, only the last has an effect.
            if isinstance(one, Drag) and any(isinstance(later, Drag) for later in found[k + 1 :]):
                continue
            try:
                self._take(one)
            except KinemimicError as error:
                self._page.tell(error)

    def _take_frames(self, sent: Sequence[CapturedFrame]) -> None:
        """Frames of a live capture."""
        for frame in sent:
            if self.recorder is not None:
                self.recorder.input(self.session.step_count, frame)
            self.session.apply(frame)

    def _take(self, one: Any) -> None:
        if not isinstance(one, tuple):
            self._apply(one)
            return
        name, arguments = one
        if name == "toggle":
            self.paused = not self.paused
        elif name == "step":
            self.paused, self._steps_asked = True, self._steps_asked + 1
        elif name == "speed":
            self._clock.speed = min(max(float(arguments[0]), 0.05), 1.0)
        elif name == "record":
            self._end_recording() if self.recorder is not None else self.record()
        else:
            self._change(*arguments)

    def _apply(self, found: Input) -> None:
        found = checked(found)
        self.session.apply(found)
        if self.recorder is not None:
            self.recorder.input(self.session.step_count, found)

    def _change(self, policy: str, motion: str, speed: float) -> None:
        performed = self._choose(policy, motion, speed)
        session = self._open(performed)
        self._end_recording()
        self.session.close()
        self.session, self._performed = session, performed

    def record(self) -> None:
        """A recording starts with a session of its own, in its first state."""
        session = self._open(self._performed)
        self.session.close()
        self.session = session
        folder = next_folder(self._recordings)
        self.recorder = Recorder(
            folder, self._performed.run, self._engine, restart=session.restart, speed=self._performed.speed,
            live=session.live,
        )  # fmt: skip
        self.recorded.append(folder)
        self._page.tell(f"recording into {folder}")

    def _end_recording(self) -> None:
        if self.recorder is not None:
            self.recorder.close(self.session)
            self._page.tell(f"recorded: kinemimic simulate --replay --run {self.recorder.folder}")
            self.recorder = None

    def _state(self) -> str:
        performed, session = self._performed, self.session
        doing = "paused" if self.paused else "fallen" if self._frame and self._frame.fallen else "upright"
        lines = [
            f"**{performed.policy}** performs **{performed.motion}**: {doing}, "
            f"{plural(session.falls, 'fall')}, {session.step_count / CONTROL_RATE:.0f} s",
            str(session.score() or "score: after the first second"),
            f"{100.0 * self._clock.on_time:.1f} % of steps on time",
            *session.words(),
        ]
        if self.recorder is not None:
            lines.insert(0, f"● recording into {self.recorder.folder}")
        return "\n\n".join(lines)
