"""The acquisition flow of the paper's Fig. 3, run over a recorded stream instead of a live device.

start -> waiting for a subject -> tracking: the joints of each frame, and whether all are there -> subject
lost -> tracking again … -> end. What lies between two losses is a pass; nothing may reach across its ends.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Mask
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import MISSING
from kinemimic.pipeline.kinematics.spans import runs

# A pass ends where the clock jumps, or where for longer than ABSENT nobody is seen (seconds).
CLOCK_GAP = 0.5
MAX_ABSENCE = 0.2
MIN_PASS_DURATION = 0.5
# Nobody has ever run faster than 12.4 m/s; a body that does, and a step beyond the sensor's noise, is
# another body.
TOP_SPEED = 12.5
JUMP_NOISE = 0.1


class State(StrEnum):
    """States of the acquisition."""

    START = "start"
    WAITING = "waiting for a subject"
    TRACKING = "tracking"
    LOST = "subject lost"
    END = "end"


@dataclass(frozen=True)
class Event:
    """A change of state at a frame (its index and time in seconds), and why."""

    frame: int
    time: float
    state: State
    reason: str


@dataclass(frozen=True)
class Acquisition:
    """passes: (T,) number of the pass or -1; complete: (T,) all joints there; events in the sequence of time.

    discarded: passes shorter than SHORTEST_PASS, whose frames belong to none.
    """

    passes: NDArray[np.int32]
    complete: Mask
    events: tuple[Event, ...]
    discarded: int

    @property
    def count(self) -> int:
        """Number of passes."""
        return int(self.passes.max(initial=-1)) + 1


def find_passes(clip: Clip) -> Acquisition:
    """Divide a capture into passes."""
    seen = clip.states != MISSING
    present = seen.any(axis=1) & ~_frozen_frames(clip)
    events = list(_state_machine(clip, present))
    passes = np.full(len(clip.times), -1, dtype=np.int32)
    count = discarded = 0
    for begin, end in pairwise(events):
        if begin.state is not State.TRACKING:
            continue
        last = end.frame
        while not present[last - 1]:
            last -= 1  # the frames in which the subject was waited for
        if clip.times[last - 1] - clip.times[begin.frame] < MIN_PASS_DURATION:
            discarded += 1
            continue
        passes[begin.frame : last] = count
        count += 1
    return Acquisition(passes, seen.all(axis=1) & present, tuple(events), discarded)


def with_passes(clip: Clip, acquisition: Acquisition) -> Clip:
    """The same frames, numbered by pass."""
    return replace(clip, passes=acquisition.passes)


def _state_machine(clip: Clip, present: Mask) -> Iterator[Event]:
    """The machine itself; the event of a loss stands at the first frame that is no longer the pass's."""
    times = clip.times
    jumps = _body_jumps(clip, present)
    yield Event(0, float(times[0]), State.START, "recording")
    state, last = State.WAITING, -1
    yield Event(0, float(times[0]), State.WAITING, "device open")
    for frame, time in enumerate(times.tolist()):
        if state is State.TRACKING:
            reason = ""
            if time - times[frame - 1] > CLOCK_GAP:
                reason = f"no frame for {time - times[frame - 1]:.2f} s"
            elif (last < frame - 1 or not present[frame]) and time - times[last] > MAX_ABSENCE + 1e-6:
                reason = f"nobody seen for more than {MAX_ABSENCE} s"
            elif jumps[frame]:
                reason = "the whole body jumped"
            if reason:
                state = State.LOST
                yield Event(frame, time, state, reason)
        if present[frame]:
            if state is not State.TRACKING:
                state = State.TRACKING
                yield Event(frame, time, state, "subject seen")
            last = frame
    yield Event(len(times), float(times[-1]), State.END, "end of the recording")


def _frozen_frames(clip: Clip) -> Mask:
    """Frames (T,) that repeat the pose before, bit for bit, in a run longer than ABSENT.

    Recorders of a format without a sign for "nobody" write the last pose until someone comes back.
    """
    p = clip.positions.reshape(len(clip.times), -1)
    same = np.concatenate([[False], ((p[1:] == p[:-1]) | (np.isnan(p[1:]) & np.isnan(p[:-1]))).all(axis=1)])
    frozen = np.zeros(len(p), dtype=np.bool_)
    for repeated in runs(same):
        if clip.times[repeated.stop - 1] - clip.times[repeated.start - 1] > MAX_ABSENCE:
            frozen[repeated] = True
    if len(p) > 1 and frozen[1:].all():
        frozen[0] = True  # a pose that never moves was never a person
    return frozen


def _body_jumps(clip: Clip, present: Mask) -> Mask:
    """Frames (T,) to which most joints came, from the last frame with a subject, faster than a human can."""
    jumps = np.zeros(len(present), dtype=np.bool_)
    frames = np.flatnonzero(present)
    step = np.linalg.norm(np.diff(clip.positions[frames], axis=0), axis=-1)
    step[np.isnan(step)] = -1.0
    count = (step >= 0).sum(axis=1)
    # The median over the joints that both frames have: those without sort to the front.
    middle = step.shape[1] - 1 - count // 2
    median = np.take_along_axis(np.sort(step, axis=1), np.maximum(middle, 0)[:, None], axis=1)[:, 0]
    limit = TOP_SPEED * np.diff(clip.times[frames]) + JUMP_NOISE
    jumps[frames[1:]] = (count > 0) & (median > limit)
    return jumps
