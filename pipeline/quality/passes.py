"""Division of a capture into passes: the acquisition flow of the paper's Fig. 3, run over a recording.

start -> waiting for a subject -> tracking -> subject lost -> tracking … -> end. A pass is a stretch of
tracking between two losses; no later step may combine frames across its ends.
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

# Seconds. A pass ends at a jump of the clock longer than CLOCK_GAP, or if nobody is seen for MAX_ABSENCE.
CLOCK_GAP = 0.5
MAX_ABSENCE = 0.2
MIN_PASS_DURATION = 0.5
# m/s and metres. No human has run faster than 12.4 m/s: a body that moves faster, by more than the noise, is
# a different one.
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
    """A change of state: index and time (seconds) of its frame, and the reason."""

    frame: int
    time: float
    state: State
    reason: str


@dataclass(frozen=True)
class Acquisition:
    """The passes of a capture.

    passes: (T,) number of the pass or -1; complete: (T,) all joints seen; events: in order of time;
    discarded: number of passes shorter than MIN_PASS_DURATION, whose frames get -1.
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
    """The passes of a clip."""
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
            last -= 1  # drop the trailing frames without a subject
        if clip.times[last - 1] - clip.times[begin.frame] < MIN_PASS_DURATION:
            discarded += 1
            continue
        passes[begin.frame : last] = count
        count += 1
    return Acquisition(passes, seen.all(axis=1) & present, tuple(events), discarded)


def with_passes(clip: Clip, acquisition: Acquisition) -> Clip:
    """The clip with its frames numbered by pass."""
    return replace(clip, passes=acquisition.passes)


def _state_machine(clip: Clip, present: Mask) -> Iterator[Event]:
    """The state changes; a loss is reported at the first frame after the pass."""
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
    """Frames (T,) that repeat the previous pose, bit for bit, in a run longer than MAX_ABSENCE.

    Formats without a code for "nobody" make recorders repeat the last pose until a subject returns.
    """
    p = clip.positions.reshape(len(clip.times), -1)
    same = np.concatenate([[False], ((p[1:] == p[:-1]) | (np.isnan(p[1:]) & np.isnan(p[:-1]))).all(axis=1)])
    frozen = np.zeros(len(p), dtype=np.bool_)
    for repeated in runs(same):
        if clip.times[repeated.stop - 1] - clip.times[repeated.start - 1] > MAX_ABSENCE:
            frozen[repeated] = True
    if len(p) > 1 and frozen[1:].all():
        frozen[0] = True  # the whole clip is one pose: no person
    return frozen


def _body_jumps(clip: Clip, present: Mask) -> Mask:
    """Frames (T,) that most joints reached faster than a human can, from the last frame with a subject."""
    jumps = np.zeros(len(present), dtype=np.bool_)
    frames = np.flatnonzero(present)
    step = np.linalg.norm(np.diff(clip.positions[frames], axis=0), axis=-1)
    step[np.isnan(step)] = -1.0
    count = (step >= 0).sum(axis=1)
    # The median over the joints seen in both frames: the others sort to the front.
    middle = step.shape[1] - 1 - count // 2
    median = np.take_along_axis(np.sort(step, axis=1), np.maximum(middle, 0)[:, None], axis=1)[:, 0]
    limit = TOP_SPEED * np.diff(clip.times[frames]) + JUMP_NOISE
    jumps[frames[1:]] = (count > 0) & (median > limit)
    return jumps
