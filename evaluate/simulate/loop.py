"""The loop of an interactive simulation: inputs, control steps, pictures, the recording."""

from __future__ import annotations

import queue
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from kinemimic.evaluate.simulate.clock import Clock
from kinemimic.evaluate.simulate.page.requests import (
    Choose,
    Redraw,
    Request,
    SetSpeed,
    StepOnce,
    TogglePause,
    ToggleRecording,
)
from kinemimic.evaluate.simulate.session.frame import Frame, Status
from kinemimic.evaluate.simulate.session.inputs import Carry, Drag, Enter, Ground, Input, checked, finite
from kinemimic.evaluate.simulate.session.recording import Recorder, next_folder, replay_command
from kinemimic.evaluate.simulate.session.session import Session
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.live.frame import CapturedFrame
from kinemimic.pipeline.parallel.interruption import deferred
from kinemimic.pipeline.plural import plural
from kinemimic.train.sim.world import CONTROL_RATE

SLOWEST = 0.05  # share of real time
SHOW_INTERVAL = 6  # control steps between two updates of numbers and curves


class PageView(Protocol):
    """What the loop needs of a page."""

    waiting: queue.Queue[Input | Request]

    def draw(self, frame: Frame) -> None: ...

    def show(self, frame: Frame, status: Status) -> None: ...

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

    Ground, carried weights and scenario stay as they were set when another session is opened, for a recording
    or with another policy.
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
        self._lasting: dict[tuple[type, str], Input] = {}
        self._altered = False  # whether the picture is out of date
        self._idle = 0  # beats without a control step

    def run(
        self,
        steps: int | None = None,
        ended: Callable[[], bool] | None = None,
        tail: int = 0,
        *,
        seconds: float | None = None,
    ) -> None:
        """Run for a number of beats of the clock, None without end, for `seconds` of real time, or until
        `tail` control steps after `ended`.

        Ctrl-C, SIGTERM or SIGHUP raises KeyboardInterrupt after the control step, a second one at once.
        """
        beats, left = 0, None
        self._clock.restart()
        end = None if seconds is None else time.monotonic() + seconds
        # The recording of half a control step could not be replayed.
        with deferred() as interruption:
            try:
                while (
                    (steps is None or beats < steps)
                    and (end is None or time.monotonic() < end)
                    and left != 0
                    and not interruption.asked
                ):
                    self._clock.wait()
                    advanced = self.beat()
                    beats += 1
                    if left is not None:
                        left -= advanced
                    elif ended is not None and ended():
                        left = tail
            finally:
                try:
                    self._end_recording()
                finally:
                    self.session.close()
        if interruption.asked:
            raise KeyboardInterrupt

    def beat(self) -> bool:
        """Take the inputs, and do a control step unless the session is paused; whether one was done."""
        asked = self._take_inputs()
        still = self.paused and not self._steps_asked
        sent: Sequence[CapturedFrame] = []
        if self._frames is not None and not (still and self._waits):
            sent = self._frames(self._beats / CONTROL_RATE)
            self._beats += 1
        if still:
            self._rest(asked=asked)
            return False
        self._steps_asked = max(0, self._steps_asked - 1)
        self._take_frames(sent)
        frame = self._frame = self.session.advance()
        self._altered = False
        self._write(lambda recorder: recorder.advanced(self.session))
        if self.recorder is not None and self.recorder.full:
            self._end_recording()
        self._page.draw(frame)
        if frame.step % SHOW_INTERVAL == 0 or self.paused:
            self._page.show(frame, self._status())
        return True

    def _rest(self, *, asked: bool) -> None:
        """A beat without a control step; asked: whether there were inputs."""
        self._idle += 1
        if self._altered:
            self._frame = self.session.look()
            self._altered = False
            self._page.draw(self._frame)
        if self._frame is not None and (asked or self._idle % CONTROL_RATE == 0):
            self._page.show(self._frame, self._status())

    def _take_inputs(self) -> bool:
        """Take the waiting inputs and requests; whether there were any."""
        events: list[Input | Request] = []
        while True:
            try:
                events.append(self._page.waiting.get_nowait())
            except queue.Empty:
                break
        for k, event in enumerate(events):
            # Of several drags before one control step, only the last has an effect.
            if isinstance(event, Drag) and any(isinstance(later, Drag) for later in events[k + 1 :]):
                continue
            try:
                self._take(event)
            except KinemimicError as error:
                self._page.tell(error)
        return bool(events)

    def _take_frames(self, sent: Sequence[CapturedFrame]) -> None:
        """Frames of a live capture."""
        for frame in sent:
            self._record_input(frame)
            self.session.apply(frame)

    def _take(self, event: Input | Request) -> None:
        if isinstance(event, TogglePause):
            self.paused = not self.paused
        elif isinstance(event, StepOnce):
            self.paused, self._steps_asked = True, self._steps_asked + 1
        elif isinstance(event, SetSpeed):
            if finite(event.share):
                self._clock.speed = min(max(event.share, SLOWEST), 1.0)
        elif isinstance(event, Redraw):
            self._altered = True
        elif isinstance(event, ToggleRecording):
            self._end_recording() if self.recorder is not None else self.record()
        elif isinstance(event, Choose):
            self._change(event)
        else:
            self._apply(event)

    def _apply(self, event: Input) -> None:
        event = checked(event)
        self.session.apply(event)
        self._record_input(event)
        if isinstance(event, Ground | Carry | Enter):
            key = (type(event), event.body if isinstance(event, Carry) else "")
            self._lasting.pop(key, None)  # so that the latest is the last
            if not (isinstance(event, Enter) and not event.scenario):
                self._lasting[key] = event
        # A drag is sent again with every picture.
        self._altered |= not isinstance(event, Drag)

    def _change(self, wanted: Choose) -> None:
        performed = self._choose(wanted.policy, wanted.motion, wanted.speed)
        session = self._open(performed)
        self._end_recording()
        self._performed = performed
        self._begin(session)

    def record(self) -> None:
        """A recording starts with a session of its own, in its first state."""
        session = self._open(self._performed)
        folder = next_folder(self._recordings)
        try:
            self.recorder = Recorder(
                folder, self._performed.run, self._engine, restart=session.restart,
                speed=self._performed.speed, live=session.live,
            )  # fmt: skip
        except OSError as error:
            session.close()
            raise KinemimicError(f"cannot record: {error}") from None
        self.recorded.append(folder)
        self._page.tell(f"recording into {folder}")
        self._begin(session)

    def _begin(self, session: Session) -> None:
        """Continue with another session, with ground, carried weights and scenario as they were set."""
        self.session.close()
        self.session, self._altered = session, True
        for event in list(self._lasting.values()):
            try:
                self._apply(event)
            except KinemimicError as error:  # a scenario that this motion has no place for
                self._lasting.pop((type(event), getattr(event, "body", "")))
                self._page.tell(error)
        self._clock.restart()

    def _record_input(self, event: Input | CapturedFrame) -> None:
        step = self.session.step_count
        self._write(lambda recorder: recorder.input(step, event))

    def _write(self, write: Callable[[Recorder], None]) -> None:
        """Write to the recording, if there is one; one that cannot be written ends."""
        if self.recorder is None:
            return
        try:
            write(self.recorder)
        except OSError as error:
            self._page.tell(f"{self.recorder.folder} ends here: {error}")
            self.recorder = None

    def _end_recording(self) -> None:
        self._write(lambda recorder: recorder.close(self.session))
        if self.recorder is not None:
            self._page.tell(f"recorded: {replay_command(self.recorder.folder)}")
            self.recorder = None

    def _status(self) -> Status:
        performed, session = self._performed, self.session
        doing = "paused" if self.paused else "fallen" if self._frame and self._frame.fallen else "upright"
        lines = [
            f"**{performed.policy}** performs **{performed.motion}**: {doing}, "
            f"{plural(session.falls, 'fall')}, {session.step_count / CONTROL_RATE:.0f} s",
            str(session.score() or "score: after the first second"),
            f"{100.0 * self._clock.lately_on_time:.1f} % of steps on time",
            *session.words(),
        ]
        if self.recorder is not None:
            lines.insert(0, f"● recording into `{self.recorder.folder}`")
        elif self.recorded:
            lines.append(f"recorded: `{replay_command(self.recorded[-1])}`")
        return Status("\n\n".join(lines), self.paused, self.recorder is not None)
